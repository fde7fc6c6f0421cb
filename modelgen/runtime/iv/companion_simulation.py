"""A model simulated along a record: what its sensors would have read without noise.

The model is driven by the measured forces of all actuators. These alone would let it drift away from the
record, so a weak feedback holds the first actuator's body near the record's low-passed position; its loop is
slow against the dynamics of interest, and what it takes from the record is smoother still: noise of the
sensors does not get through. Where the record brings the reference and the controller is known, the closed
loop itself is run instead, on the first actuator; the forces of the others remain the measured ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.filters.zero_phase import support_samples, zero_phase
from modelgen.runtime.iv.thresholds import (
    AT_REST,
    FEEDBACK_SHARE,
    HIGHEST_LED,
    LEAST_INERTIA,
    LED,
    LED_ORDER,
    SMOOTHING,
    SMOOTHING_ORDER,
    START_TOLERANCE,
)
from modelgen.runtime.model.model import Model, Sensor
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_terms import mismatch_terms
from modelgen.runtime.simulation.arms.joint_controller import JointController
from modelgen.runtime.simulation.closed_loop import PositionVelocityController, vibration
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.excitation import Excitation, excitation_from_record
from modelgen.runtime.simulation.held_chain import HeldChain, held_chain
from modelgen.runtime.simulation.motion import Motion, move, readings, true_signals
from modelgen.runtime.simulation.plant import Plant, make_plant, measured_forces
from modelgen.runtime.simulation.thresholds import DAMPING_RATIO

# An inertia stays above this share of the largest one of its unit: a plant without inertia cannot be run.
REFERENCE = "reference"


@dataclass(frozen=True, eq=False)
class Simulated:
    """A record as the model would have read it, noise-free.

    `record` holds the channels, `motion` the signals of all bodies (``v_BODY`` and the like), velocities as
    they were in the measured record. `index` says which of the records it is. `away` holds by how far the
    positions of bodies with an encoder were elsewhere in it, and the noise of that, rms, `speed`
    the speeds of bodies as simulated. `slow` is a speed that counts as low, by body, the same in all records.
    `felt` is for `modelgen.runtime.iv.pushed_chain`: which rows feel the pushes that it has looked at.
    `measured` is the record itself, which leads the motion up to `led_hz`.
    """

    plant: Plant
    record: Record
    motion: Mapping[str, FloatArray]
    index: int
    away: Mapping[str, tuple[FloatArray, float]] = field(default_factory=dict)
    speed: Mapping[str, FloatArray] = field(default_factory=dict)
    slow: Mapping[str, float] = field(default_factory=dict)
    felt: dict[tuple[float, ...], tuple[int, ...]] = field(default_factory=dict, repr=False)
    measured: Record | None = None
    led_hz: float = 0.0

    @cached_property
    def held(self) -> HeldChain:
        """The chain at rest, held by a weak feedback, at the frequencies of the record's spectrum."""
        size = quick_length(self.record.n)
        omega = np.asarray(2.0 * pi * np.fft.rfftfreq(size, self.record.dt), dtype=float)
        return held_chain(self.plant, omega)

    @cached_property
    def mismatch(self) -> tuple[dict[str, float], ...]:
        """What Y - W X takes of each signal at the simulation's parameters, row by row of the model."""
        model = self.plant.model
        return mismatch_terms(model, model.base_from_physical(self.plant.parameters))


@dataclass(frozen=True)
class Loop:
    """The controller that was at work during the records, where it is known; see `modelgen.simulate`."""

    controller: PositionVelocityController | JointController
    drive: Drive = field(default_factory=Drive)


