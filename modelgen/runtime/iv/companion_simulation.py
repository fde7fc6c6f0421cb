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
from functools import cached_property, lru_cache
from math import pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.iv.held_motion import (
    HeldChannels,
    HeldMotion,
    dynamics_hz,
    feedback_hz,
    initial_state,
    nearest_sensor,
    smoothing_hz,
)
from modelgen.runtime.iv.thresholds import (
    AT_REST,
    FOLLOWED_AGAIN,
    HIGHEST_LED,
    LED,
    LED_ORDER,
)
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_terms import mismatch_terms
from modelgen.runtime.simulation.arms.joint_controller import JointController
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.excitation import excitation_from_record
from modelgen.runtime.simulation.held_chain import HeldChain, held_chain
from modelgen.runtime.simulation.motion import Motion, move, readings, true_signals
from modelgen.runtime.simulation.plant import Plant, make_plant, measured_forces
from modelgen.runtime.simulation.smoothed_motion import Beyond, smoothed_speeds

REFERENCE = "reference"


@dataclass(frozen=True, eq=False)
class Further:
    """Position (order 0), velocity (1) or acceleration (2), SI, shape (n,), and its noise in unit^2/Hz.

    A body's own sensor reads it, or all sensors show it as far as links carry it to them, noise left out.
    """

    motion: FloatArray
    order: int
    noise: float


@dataclass(frozen=True, eq=False)
class Led:
    """The speed of a body as it was in the measured record, SI, shape (n,).

    `away` is by how much more than simulated its own sensor of lowest order read, if it has one.
    """

    speed: FloatArray
    away: Further | None = None


@dataclass(frozen=True, eq=False)
class Simulated:
    """A record as the model would have read it, noise-free.

    `record` holds the channels, `motion` the signals of all bodies (``v_BODY`` and the like), `led` what the
    measured record says of these, by body. `index` says which of the records it is. `slow` is a speed that
    counts as low, by body, the same in all records. `felt` is which rows feel pushes, of `pushed_chain`.
    `measured` is the record itself, which leads the motion up to `led_hz`; below `slow_hz` the sensors of
    lowest order alone do so. `smoothed` are speeds of all bodies in the record asked for last.
    """

    plant: Plant
    record: Record
    motion: Mapping[str, FloatArray]
    index: int
    led: Mapping[str, Led] = field(default_factory=dict, repr=False)
    slow: Mapping[str, float] = field(default_factory=dict)
    felt: dict[tuple[float, ...], tuple[int, ...]] = field(default_factory=dict, repr=False)
    measured: Record | None = None
    led_hz: float = 0.0
    slow_hz: float = 0.0
    smoothed: list[tuple[Record, FloatArray | None]] = field(default_factory=list, repr=False)

    @cached_property
    def held(self) -> HeldChain:
        """The chain at rest, held by a weak feedback, at the frequencies of the record's spectrum."""
        size = quick_length(self.record.n)
        omega = np.asarray(2.0 * pi * np.fft.rfftfreq(size, self.record.dt), dtype=float)
        return held_chain(self.plant, omega)

    @cached_property
    def places(self) -> dict[tuple[str, str], FloatArray]:
        """Positions of bodies, deflections of links, SI, shape (n,), found for effects, by kind and name."""
        return {}

    @cached_property
    def mismatch(self) -> tuple[dict[str, float], ...]:
        """What Y - W X takes of each signal at the simulation's parameters, row by row of the model."""
        model = self.plant.model
        return mismatch_terms(model, model.base_from_physical(self.plant.parameters))

    def away(self, body: str, record: Record) -> Further | None:
        """Return by how much more than in the simulation a body's own sensor of lowest order reads."""
        read = record.signals
        own = [one for one in self.plant.model.sensors if one.body == body and one.key in read]
        if not own:
            return None
        sensor = min(own, key=lambda one: one.order)
        noise = record.facts.spectrum(sensor.key).noise
        return Further(read[sensor.key] - self.record.signals[sensor.key], sensor.order, noise)

    def further(self, body: str, record: Record) -> Further | None:
        """Return by how much further than in the simulation a body moves in a record, None if unknown.

        What its own sensor of position or velocity reads shows it; else all sensors do, by what links
        carry of its motion to them.
        """
        own = self.away(body, record)
        if own is not None and own.order < 2:
            return own
        sensor, gear = nearest_sensor(self.plant, body, record)
        if sensor.order == 2:
            return None
        away = record.signals[sensor.key] - self.record.signals[sensor.key]
        if not away.any():
            return None
        speeds = self._smoothed(record)
        if speeds is None:
            return None
        mean = away.mean() if sensor.order else (away[-1] - away[0]) / (record.dt * (record.n - 1))
        return Further(speeds[self.plant.bodies.index(body)] + gear * float(mean), 1, 0.0)

    def _smoothed(self, record: Record) -> FloatArray | None:
        # all bodies of a record are asked for, one after the other
        if self.smoothed and self.smoothed[0][0] is record:
            return self.smoothed[0][1]
        read, own, force = record.signals, self.record.signals, self.plant.force
        keys = [one.key for one in self.plant.model.sensors if one.key in read]
        away = {key: read[key] - own[key] for key in keys}
        noise = {key: record.facts.spectrum(key).noise for key in keys}
        difference = Beyond(away, noise, read[force] - own[force], record.dt)
        found = smoothed_speeds(self.plant, difference, self.slow_hz, self.led_hz)
        self.smoothed[:] = [(record, found)]
        return found


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
    plant = _plant(model, tuple(parameters.items()))
    if loop is not None and REFERENCE in record.signals:
        return _as_read(record, readings(plant, _closed(plant, record, choice, loop)))
    held = HeldMotion(plant, record, choice, readings)
    if held.count == 1 or record.in_memory:
        return _as_read(record, held.whole())
    # simulated again whenever it is read: it would take as much as the channels do
    return Record.over(HeldChannels(record, held), record.tag)


