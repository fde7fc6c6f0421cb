"""The description of a chain: frozen values that need no pydantic, and the order of the parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Literal

from modelgen.spec.units import Measures, Motion, Role, parameter_unit

GROUND = "ground"
LINK_ROLES: tuple[Role, ...] = ("damping", "stiffness", "stiffness3")

Friction = Literal["symmetric", "asymmetric"]


@dataclass(frozen=True)
class Body:
    """A body with one coordinate; inertia to offset name parameters, actuator names a measured force."""

    name: str
    inertia: str
    viscous: str | None
    coulomb: str | None
    offset: str | None
    actuator: str | None
    friction: Friction
    motion: Motion


@dataclass(frozen=True)
class Link:
    """A spring of deflection q_first / ratio - q_second; only the second of `bodies` may be "ground"."""

    bodies: tuple[str, str]
    stiffness: str
    damping: str | None
    stiffness3: str | None
    ratio: Fraction


@dataclass(frozen=True)
class Sensor:
    """A measured signal, either of a body or of the deflection between two bodies (the other one is None)."""

    key: str
    body: str | None
    deflection: tuple[str, str] | None
    measures: Measures


@dataclass(frozen=True)
class Parameter:
    """A physical parameter: its role, the bodies it acts on (never the ground) and its SI unit."""

    name: str
    role: Role
    bodies: tuple[str, ...]
    unit: str


@dataclass(frozen=True)
class ChainSpec:
    """A chain as its user described it, free of contradictions.

    Attributes
    ----------
    known
        Value (SI) of every parameter that is not to be estimated.
    parameter_sets, sensor_sets
        By name of the set; the sensors of a set in the order of the file.
    source
        Name of the file, without its folder.
    sha256
        Hash of the file's bytes, 64 hexadecimal digits.
    """

    name: str
    title: str
    motion: Motion
    bodies: tuple[Body, ...]
    links: tuple[Link, ...]
    known: Mapping[str, float] = field(hash=False)
    parameter_sets: Mapping[str, Mapping[str, float]] = field(hash=False)
    sensor_sets: Mapping[str, tuple[Sensor, ...]] = field(hash=False)
    source: str
    sha256: str

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All physical parameters, known ones too: body by body, then link by link.

        For the two-body chain this is the order of Pham 2002, eq. (6). A name that several elements share
        appears once, with the bodies of all of them.
        """
        uses: dict[str, list[Parameter]] = {}
        for _, parameter in elements(self):
            uses.setdefault(parameter.name, []).append(parameter)
        return tuple(
            Parameter(
                name, same[0].role, tuple(dict.fromkeys(b for p in same for b in p.bodies)), same[0].unit
            )
            for name, same in uses.items()
        )


def elements(spec: ChainSpec) -> Iterator[tuple[str, Parameter]]:
    """Yield (path of the key, parameter it names) in the fixed order, every use of a shared name."""
    motions = {body.name: body.motion for body in spec.bodies}
    for index, body in enumerate(spec.bodies):
        for role, name in _body_parameters(body):
            unit = parameter_unit(body.motion, role)
            yield f"bodies[{index}].{role}", Parameter(name, role, (body.name,), unit)
    for index, link in enumerate(spec.links):
        ends = tuple(name for name in link.bodies if name in motions)
        motion = motions[ends[-1]] if ends else spec.motion  # the deflection is one of the second body
        for role in LINK_ROLES:
            name = getattr(link, role)
            if name is not None:
                yield f"links[{index}].{role}", Parameter(name, role, ends, parameter_unit(motion, role))


def _body_parameters(body: Body) -> Iterator[tuple[Role, str]]:
    named: list[tuple[Role, str | None]] = [("inertia", body.inertia)]
    for suffix in ("_plus", "_minus") if body.friction == "asymmetric" else ("",):
        named += [("viscous", body.viscous and body.viscous + suffix)]
        named += [("coulomb", body.coulomb and body.coulomb + suffix)]
    named += [("offset", body.offset)]
    return ((role, name) for role, name in named if name is not None)