def run_beside(
    model: Model,
    parameters: Mapping[str, float],
    record: Record,
    choice: FilterChoice,
    loop: Loop | None = None,
) -> Record:
    """Return what the sensors and actuators would read if the model were right and nothing were noisy.

    Parameters
    ----------
    model : Model
        With one actuator or several.
    parameters : mapping of str to float
        Physical parameters (SI), as `possible` returns them.
    record : Record
        The measured record, with the forces of all actuators.
    choice : FilterChoice
        Its dynamics set the bandwidth of the weak feedback.
    loop : Loop, optional
        Where it is given and the record has a channel "reference", the closed loop is simulated.

    Raises
    ------
    DataError
        When the model cannot be simulated, the record lacks a force, or the motion grows without bound.
    """
    if model.is_arm:
        from modelgen.runtime.iv.arms.companion_motion import arm_beside, joint_controller

        law = joint_controller(loop.controller) if loop is not None else None
        return _as_read(record, arm_beside(model, parameters, record, choice, law))
    plant, motion = _beside(model, parameters, record, choice, loop)
    return _as_read(record, readings(plant, motion))


def simulated_beside(
    model: Model,
    parameters: Mapping[str, float],
    record: Record,
    choice: FilterChoice,
    loop: Loop | None = None,
    index: int = 0,
) -> Simulated:
    """Return the same with the plant and the signals of all bodies; `index` says which record it is."""
    plant, motion = _beside(model, parameters, record, choice, loop)
    true = true_signals(plant, motion)
    keys = [entry.key for entry in model.actuators] + [entry.key for entry in model.sensors]
    read = {key: true[key] for key in keys}
    return _as_moved(Simulated(plant, _as_read(record, read), true, index), record, choice)


def _as_moved(simulated: Simulated, record: Record, choice: FilterChoice) -> Simulated:
    """Return a simulation with the motion of the measured record.

    The weak feedback bends the slow motion, and what the model lacks moved the record: a further force that
    is worked out along the simulated motion is some percent off. What a body's own sensor reads leads it, a
    body without one follows the slow part of the nearest.
    """
    motion, away, speeds = dict(simulated.motion), {}, {}
    led_hz = min(LED * _dynamics_hz(choice), HIGHEST_LED * record.fs)
    for body in simulated.plant.bodies:
        speeds[body] = motion[f"v_{body}"]
        sensor, gear = nearest_sensor(simulated.plant, body, record)
        if sensor.order > 1:
            continue
        own = sensor.body == body
        wide = led_hz if own else _smoothing_hz(record, choice)
        further = (record.signals[sensor.key] - simulated.record.signals[sensor.key]) * gear
        further = zero_phase(further, LED_ORDER, wide, record.fs)
        speed = speeds[body]
        # a body that sticks has no direction: noise must not give it one
        moving = np.abs(speed) > AT_REST * np.max(np.abs(speed))
        change = further if sensor.order else differentiate(further, record.dt)
        motion[f"v_{body}"] = speed + np.where(moving, change, 0.0)
        if own and sensor.order == 0:
            away[body] = further, float(np.sqrt(record.facts.spectrum(sensor.key).noise * wide))
    return replace(simulated, motion=motion, away=away, speed=speeds, measured=record, led_hz=led_hz)


def _beside(
    model: Model, parameters: Mapping[str, float], record: Record, choice: FilterChoice, loop: Loop | None
) -> tuple[Plant, Motion]:
    plant = make_plant(model, parameters)
    start = _initial_state(plant, record, choice)
    if loop is not None and REFERENCE in record.signals:
        controller = loop.controller
        if not isinstance(controller, PositionVelocityController):
            remedy = "give Loop(PositionVelocityController(...))"
            raise DataError.at("loop", "has the controller of an arm", remedy)
        excitation = replace(excitation_from_record(record, 1), forces=measured_forces(plant, record)[1])
        return plant, move(plant, controller, loop.drive, excitation, start, 1)
    return plant, move(plant, *_weak_feedback(plant, record, choice), start, 1)


def _as_read(record: Record, true: Mapping[str, FloatArray]) -> Record:
    return record.edited({key: true[key] for key in record.signals if key in true})


