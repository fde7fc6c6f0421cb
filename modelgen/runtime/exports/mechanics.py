"""A generated module's direct model taken apart: bodies, springs, dampers, friction, sensors.

The matrix of a spring's or damper's parameter (`chain_matrices`) is the product of its lever with itself,
such as (1/N, -1) for the deflection q_1 / N - q_2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.chain_matrices import ChainMatrices, chain_matrices
from modelgen.runtime.model.link_couplings import couples_as, couplings
from modelgen.runtime.model.mechanical_parts import Friction
from modelgen.runtime.model.model import Model
from modelgen.runtime.simulation.plant import sensor_levers

NEGLIGIBLE = 1e-12  # of a lever's largest entry: what rounding leaves of a zero

#: (place of a body, factor of its coordinate) pairs
Lever = tuple[tuple[int, float], ...]
ROTATION = {"position": "rad", "velocity": "rad/s", "force": "N m"}
TRANSLATION = {"position": "m", "velocity": "m/s", "force": "N"}


@dataclass(frozen=True)
class MechanicalBody:
    """A body: the parameter of its inertia, how it moves, and its friction to the ground."""

    name: str
    inertia: str
    motion: Literal["rotation", "translation"]
    viscous: tuple[str | None, str | None]  # forwards, backwards
    friction: Friction | None

    @property
    def units(self) -> dict[str, str]:
        """Units of its position, velocity and force."""
        return ROTATION if self.motion == "rotation" else TRANSLATION

    @property
    def asymmetric(self) -> bool:
        """Whether its friction differs by direction."""
        return self.friction is not None and self.friction.asymmetric


@dataclass(frozen=True)
class MechanicalSpring:
    """A force against a deflection, the sum of lever times coordinate: its parameters; None for none."""

    lever: Lever
    stiffness: str | None = None
    damping: str | None = None
    stiffness3: str | None = None


@dataclass(frozen=True)
class MechanicalSensor:
    """A sensor: the `order`-th derivative of the sum of lever times coordinate."""

    key: str
    order: int
    lever: Lever
    unit: str


@dataclass(frozen=True)
class MechanicalActuator:
    """An actuator and the body it acts on, by its place."""

    key: str
    body: int
    unit: str


@dataclass(frozen=True)
class Mechanics:
    """A chain as a mechanism; places of bodies are those of the model's state."""

    bodies: tuple[MechanicalBody, ...]
    springs: tuple[MechanicalSpring, ...]
    readings: tuple[MechanicalSensor, ...]
    pushes: tuple[MechanicalActuator, ...]


def mechanics(model: Model) -> Mechanics:
    """Return the mechanism of a model."""
    matrices = chain_matrices(model)
    names = matrices.bodies
    return Mechanics(
        tuple(_body(model, name) for name in names),
        tuple(_springs(model, matrices)),
        tuple(_readings(model)),
        tuple(
            MechanicalActuator(actuator.key, names.index(actuator.body), actuator.unit)
            for actuator in model.actuators
        ),
    )


def _body(model: Model, name: str) -> MechanicalBody:
    own = {
        role.role: parameter
        for parameter, role in model.roles.items()
        if name in role.bodies and role.role in ("inertia", "viscous")
    }
    friction = next((entry for entry in model.friction if entry.body == name), None)
    viscous = own.get("viscous")
    ways = (viscous, viscous)
    if friction is not None and friction.asymmetric and viscous is not None:
        stem = viscous.removesuffix("_minus" if viscous.endswith("_minus") else "_plus")
        ways = (f"{stem}_plus", f"{stem}_minus")
    motion: Literal["rotation", "translation"] = (
        "translation" if model.units[own["inertia"]] == "kg" else "rotation"
    )
    return MechanicalBody(name, own["inertia"], motion, ways, friction)


def _springs(model: Model, matrices: ChainMatrices) -> Iterator[MechanicalSpring]:
    """Yield the springs and dampers; those of one lever are one."""
    found: dict[Lever, dict[str, str]] = {}
    for name, role in model.roles.items():
        if role.role in ("stiffness", "damping"):
            shares = matrices.stiffness if role.role == "stiffness" else matrices.damping
            for lever in _levers(model, matrices, name, shares[name]):
                # two elements of one role between the same bodies stay two
                place = lever if role.role not in found.get(lever, {}) else (*lever, (-1, float(len(found))))
                found.setdefault(place, {})[role.role] = name
    for spring in model.cubic_springs:
        lever = _pointed(np.array([dict(spring.deflection).get(i, 0.0) for i in range(len(matrices.bodies))]))
        found.setdefault(lever, {})["stiffness3"] = spring.parameter
    for lever, names in found.items():
        yield MechanicalSpring(tuple(pair for pair in lever if pair[0] >= 0), **names)


def _levers(model: Model, matrices: ChainMatrices, name: str, share: FloatArray) -> list[Lever]:
    """Return levers whose squares add up to the share: one a link where its links are found."""
    links = couplings(model, matrices, name)
    if couples_as(links, share):
        return [_pointed(link.lever(len(share))) for link in links]
    # one parameter in links of a ring with different ratios: any levers whose squares add up will do
    sizes, shapes = np.linalg.eigh(share)
    return [_pointed(np.sqrt(s) * shapes[:, i]) for i, s in enumerate(sizes) if s > NEGLIGIBLE * sizes[-1]]


def _pointed(lever: FloatArray) -> Lever:
    """Return a lever's pairs, its first factor positive: the deflection is q_1 / N - q_2."""
    size = np.abs(lever).max()
    pairs = [(i, float(c)) for i, c in enumerate(lever) if abs(c) > NEGLIGIBLE * size]
    sign = 1.0 if pairs[0][1] > 0.0 else -1.0
    return tuple((place, sign * factor) for place, factor in pairs)


def _readings(model: Model) -> Iterator[MechanicalSensor]:
    for row, sensor in zip(sensor_levers(model), model.sensors, strict=True):
        size = np.abs(row).max()
        # what equations were solved for has lost a few digits
        factors = [float(f"{c:.12g}") if sensor.order == 2 else float(c) for c in row]
        lever = tuple((i, c) for i, c in enumerate(factors) if abs(c) > NEGLIGIBLE * size)
        yield MechanicalSensor(sensor.key, sensor.order, lever, sensor.unit)
