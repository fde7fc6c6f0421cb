"""Plant: a model with checked parameter values, ready for the direct model, Pham 2002, (17)-(19)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.keyword_options import check_named_values
from modelgen.magnitudes import REMEDY, SMALLEST, is_usable, shown_number
from modelgen.runtime.model.chain_matrices import body_inertias
from modelgen.runtime.model.mechanical_parts import Friction
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.simulation.thresholds import LEAST_INERTIA
from modelgen.runtime.stick_slip.linear_mode import CoulombBody, CubicForce, Mode


@dataclass(frozen=True, eq=False)
class Plant:
    """A chain in motion: x' = A x + B Gamma + E f + springs; x is positions, then velocities, as `bodies`.

    Attributes
    ----------
    parameters : mapping
        Every physical parameter, known ones included (SI).
    inertia : ndarray, shape (bodies,)
    actuator : int
        Column of B of the actuator that the controller drives; the forces of the others are given, or 0.
    driven : int
        Index of its body.
    """

    model: Model
    parameters: Mapping[str, float]
    bodies: tuple[str, ...]
    inertia: FloatArray
    actuator: int
    driven: int

    def value(self, name: str | None) -> float:
        """Return a parameter's value; 0 where the chain has no such parameter."""
        return 0.0 if name is None else self.parameters[name]

    @cached_property
    def sticking(self) -> tuple[int, ...]:
        """Columns of E whose bodies have modes: Coulomb friction, or friction that depends on direction."""
        return tuple(
            j
            for j, friction in enumerate(self.model.friction)
            if friction.asymmetric or self.value(friction.coulomb_plus) > 0.0
        )

    @property
    def coulomb_bodies(self) -> tuple[CoulombBody, ...]:
        """The bodies that have modes, in the order of `sticking`."""
        return tuple(self._coulomb_body(self.model.friction[j]) for j in self.sticking)

    def _coulomb_body(self, friction: Friction) -> CoulombBody:
        inertia = float(self.inertia[friction.state - len(self.bodies)])
        plus, minus = self.value(friction.coulomb_plus), self.value(friction.coulomb_minus)
        return CoulombBody(friction.state, inertia, plus, minus)

    @property
    def offsets(self) -> FloatArray:
        """Constant part of the friction f, shape (columns of E,)."""
        return np.array([self.value(friction.offset) for friction in self.model.friction])

    @property
    def force(self) -> str:
        """Key of the actuator that the controller drives."""
        return self.model.actuators[self.actuator].key

    @property
    def further(self) -> Mapping[str, int]:
        """The other actuators: key to column of B."""
        return {entry.key: i for i, entry in enumerate(self.model.actuators) if i != self.actuator}

    def cubic_forces(self, lags: int = 0) -> tuple[CubicForce, ...]:
        """Return what cubic springs add to x', with room for so many states behind the velocities."""
        n = len(self.bodies)
        found = []
        for spring in self.model.cubic_springs:
            lever = np.zeros(n)
            for place, coefficient in spring.deflection:
                lever[place] = coefficient
            push = -self.value(spring.parameter) * lever / self.inertia
            none = np.zeros(lags)
            found.append(CubicForce(np.r_[lever, np.zeros(n), none], np.r_[np.zeros(n), push, none]))
        return tuple(found)

    def space(self, mode: Mode) -> Any:
        """Return (A, B, C, D, E, F) in a mode, given in the order of `sticking`."""
        friction = self.model.friction
        # a body at rest has no viscous friction: either direction will do
        directions = {
            friction[j].body: -1 if sign < 0 else 1 for j, sign in zip(self.sticking, mode, strict=True)
        }
        return self.model.state_space(self.parameters, directions)


