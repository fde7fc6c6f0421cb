"""Sensors, actuators, rows, friction, cubic springs, roles of parameters: entries of a module as records."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Sensor:
    """What one sensor reads: `measures` of a body, or of the deflection between a pair of bodies."""

    key: str
    body: str | None
    deflection: tuple[str, str] | None
    measures: str
    unit: str

    @property
    def order(self) -> int:
        """How often a position is differentiated in the reading: 0, 1 or 2."""
        return {"position": 0, "velocity": 1, "acceleration": 2}[self.measures]


@dataclass(frozen=True)
class Actuator:
    """A measured or known force (or torque) on a body.

    `lever` is the body's motion when the chain moves as a rigid one: force times lever is comparable across
    gears. A row has the lever of its first body.
    """

    key: str
    body: str
    unit: str
    lever: float


@dataclass(frozen=True)
class RowInfo:
    """One row of the regressor: its origin, and the velocities near whose reversals it does not hold."""

    name: str
    origin: str
    bodies: tuple[str, ...]
    differentiated: int
    order: int
    reversals: tuple[str, ...]
    unit: str
    lever: float


@dataclass(frozen=True)
class Friction:
    """Coulomb friction and offset of a body: one column of E in the state space; `state` is its velocity."""

    body: str
    state: int
    coulomb_plus: str | None
    coulomb_minus: str | None
    offset: str | None
    asymmetric: bool


@dataclass(frozen=True)
class CubicSpring:
    """A force of `parameter` times the cube of a deflection: (coordinate, coefficient) pairs."""

    parameter: str
    deflection: tuple[tuple[int, float], ...]


# The role of what springs bend in a chain that moves as one body.
BENDING = "bending"


@dataclass(frozen=True)
class Role:
    """What a physical parameter is (inertia, viscous, coulomb, ...) and the bodies it acts on."""

    role: str
    bodies: tuple[str, ...]

    @property
    def ends(self) -> str:
        """Both ends of a link, in words: that to the ground names one body."""
        return " and ".join(self.bodies if len(self.bodies) > 1 else (*self.bodies, "the ground"))
