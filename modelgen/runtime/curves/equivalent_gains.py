"""What Coulomb friction and cubic springs are to a frequency response at the amplitude of a record.

Harmonic balance: at each frequency a nonlinear force is replaced by the gain that reproduces its part at that
frequency, Re sum(V* F) / sum |V|^2 over the lines around it, with the motion that the record has. Of a sine
these are the describing functions (4 F_s / pi v, or 3/4 k_3 d^2; with a constant velocity on top those of two
inputs), of noise those of statistical linearisation (Gelb and Vander Velde 1968). Motion that no sensor shows
follows from what is measured by the chain with the gains of the round before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.frozen_values import FrozenValues
from modelgen.runtime.curves.thresholds import (
    AVERAGED_SHARE,
    FILTER_ORDER,
    GAIN_POINTS,
    LARGEST_GAIN,
    LEAST_POWER,
    RESTING,
    ROUNDS,
    SETTLED,
)
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import vibration
from modelgen.runtime.simulation.plant import Plant, felt_accelerations
from modelgen.runtime.stick_slip.linear_mode import CubicForce


@dataclass(frozen=True, eq=False)
class EquivalentGains(FrozenValues):
    """Gains per unit of the parameter, at `frequency_hz`, shape (points,); held beyond its ends.

    Attributes
    ----------
    friction : array, shape (columns of E, points)
        In s/rad or s/m: a Coulomb friction of 1 N m acts like this viscous friction.
    springs : array, shape (cubic springs, points)
        In rad^2 or m^2: a cubic stiffness of 1 acts like this stiffness.
    forward : array, shape (columns of E,)
        Share of the time for which the body moves forward.
    """

    frequency_hz: FloatArray
    friction: FloatArray
    springs: FloatArray
    forward: FloatArray


@dataclass(frozen=True, eq=False)
class LinearChain:
    """A(f), shape (frequencies, states, states), B, C(f), D at the amplitude of a record, in SI."""

    A: ComplexArray
    B: FloatArray
    C: ComplexArray
    D: FloatArray

    def states(self, frequency_hz: FloatArray, column: int) -> ComplexArray:
        """Return the states over a force, a column of B, shape (frequencies, states)."""
        s = 2j * np.pi * frequency_hz
        found = np.linalg.solve(s[:, None, None] * np.eye(len(self.B)) - self.A, self.B[None, :, [column]])
        return np.asarray(found[:, :, 0])

    def response(self, frequency_hz: FloatArray, row: int, column: int) -> ComplexArray:
        """Return the reading of a sensor over a force, shape (frequencies,)."""
        read = np.einsum("fi,fi->f", self.C[:, row], self.states(frequency_hz, column))
        return np.asarray(read + self.D[row, column])


def linear_chain(plant: Plant, gains: EquivalentGains | None, frequency_hz: FloatArray) -> LinearChain:
    """Return the chain with the gains in place of what is not linear; without gains that has no part.

    Frequencies in Hz have shape (n,), the matrices (n, rows, columns), in SI.
    """
    model, count = plant.model, len(frequency_hz)
    forward = {entry.body: 1 for entry in model.friction if entry.asymmetric}
    space = model.state_space(plant.parameters, forward or None)
    A = np.array(space.A, dtype=float)
    for j, entry in enumerate(model.friction):
        if entry.asymmetric:
            share = 0.5 if gains is None else float(gains.forward[j])
            back = model.state_space(plant.parameters, {**forward, entry.body: -1})
            A += (1.0 - share) * (back.A - space.A)
    at_f = np.repeat(A[None], count, axis=0)
    C = np.repeat(np.asarray(space.C, dtype=float)[None], count, axis=0)
    if gains is not None:
        for j, entry in enumerate(model.friction):
            level = 0.5 * (plant.value(entry.coulomb_plus) + plant.value(entry.coulomb_minus))
            gain = level * np.interp(frequency_hz, gains.frequency_hz, gains.friction[j])
            at_f[:, :, entry.state] += gain[:, None] * space.E[:, j]
            C[:, :, entry.state] += gain[:, None] * space.F[:, j]
        for j, spring in enumerate(plant.cubic_forces()):
            gain = np.interp(frequency_hz, gains.frequency_hz, gains.springs[j])
            at_f += gain[:, None, None] * np.outer(spring.push, spring.deflection)
            felt = felt_accelerations(model) @ spring.push[len(plant.bodies) :]
            C += gain[:, None, None] * np.outer(felt, spring.deflection)
    return LinearChain(at_f, np.asarray(space.B), C, np.asarray(space.D))


def is_nonlinear(plant: Plant) -> bool:
    """Return whether Coulomb friction or a cubic spring bends the chain's frequency response."""
    return has_coulomb(plant) or any(plant.value(spring.parameter) for spring in plant.model.cubic_springs)