def simulated_beside(
    model: Model,
    parameters: Mapping[str, float],
    record: Record,
    choice: FilterChoice,
    loop: Loop | None = None,
    index: int = 0,
) -> Simulated:
    """Return the same with the plant and the signals of all bodies; `index` says which record it is."""
    plant = _plant(model, tuple(parameters.items()))
    if loop is not None and REFERENCE in record.signals:
        true = true_signals(plant, _closed(plant, record, choice, loop))
    else:
        true = HeldMotion(plant, record, choice, true_signals).whole()
    return _along(plant, true, record, choice, index)


def followed_closely(simulated: Simulated, choice: FilterChoice, loop: Loop | None = None) -> Simulated:
    """Return the same kept as close to its record as `HeldMotion` says; a closed loop stays as it is."""
    plant, record = simulated.plant, simulated.measured
    if record is None or (loop is not None and REFERENCE in record.signals):
        return simulated
    true = simulated.motion
    for _ in range(FOLLOWED_AGAIN):
        true = HeldMotion(plant, record, choice, true_signals, true).whole()
    return _along(plant, true, record, choice, simulated.index)


def _along(
    plant: Plant, true: Mapping[str, FloatArray], record: Record, choice: FilterChoice, index: int
) -> Simulated:
    """Return a simulation along a record from its true signals."""
    keys = [entry.key for entry in plant.model.actuators] + [entry.key for entry in plant.model.sensors]
    read = {key: true[key] for key in keys}
    led_hz = min(LED * dynamics_hz(choice), HIGHEST_LED * record.fs)
    slow_hz, read_by = smoothing_hz(record, feedback_hz(choice)), _as_read(record, read)
    found = Simulated(plant, read_by, true, index, measured=record, led_hz=led_hz, slow_hz=slow_hz)
    return replace(found, led=_LedBodies(found, record))


@lru_cache(maxsize=4)  # all records are simulated with the same parameters, one after the other
def _plant(model: Model, parameters: tuple[tuple[str, float], ...]) -> Plant:
    return make_plant(model, dict(parameters))


class _LedBodies(dict[str, Led]):
    """The motion of bodies as it was in the measured record, each worked out when it is asked for.

    The weak feedback bends the slow motion, and what the model lacks moved the record: a further force that
    is worked out along the simulated motion is some percent off. What a body's own sensor reads leads it, a
    body without one is led by what all sensors show of it.
    """

    def __init__(self, simulated: Simulated, record: Record) -> None:
        super().__init__()
        self._simulated, self._record = simulated, record

    def __missing__(self, body: str) -> Led:
        self[body] = self._found(self._simulated, body, self._record)
        return self[body]

    def _found(self, simulated: Simulated, body: str, record: Record) -> Led:
        speed, shown = simulated.motion[f"v_{body}"], simulated.further(body, record)
        away = simulated.away(body, record)
        if shown is None:
            return Led(speed, away)
        further = zero_phase(shown.motion, LED_ORDER, simulated.led_hz, record.fs)
        # a body that sticks has no direction: noise must not give it one
        moving = np.abs(speed) > AT_REST * np.max(np.abs(speed))
        change = further if shown.order else differentiate(further, record.dt)
        return Led(speed + np.where(moving, change, 0.0), away)


def _closed(plant: Plant, record: Record, choice: FilterChoice, loop: Loop) -> Motion:
    """Return the motion of the closed loop along the record's reference."""
    controller = loop.controller
    if not isinstance(controller, PositionVelocityController):
        remedy = "give Loop(PositionVelocityController(...))"
        raise DataError.at("loop", "has the controller of an arm", remedy)
    start = initial_state(plant, record, choice)
    excitation = replace(excitation_from_record(record, 1), forces=measured_forces(plant, record)[1])
    return move(plant, controller, loop.drive, excitation, start, 1)


def _as_read(record: Record, true: Mapping[str, FloatArray]) -> Record:
    return record.edited({key: true[key] for key in record.signals if key in true})
