"""Plant + position and velocity controller -> one linear system with Coulomb friction.

A continuous controller that senses the motor's own coordinate without error closes the loop algebraically: no
solver, no tolerance. A sampled one (`drive`) works on the open loop, step by step (`motion`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, isfinite, pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.runtime.model.model import Model
from modelgen.runtime.simulation.plant import Plant, make_plant
from modelgen.runtime.simulation.thresholds import (
    BANDWIDTH_RATIO,
    DAMPING_RATIO,
    LOWEST_BANDWIDTH_HZ,
    RIGID_BANDWIDTH_HZ,
)
from modelgen.runtime.stick_slip.linear_mode import FrictionSystem, Mode


@dataclass(frozen=True)
class PositionVelocityController:
    """Gamma = kp (r - q) + kv (rate_gain r' - v) + feedforward on the actuator's body; kp in N m/rad or N/m.

    A cascade, velocity gain times (position gain times (r - q) - v), has kp = the product of both gains, and
    rate_gain = 0.
    """

    kp: float
    kv: float
    rate_gain: float = 1.0

    def __post_init__(self) -> None:
        for name, value in (("kp", self.kp), ("kv", self.kv), ("rate_gain", self.rate_gain)):
            if not is_usable(value):
                raise DataError.at(f"controller: {name}", f"is {value!r}", f"give a finite number; {REMEDY}")


@dataclass(frozen=True, eq=False)
class Vibration:
    """Undamped modes of a plant: frequencies in Hz (0 for a rigid one), shape (bodies,), lowest first.

    `mobility` is each mode's share of the inverse inertia felt at the actuator, in 1/(kg m^2) or 1/kg.
    `lowest` is the motion of every body in the lowest mode per unit at the actuator: the gear ratios of a
    chain that turns freely.
    """

    frequencies_hz: FloatArray
    mobility: FloatArray
    lowest: FloatArray

    @property
    def elastic_hz(self) -> FloatArray:
        """Frequencies of the elastic modes in Hz, ascending, shape (modes,)."""
        return self.frequencies_hz[self.frequencies_hz > 0.0]

    @property
    def drive_inertia(self) -> float:
        """Inertia felt at the actuator below the elastic modes; in a grounded chain, in the lowest one."""
        rigid = self.frequencies_hz == 0.0
        rigid[0] = True
        return float(1.0 / max(self.mobility[rigid].sum(), 1e-12 * self.mobility.sum()))

    @property
    def compliance(self) -> float:
        """Static deflection at the actuator per unit of force; infinite for a chain that can turn freely."""
        if self.frequencies_hz[0] == 0.0:
            return float("inf")
        return float((self.mobility / (2.0 * pi * self.frequencies_hz) ** 2).sum())


@lru_cache(maxsize=8)
def vibration(plant: Plant) -> Vibration:
    """Return the undamped modes; the mass matrix is diagonal, so the problem is made symmetric by scaling."""
    n = len(plant.bodies)
    root = np.sqrt(plant.inertia)
    A = plant.space((1,) * len(plant.sticking)).A
    symmetric = -root[:, None] * A[n:, :n] / root
    squares, shapes = np.linalg.eigh(0.5 * (symmetric + symmetric.T))
    squares[squares < 1e-9 * squares.max()] = 0.0
    shapes /= root[:, None]
    at_actuator = shapes[plant.driven, 0]
    # a node at the actuator: the mode exerts no force on it
    lowest = shapes[:, 0] / at_actuator if at_actuator else np.ones(n)
    return Vibration(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * pi), shapes[plant.driven] ** 2, lowest)


def rigid_motion(model: Model) -> dict[str, float]:
    """Return how every body moves with the driven one when the chain is rigid; its sign needs no values.

    Empty for a chain that cannot be simulated.
    """
    try:
        plant = make_plant(model, dict.fromkeys(model.parameters, 1.0))
    except DataError:
        return {}
    return dict(zip(plant.bodies, vibration(plant).lowest.tolist(), strict=True))


def bandwidth_hz(modes: Vibration) -> float:
    """Return the bandwidth of the default controller."""
    if not modes.elastic_hz.size:
        return RIGID_BANDWIDTH_HZ
    return max(BANDWIDTH_RATIO * float(modes.elastic_hz[0]), LOWEST_BANDWIDTH_HZ)


def default_controller(plant: Plant) -> PositionVelocityController:
    """Return gains for the inertia felt at the actuator, slow against the lowest elastic mode."""
    modes = vibration(plant)
    rate = 2.0 * pi * bandwidth_hz(modes)
    return PositionVelocityController(
        modes.drive_inertia * rate**2, 2.0 * DAMPING_RATIO * modes.drive_inertia * rate
    )


def open_loop(plant: Plant, bandwidth_hz: float = inf, further: Sequence[int] = ()) -> FrictionSystem:
    """Return the chain with the commanded force as its first input, behind a current loop if that lags.

    The force is then the last state: Gamma' = 2 pi bandwidth_hz (command - Gamma). The other inputs are the
    forces of further actuators, given as columns of B; they act at once.

    Raises
    ------
    DataError
        When there are further forces, and cubic springs.
    """
    if further and plant.model.cubic_springs:
        what = "has cubic springs, and forces of several actuators to follow"
        raise DataError.at("simulation", what, "give the links no stiffness3, or one actuator a force")
    column, lags = plant.actuator, int(isfinite(bandwidth_hz))
    resting = plant.space((0,) * len(plant.sticking))
    drift = np.r_[resting.E @ plant.offsets, np.zeros(lags)]
    springs = plant.cubic_forces(lags)
    B = np.vstack((resting.B[:, [column, *further]], np.zeros((lags, 1 + len(further)))))
    if not lags:
        return FrictionSystem(lambda mode: plant.space(mode).A, B, drift, plant.coulomb_bodies, 0, springs)
    rate = 2.0 * pi * bandwidth_hz

    def matrix(mode: Mode) -> FloatArray:
        A = np.zeros((len(B), len(B)))
        A[:-1, :-1], A[:, [-1]] = plant.space(mode).A, B[:, :1]
        A[-1, -1] = -rate
        return A

    inputs = B.copy()
    inputs[:, 0] = 0.0
    inputs[-1, 0] = rate
    return FrictionSystem(matrix, inputs, drift, plant.coulomb_bodies, lags, springs)


def closed_loop(
    plant: Plant,
    controller: PositionVelocityController,
    bandwidth_hz: float = inf,
    further: Sequence[int] = (),
) -> FrictionSystem:
    """Return the closed loop; its first input is w = kp r + kv rate_gain r' + feedforward.

    The forces of further actuators, columns of B, are the other inputs.
    """
    system = open_loop(plant, bandwidth_hz, further)
    states = [plant.driven, len(plant.bodies) + plant.driven]

    def matrix(mode: Mode) -> FloatArray:
        A: FloatArray = np.array(system.matrix(mode), dtype=float)
        A[:, states] -= np.outer(system.B[:, 0], [controller.kp, controller.kv])
        return A

    return replace(system, matrix=matrix)
