"""A chain driven by measured forces, held near its record by a weak feedback; stretch by stretch.

What a stretch begins with is kept, so that each can be simulated again: of a record that is read in stretches
nothing else need stay in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from math import pi
from threading import Lock
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.derivatives import EIGHTH_ORDER, differentiate
from modelgen.runtime.filters.zero_phase import support_samples, zero_phase
from modelgen.runtime.iv.thresholds import (
    FEEDBACK_SHARE,
    FOLLOWED_SHARE,
    HELD_REACHES,
    HELD_STRETCH,
    HIGHEST_LED,
    KEPT_STRETCHES,
    SMOOTHING,
    SMOOTHING_ORDER,
    START_TOLERANCE,
)
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController, vibration
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.motion import ContinuousLoop, Motion
from modelgen.runtime.simulation.plant import Plant, refuse_lacking_forces
from modelgen.runtime.simulation.thresholds import DAMPING_RATIO
from modelgen.runtime.stick_slip.linear_mode import Mode

# takes a motion to signals by key, shape (n,) each
Seen = Callable[[Plant, Motion], Mapping[str, FloatArray]]


class _Start(NamedTuple):
    """What a stretch begins with: state in SI, modes (None at the beginning), sums of what is followed."""

    state: FloatArray
    mode: Mode | None
    sums: tuple[float, float]


class HeldMotion:
    """The motion of a plant along a record, as signals in SI that `seen` makes of it.

    Stretches are the same whether the record is in memory or not, and with them every bit.

    Raises
    ------
    DataError
        When the record lacks a force or a sensor to follow; later when the motion grows without bound.
    """

    def __init__(
        self,
        plant: Plant,
        record: Record,
        choice: FilterChoice,
        seen: Seen,
        near: Mapping[str, FloatArray] | None = None,
    ) -> None:
        """Take what to follow.

        `near` are the true signals of a motion near to the record's, see `SlowPart`: beside these it keeps
        as close to the record as bodies that stick allow.
        """
        refuse_lacking_forces(plant, record)
        self._plant, self._record, self._seen = plant, record, seen
        driven = plant.bodies[plant.driven]
        hz = followed_hz(plant, record, choice) if near is not None else feedback_hz(choice)
        self._slow = SlowPart.of(plant, driven, record, smoothing_hz(record, hz), near)
        self._starts = [_Start(initial_state(plant, record, choice), None, (0.0, 0.0))]
        further = [key for key in plant.further if record.facts.extent(key).peak > 0.0]
        rate, inertia = 2.0 * pi * hz, vibration(plant).drive_inertia
        controller = PositionVelocityController(inertia * rate**2, 2.0 * DAMPING_RATIO * inertia * rate)
        columns = tuple(plant.further[key] for key in further)
        self._further, self._loop = further, _held_loop(plant, controller, columns)
        self._size, self._made, self._lock = self._slow.stretch, dict[int, Mapping[str, FloatArray]](), Lock()
        # the last one has the last sample as well
        self.count = max(-(-(record.n - 1) // self._size), 1)

    def whole(self) -> dict[str, FloatArray]:
        """Return the signals at all samples, shape (n,) each."""
        if self.count == 1:
            return dict(self._simulated(0))
        found: dict[str, FloatArray] = {}
        for number in range(self.count):
            made, first = self._simulated(number), number * self._size
            for key, part in made.items():
                found.setdefault(key, np.empty(self._record.n))[first : first + len(part)] = part
        return found

    def between(self, key: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a signal, shape (stop - start,)."""
        parts, last = [], min(max(stop - 1, start) // self._size, self.count - 1)
        for number in range(min(start // self._size, last), last + 1):
            first = number * self._size
            parts.append(self.stretch(number)[key][max(start - first, 0) : stop - first])
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def stretch(self, number: int) -> Mapping[str, FloatArray]:
        """Return the signals of a stretch, in SI, (n,) each; the last are kept. Several threads may ask."""
        with self._lock:
            for before in range(len(self._starts) - 1, number):
                self._keep(before)
            if number not in self._made:
                self._keep(number)
            return self._made[number]

    def _keep(self, number: int) -> None:
        while len(self._made) >= KEPT_STRETCHES:
            del self._made[next(iter(self._made))]
        self._made[number] = self._simulated(number)

    def _simulated(self, number: int) -> Mapping[str, FloatArray]:
        """Return the signals of a stretch whose start is known; that of the next one is then, too."""
        start, record = self._starts[number], self._record
        first = number * self._size
        # the first sample of the next stretch is its last one, too
        stop = min(first + self._size + 1, record.n)
        position, velocity, sums = self._slow.between(first, stop, start.sums, self._size)
        forces = {key: record.read(key, first, stop) for key in (self._plant.force, *self._further)}
        along = Excitation(position, velocity, forces.pop(self._plant.force), record.fs, record.name, forces)
        try:
            motion = self._loop.moved(along, start.state, mode=start.mode)
        except DataError as error:
            since = f", counted from {first / record.fs:.6g} s" if first else ""
            raise DataError(*(replace(one, what=one.what + since) for one in error.problems)) from None
        if number == len(self._starts) - 1:
            self._starts.append(_Start(motion.states[-1].copy(), tuple(motion.modes[-1].tolist()), sums))
        signals = self._seen(self._plant, motion)
        return signals if stop == record.n else {key: part[:-1] for key, part in signals.items()}


@lru_cache(maxsize=4)  # what it makes of the plant serves all records
def _held_loop(
    plant: Plant, controller: PositionVelocityController, further: tuple[int, ...]
) -> ContinuousLoop:
    return ContinuousLoop(plant, controller, further=further)


class HeldChannels:
    """A record whose channels are simulated in stretches, those that the simulation has."""

    def __init__(self, record: Record, motion: HeldMotion) -> None:
        self._record, self._motion = record, motion
        self._made = frozenset(motion.stretch(0))
        self.keys, self.name, self.fs, self.n = record.keys, record.name, record.fs, record.n

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel, in SI, shape (stop - start,)."""
        if channel in self._made:
            return self._motion.between(channel, start, stop)
        return self._record.read(channel, start, stop)


class SlowPart:
    """Slow part of a body's position and velocity (SI), from what a sensor reads of it or its derivatives.

    A low-pass bends a velocity where friction jumps, and it turns late. With `near`, a motion near to the
    record's as (what the sensor reads of it, its velocity), shape (n,) each, only what differs is low-passed.
    """

    def __init__(
        self,
        record: Record,
        key: str,
        gear: float,
        order: int,
        cutoff_hz: float,
        near: tuple[FloatArray, FloatArray] | None = None,
    ) -> None:
        self._record, self._key, self._gear, self._near = record, key, gear, near
        self._order, self._cutoff_hz = order, cutoff_hz
        reach = support_samples(SMOOTHING_ORDER, cutoff_hz, record.fs, 0, START_TOLERANCE)
        self._margin = reach + len(EIGHTH_ORDER)
        self.stretch = max(HELD_STRETCH, HELD_REACHES * reach)
        # a constant in an accelerometer is its own: the velocity it would integrate to is none
        self._mean = 0.0
        if order == 2:
            n, parts = record.n, range(0, record.n, self.stretch)
            sums = [float(self._smooth(k, min(k + self.stretch, n))[0].sum()) for k in parts]
            self._mean = sum(sums) / n

    @staticmethod
    def of(
        plant: Plant,
        body: str,
        record: Record,
        cutoff_hz: float,
        near: Mapping[str, FloatArray] | None = None,
    ) -> SlowPart:
        """Return that of a body, of the sensor that shows it best; `near` are signals of a motion, (n,)."""
        sensor, gear = nearest_sensor(plant, body, record)
        beside = (near[sensor.key], near[f"v_{body}"]) if near is not None and sensor.order < 2 else None
        return SlowPart(record, sensor.key, gear, sensor.order, cutoff_hz, beside)

    def between(
        self, start: int, stop: int, sums: tuple[float, float], counted: int | None = None
    ) -> tuple[FloatArray, FloatArray, tuple[float, float]]:
        """Return position and velocity at samples start to stop, shape (stop - start,) each.

        `sums` are those of velocities and accelerations before the start, and returned behind the first
        `counted` samples; by default behind all.
        """
        dt, last = self._record.dt, (stop - start if counted is None else min(counted, stop - start)) - 1
        smooth, velocity = self._smooth(start, stop)
        if self._order == 0:
            return smooth, velocity, sums
        added = sums[1]
        if self._order == 2:
            running = added + np.cumsum(smooth - self._mean)
            velocity, added = running * dt, float(running[last])
        travelled = sums[0] + np.cumsum(velocity)
        return travelled * dt, velocity, (float(travelled[last]), added)

    def _smooth(self, start: int, stop: int) -> tuple[FloatArray, FloatArray]:
        """Return low-passed readings, and of positions their derivative; shape (stop - start,) each."""
        record = self._record
        low, high = max(start - self._margin, 0), min(stop + self._margin, record.n)
        raw = np.asarray(record.read(self._key, low, high), dtype=float)
        if self._near is not None:
            raw = raw - self._near[0][low:high]
        smooth = zero_phase(self._gear * raw, SMOOTHING_ORDER, self._cutoff_hz, record.fs)
        velocity = differentiate(smooth, record.dt) if self._order == 0 else smooth
        smooth, velocity = smooth[start - low : stop - low], velocity[start - low : stop - low]
        if self._near is None:
            return smooth, velocity
        reading, speed = (self._gear * self._near[0][start:stop], self._near[1][start:stop])
        return smooth + reading, velocity + (speed if self._order == 0 else reading)


def initial_state(plant: Plant, record: Record, choice: FilterChoice) -> FloatArray:
    """Return all positions, then all velocities, in SI, at the first sample, shape (2 bodies,)."""
    slow_hz = smoothing_hz(record, feedback_hz(choice))
    starts = [SlowPart.of(plant, body, record, slow_hz).between(0, 1, (0.0, 0.0)) for body in plant.bodies]
    return np.array([start[0][0] for start in starts] + [start[1][0] for start in starts])


def feedback_hz(choice: FilterChoice) -> float:
    """Return the bandwidth of the weak feedback in Hz."""
    return FEEDBACK_SHARE * dynamics_hz(choice)


def followed_hz(plant: Plant, record: Record, choice: FilterChoice) -> float:
    """Return the bandwidth in Hz of a feedback that keeps a simulation close to the record.

    A share of the dynamics' where the driven body has a sensor of its own, else weak: what another body does
    is no motion of this one.
    """
    driven = plant.bodies[plant.driven]
    sensor, _ = nearest_sensor(plant, driven, record)
    own = sensor.body == driven and sensor.order < 2
    return FOLLOWED_SHARE * dynamics_hz(choice) if own else feedback_hz(choice)


def dynamics_hz(choice: FilterChoice) -> float:
    """Return the highest frequency of the dynamics in Hz."""
    return choice.dynamics_hz or choice.cutoff_hz


def smoothing_hz(record: Record, bandwidth_hz: float) -> float:
    """Return up to which frequency in Hz a feedback of this bandwidth sees the record."""
    return min(SMOOTHING * bandwidth_hz, HIGHEST_LED * record.fs)


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
