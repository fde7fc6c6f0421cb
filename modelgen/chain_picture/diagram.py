"""What a picture of a chain shows: bodies, links, forces and sensors by their names."""

from __future__ import annotations

from dataclasses import dataclass

GROUND = "ground"


@dataclass(frozen=True)
class DrawnBody:
    """A body: inertia, what rubs against the ground, constant force, actuator, (key, measures) of sensors."""

    name: str
    inertia: str
    friction: tuple[str, ...] = ()
    offset: str | None = None
    actuator: str | None = None
    sensors: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class DrawnLink:
    """A spring of deflection q_first / ratio - q_second; the second may be the ground. No ratio: 1."""

    first: str
    second: str
    springs: tuple[str, ...]
    damping: str | None = None
    ratio: str | None = None


@dataclass(frozen=True)
class DrawnDeflection:
    """A sensor between two bodies."""

    key: str
    measures: str
    first: str
    second: str


@dataclass(frozen=True)
class ChainDiagram:
    """A chain; bodies and links in the order of the spec, links between bodies that are there."""

    title: str
    bodies: tuple[DrawnBody, ...]
    links: tuple[DrawnLink, ...]
    deflections: tuple[DrawnDeflection, ...] = ()