def has_coulomb(plant: Plant) -> bool:
    """Return whether a body has Coulomb friction."""
    names = [name for f in plant.model.friction for name in (f.coulomb_plus, f.coulomb_minus)]
    return any(plant.value(name) for name in names)


def equivalent_gains(plant: Plant, record: Record, cutoff_hz: float) -> EquivalentGains:
    """Return the gains at the amplitude of a record, whose signals are looked at up to `cutoff_hz`."""
    cutoff_hz = min(cutoff_hz, 0.4 * record.fs)
    length = min(part.stop - part.start for part in record.facts.parts)
    lowest = min(4.0 * record.fs / length, 0.5 * cutoff_hz)
    at_hz = np.geomspace(lowest, cutoff_hz, GAIN_POINTS)
    shape = (len(plant.model.friction), GAIN_POINTS), (len(plant.model.cubic_springs), GAIN_POINTS)
    found = EquivalentGains(at_hz, np.zeros(shape[0]), np.zeros(shape[1]), np.full(shape[0][0], 0.5))
    motions = [RecordMotion(plant, part, cutoff_hz) for part in _parts(record)]
    for _ in range(ROUNDS):
        after = _gains(plant, motions, found)
        moved = max(
            _change(after.friction, found.friction),
            _change(after.springs, found.springs),
        )
        found = after
        if moved < SETTLED:
            break
    return found


def _parts(record: Record) -> list[Record]:
    if len(record.facts.parts) == 1:
        return [record]
    return [record.part(part.start, part.stop, record.name) for part in record.facts.parts]


def _change(after: FloatArray, before: FloatArray) -> float:
    return float(np.abs(after - before).max(initial=0.0) / (np.abs(after).max(initial=0.0) or 1.0))


class RecordMotion:
    """Velocities of bodies and deflections of springs during a record, in SI, measured or worked out."""

    def __init__(self, plant: Plant, record: Record, cutoff_hz: float) -> None:
        self._plant, self._n = plant, record.n
        self.frequency_hz = np.asarray(np.fft.rfftfreq(record.n, record.dt))
        # beyond the cut-off nothing is known of the motion, and at 0 Hz nothing of what turns freely
        self._lines = np.flatnonzero((self.frequency_hz > 0.0) & (self.frequency_hz <= cutoff_hz))
        self.measured = _measured_velocities(plant.model, record, cutoff_hz)
        self.noise = {key: _velocity_noise(plant.model, record, key, cutoff_hz) for key in self.measured}
        self._deflections = [
            _measured_deflection(plant, spring, record, cutoff_hz) for spring in plant.cubic_forces()
        ]
        driven = plant.bodies[plant.driven]
        self._seen = driven if driven in self.measured else next(iter(self.measured), None)
        self._source = record.signals[plant.force] if self._seen is None else self.measured[self._seen]

    def of(self, gains: EquivalentGains) -> tuple[dict[str, FloatArray], list[FloatArray]]:
        """Return the velocity of each body, and the deflection of each cubic spring, shape (n,) each."""
        plant, n, velocities = self._plant, len(self._plant.bodies), dict(self.measured)
        wanted = [e.body for e in plant.model.friction if e.body not in velocities]
        if not wanted and all(d is not None for d in self._deflections):
            return velocities, [d for d in self._deflections if d is not None]
        f = self.frequency_hz[self._lines]
        states = linear_chain(plant, gains, f).states(f, plant.actuator)
        over = 1.0 if self._seen is None else states[:, n + plant.bodies.index(self._seen)]
        lines = np.fft.rfft(self._source)[self._lines] / np.where(over == 0.0, np.inf, over)
        rigid = vibration(plant).lowest
        for body in wanted:
            place = plant.bodies.index(body)
            velocities[body] = self._back(lines * states[:, n + place])
            if self._seen is not None:
                turned = rigid[plant.bodies.index(self._seen)]
                velocities[body] += rigid[place] / (turned or np.inf) * self._source.mean()
        deflections = [
            self._back(lines * (states @ spring.deflection)) if seen is None else seen
            for spring, seen in zip(plant.cubic_forces(), self._deflections, strict=True)
        ]
        return velocities, deflections

    def _back(self, lines: ComplexArray) -> FloatArray:
        every = np.zeros(len(self.frequency_hz), complex)
        every[self._lines] = lines
        return np.asarray(np.fft.irfft(every, self._n))