def possible(model: Model, parameters: Mapping[str, float]) -> dict[str, float]:
    """Return parameters with which a chain can be simulated: signs that physics forbids are taken away."""
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
            moved[name] = max(value, 0.0)
    return moved


def _weak_feedback(
    plant: Plant, record: Record, choice: FilterChoice
) -> tuple[PositionVelocityController, Drive, Excitation]:
    rate = 2.0 * pi * _feedback_hz(choice)
    inertia = vibration(plant).drive_inertia
    controller = PositionVelocityController(inertia * rate**2, 2.0 * DAMPING_RATIO * inertia * rate)
    position, velocity = _followed(plant, plant.bodies[plant.driven], record, choice)
    force, further = measured_forces(plant, record)
    return controller, Drive(), Excitation(position, velocity, force, record.fs, record.name, further)


def _feedback_hz(choice: FilterChoice) -> float:
    return FEEDBACK_SHARE * _dynamics_hz(choice)


def _dynamics_hz(choice: FilterChoice) -> float:
    return choice.dynamics_hz or choice.cutoff_hz


def _followed(plant: Plant, body: str, record: Record, choice: FilterChoice) -> tuple[FloatArray, FloatArray]:
    """Return the slow part of a body's position and velocity, shape (n,) each."""
    sensor, gear = nearest_sensor(plant, body, record)
    return _slow_part(record.signals[sensor.key] * gear, sensor.order, record, choice)


def _slow_part(
    raw: FloatArray, order: int, record: Record, choice: FilterChoice
) -> tuple[FloatArray, FloatArray]:
    """Return the same from a body's readings, shape (n,), of its position (order 0) or a derivative."""
    smooth = zero_phase(raw, SMOOTHING_ORDER, _smoothing_hz(record, choice), record.fs)
    velocity = differentiate(smooth, record.dt) if order == 0 else smooth
    if order == 2:
        # a constant in an accelerometer is its own: the velocity it would integrate to is none
        velocity = np.cumsum(smooth - smooth.mean()) * record.dt
    position = smooth if order == 0 else np.cumsum(velocity) * record.dt
    return position, velocity


def _smoothing_hz(record: Record, choice: FilterChoice) -> float:
    return min(SMOOTHING * _feedback_hz(choice), HIGHEST_LED * record.fs)


def nearest_sensor(plant: Plant, body: str, record: Record) -> tuple[Sensor, float]:
    """Return the sensor that shows a body's slow motion best, and the ratio of the two motions."""
    rigid = vibration(plant).lowest
    sensors = [sensor for sensor in plant.model.sensors if sensor.body and sensor.key in record.signals]
    if not sensors:
        what = "has sensors of deflections only: nothing shows where the simulated model should be"
        raise DataError.at(record.name, what, "use method wls")
    best = min(sensors, key=lambda sensor: (sensor.order, sensor.body != body))
    own, seen = rigid[plant.bodies.index(body)], rigid[plant.bodies.index(best.body or "")]
    if not (np.isfinite(own) and np.isfinite(seen) and seen):
        raise DataError.at("simulation", f"{body} and {best.key} do not move together", "use method wls")
    return best, float(own / seen)


def _initial_state(plant: Plant, record: Record, choice: FilterChoice) -> FloatArray:
    """Return all positions, then all velocities, at the first sample."""
    # farther away the filter feels nothing; but what an accelerometer reads at rest is its mean over all
    reach = support_samples(SMOOTHING_ORDER, _smoothing_hz(record, choice), record.fs, 0, START_TOLERANCE)
    starts = []
    for body in plant.bodies:
        sensor, gear = nearest_sensor(plant, body, record)
        order = sensor.order
        raw = (
            record.signals[sensor.key] if order == 2 else record.read(sensor.key, 0, min(2 * reach, record.n))
        )
        starts.append(_slow_part(raw * gear, order, record, choice))
    return np.array([start[0][0] for start in starts] + [start[1][0] for start in starts])