def felt_accelerations(model: Model) -> FloatArray:
    """Return what every sensor reads per acceleration of each body, in SI, shape (sensors, bodies).

    The direct model holds it only multiplied by the equations of motion: C is it times the lower half of
    A, likewise with B and E, whatever the parameters; random ones make the equations independent.
    """
    names = model.every_parameter
    draws = np.random.default_rng(0).uniform(1.0, 2.0, len(names))
    space = model.state_space(dict(zip(names, draws.tolist(), strict=True)), {})
    motion = np.hstack((space.A, space.B, space.E))[len(space.A) // 2 :]
    read = np.hstack((space.C, space.D, space.F))
    # gears spread equations and states over many powers of ten
    bodies = np.abs(motion).max(axis=1)
    states = np.abs(motion / bodies[:, None]).max(axis=0)
    weights = 1.0 / np.where(states == 0.0, 1.0, states)
    balanced = (motion / bodies[:, None] * weights).T
    found = np.linalg.lstsq(balanced, (read * weights).T, rcond=None)[0].T / bodies
    accelerometers = [[float(sensor.measures == "acceleration")] for sensor in model.sensors]
    return np.asarray(found * np.array(accelerometers), dtype=float)


def sensor_levers(model: Model) -> FloatArray:
    """Return what every sensor reads per coordinate of each body, differentiated as the sensor does.

    In SI, shape (sensors, bodies); of accelerometers they have lost the digits that solving equations costs.
    """
    found = felt_accelerations(model)
    C = model.state_space(
        dict.fromkeys(model.every_parameter, 1.0), {one.body: 1 for one in model.friction}
    ).C
    for place, sensor in enumerate(model.sensors):
        if sensor.order < 2:
            found[place] = C[place, sensor.order * found.shape[1] :][: found.shape[1]]
    return found


def make_plant(model: Model, parameters: Mapping[str, float], actuator: str | None = None) -> Plant:
    """Return the plant of a model with these parameter values.

    Parameters
    ----------
    model : Model
        The generated module's view.
    parameters : mapping of str to float
        Physical parameters (SI); known ones may be left out, names that the chain does not have are ignored.
    actuator : str, optional
        Key of the actuator to be used; by default the first.

    Raises
    ------
    DataError
        With one problem per parameter that is missing or impossible; for a chain without an actuator.
    """
    model.refuse_arm("a simulation")
    column = _actuator_column(model, actuator)
    check_named_values("parameters", parameters)
    values = {**model.known, **parameters}
    values = checked_values(model, model.every_parameter, values)
    bodies, inertia = _bodies(model, values)
    driven = bodies.index(model.actuators[column].body)
    return Plant(model, MappingProxyType(values), bodies, inertia, column, driven)


def possible(model: Model, parameters: Mapping[str, float]) -> dict[str, float]:
    """Return parameters with which a chain can be simulated.

    Signs that physics forbids are taken away, and what an iteration drove to zero is zero.
    """
    largest: dict[str, float] = {}
    for name, value in parameters.items():
        if name in model.roles and model.roles[name].role == "inertia":
            unit = model.units.get(name, "")
            largest[unit] = max(largest.get(unit, 0.0), abs(value))
    moved = dict(parameters)
    for name, value in parameters.items():
        role = model.roles[name].role if name in model.roles else ""
        if role == "inertia":
            moved[name] = max(value, LEAST_INERTIA * largest[model.units.get(name, "")])
        elif role in ("coulomb", "stiffness", "damping", "viscous"):
            moved[name] = value if value >= SMALLEST else 0.0
    return moved


def measured_forces(plant: Plant, record: Record) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the measured force of the driven actuator, and those of the others by key.

    All have shape (n,), in N m or N.

    Raises
    ------
    DataError
        With one problem per force that the record lacks.
    """
    refuse_lacking_forces(plant, record)
    return record.signals[plant.force], {key: record.signals[key] for key in plant.further}


def refuse_lacking_forces(plant: Plant, record: Record) -> None:
    """Raise DataError with one problem per force that a record lacks."""
    keys = [key for key in (plant.force, *plant.further) if key not in record.keys]
    if keys:
        raise DataError(*(missing_name(record.name, "force", key, record.keys) for key in keys))


def body_order(model: Model) -> tuple[str, ...]:
    """Return the bodies in the order of the state."""
    return tuple(body for body, _ in body_inertias(model))


def _actuator_column(model: Model, actuator: str | None) -> int:
    keys = [entry.key for entry in model.actuators]
    if not keys:
        remedy = "give a body an actuator in the spec"
        raise DataError.at(f"model {model.chain}", "has no actuator, so nothing can drive it", remedy)
    if actuator is not None and actuator not in keys:
        raise DataError.at("actuator", f"there is no {actuator!r}", f"choose one of {', '.join(keys)}")
    return keys.index(actuator or keys[0])


def checked_values(model: Model, names: Sequence[str], given: Mapping[str, Any]) -> dict[str, float]:
    """Return the values (SI) of some parameters.

    Raises
    ------
    DataError
        With one problem per parameter that is missing, no number, or impossible.
    """
    problems = [problem for name in names if (problem := _value_problem(model, name, given.get(name)))]
    DataError.raise_any(problems)
    return {name: float(given[name]) for name in names}


def _value_problem(model: Model, name: str, value: Any) -> Problem | None:
    """Return what is wrong with a parameter's value: absent, no number, or physically impossible."""
    where = f"parameters: {name}"
    unit = model.units.get(name, "SI")
    if value is None:
        return Problem(where, "is missing", f"give its value in {unit}")
    if not is_usable(value):
        return Problem(where, f"is {shown_number(value)}", f"give a finite number in {unit}; {REMEDY}")
    role = model.roles[name].role if name in model.roles else ""
    # a link of an arm may have its inertia in the drive
    if role == "inertia" and (value < 0.0 if model.is_arm else value <= 0.0):
        remedy = f"an inertia must {'not be negative' if model.is_arm else 'be positive'}"
        return Problem(where, f"is {float(value)!r} {unit}", remedy)
    if role == "stiffness" and model.is_arm and value <= 0.0:
        return Problem(where, f"is {float(value)!r} {unit}", "a stiffness must be positive")
    if role == "coulomb" and value < 0.0:
        return Problem(where, f"is {float(value)!r} {unit}", "a friction force must be zero or positive")
    return None


def _bodies(model: Model, values: Mapping[str, float]) -> tuple[tuple[str, ...], FloatArray]:
    """Return the bodies in the order of the state, and their inertias."""
    order = body_inertias(model)
    return tuple(body for body, _ in order), np.array([values[inertia] for _, inertia in order])