def _measured_velocities(model: Model, record: Record, cutoff_hz: float) -> dict[str, FloatArray]:
    found: dict[str, FloatArray] = {}
    for sensor in sorted(model.sensors, key=lambda entry: -entry.order):
        if sensor.body is None or sensor.order == 2 or sensor.key not in record.signals:
            continue
        smooth = zero_phase(record.signals[sensor.key], FILTER_ORDER, cutoff_hz, record.fs)
        found[sensor.body] = differentiate(smooth, record.dt) if sensor.order == 0 else smooth
    return found


def _velocity_noise(model: Model, record: Record, body: str, cutoff_hz: float) -> float:
    """Return the standard deviation of a measured velocity that noise of its sensor makes."""
    order, key = min((s.order, s.key) for s in model.sensors if s.body == body and s.key in record.signals)
    density = record.facts.spectrum(key).noise
    if order == 1:
        return float(np.sqrt(density * cutoff_hz))
    return float(2.0 * np.pi * np.sqrt(density * cutoff_hz**3 / 3.0))


def _measured_deflection(
    plant: Plant, spring: CubicForce, record: Record, cutoff_hz: float
) -> FloatArray | None:
    """Return a spring's deflection, shape (n,), where position and deflection sensors show it."""
    C = plant.space((1,) * len(plant.sticking)).C
    rows = [i for i, s in enumerate(plant.model.sensors) if s.order == 0 and s.key in record.signals]
    shares, *_ = np.linalg.lstsq(C[rows].T, spring.deflection, rcond=None)
    if np.abs(C[rows].T @ shares - spring.deflection).max(initial=0.0) > 1e-9 or not rows:
        return None
    readings = (
        record.signals[plant.model.sensors[i].key] * share for i, share in zip(rows, shares, strict=True)
    )
    return zero_phase(np.sum(list(readings), axis=0), FILTER_ORDER, cutoff_hz, record.fs)


def _gains(plant: Plant, motions: list[RecordMotion], before: EquivalentGains) -> EquivalentGains:
    """Return the gains of one more round, those of several stretches averaged by their power."""
    at_hz = before.frequency_hz
    friction = np.zeros((*before.friction.shape, 2))
    springs = np.zeros((*before.springs.shape, 2))
    forward = np.zeros(len(plant.model.friction))
    for motion in motions:
        velocities, deflections = motion.of(before)
        for j, entry in enumerate(plant.model.friction):
            v = velocities[entry.body]
            # of a body at rest only the noise has a sign
            direction = np.sign(v) * (np.abs(v) > RESTING * motion.noise.get(entry.body, 0.0))
            friction[j] += _balance(v, direction, motion.frequency_hz, at_hz)
            forward[j] += float(np.mean(v > 0.0)) / len(motions)
        for j, d in enumerate(deflections):
            springs[j] += _balance(d, d**3, motion.frequency_hz, at_hz)
    return replace(before, friction=_ratio(friction), springs=_ratio(springs), forward=forward)


def _ratio(sums: FloatArray) -> FloatArray:
    over = np.where(sums[..., 1] > 0.0, sums[..., 1], np.inf)
    return np.asarray(np.clip(sums[..., 0] / over, 0.0, LARGEST_GAIN))


def _balance(x: FloatArray, y: FloatArray, f: FloatArray, at_hz: FloatArray) -> FloatArray:
    """Return the power that y shares with x, and that of x, around each frequency, shape (points, 2).

    Where x has next to nothing, both are those of the whole band.
    """
    X, Y = np.fft.rfft(x - x.mean()), np.fft.rfft(y - y.mean())
    lines = np.column_stack((np.real(np.conj(X) * Y), np.abs(X) ** 2))
    total = lines[1:].sum(axis=0)
    found = np.empty((len(at_hz), 2))
    for k, middle in enumerate(at_hz):
        near = np.exp(-0.5 * ((f - middle) / (AVERAGED_SHARE * middle)) ** 2)
        near[0] = 0.0
        found[k] = near @ lines + LEAST_POWER * total * near.sum() / len(f)
    return found
