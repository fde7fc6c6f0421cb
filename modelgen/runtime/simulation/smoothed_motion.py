"""How much further than in a simulation the bodies of a chain move in a record, from all of its sensors.

What differs between the two is linear: pushes that the simulation lacks, as its friction turns at other
instants, move the chain, and every sensor reads some of that with its noise. The motion of all bodies that is
most likely then is that of a Wiener smoother (Kailath, Sayed and Hassibi 2000), worked out frequency by
frequency: a body without a sensor is known as well as links carry its motion to the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.simulation.plant import Plant, sensor_levers
from modelgen.runtime.simulation.thresholds import (
    ELSEWHERE,
    LEAST_NOISE,
    NUMBERS_AT_ONCE,
    PUSHES_TRIED,
    SCREENED_ORDER,
    SEEN_FREQUENCIES,
    UNSEEN_PUSH,
)


@dataclass(frozen=True, eq=False)
class Beyond:
    """What a record shows beyond a simulation of it.

    Attributes
    ----------
    read : mapping of str to array, shape (n,)
        By how much more each sensor reads, SI.
    noise : mapping of str to float
        Density of each sensor's white noise, unit^2/Hz.
    push : array, shape (n,)
        Force (N or N m) that drives the driven body in the record beyond that of the simulation.
    dt : float
        Sampling period in s.
    """

    read: Mapping[str, FloatArray]
    noise: Mapping[str, float]
    push: FloatArray
    dt: float


def smoothed_speeds(plant: Plant, difference: Beyond, least_hz: float, most_hz: float) -> FloatArray | None:
    """Return by how much faster than in the simulation every body moves, but for its mean.

    Parameters
    ----------
    plant : Plant
        As simulated; Coulomb friction is among the pushes that are not known.
    difference : Beyond
    least_hz : float
        Below this frequency sensors of lowest order alone count, as drift of accelerometers is no motion.
    most_hz : float
        The motion is worked out up to here.

    Returns
    -------
    array, shape (bodies, n), optional
        In m/s or rad/s; None where the chain is stiff beyond all numbers.
    """
    n = quick_length(len(difference.push))
    more = n - len(difference.push)
    orders = {sensor.key: sensor.order for sensor in plant.model.sensors}
    signals = [mirrored(one, orders[key], more) for key, one in difference.read.items()]
    spectra = np.fft.rfft([*signals, mirrored(difference.push, 2, more)])
    places = np.flatnonzero(np.fft.rfftfreq(2 * n, difference.dt) <= most_hz)[1:]
    chain = _Chain.of(plant, difference, least_hz)
    if chain is None or not places.size:
        return None
    omega = np.asarray(2.0 * pi * places / (2.0 * n * difference.dt), dtype=float)
    # of a spectrum |X|^2 this share is a density
    share = difference.dt / n
    some = np.unique(np.linspace(0, len(places) - 1, SEEN_FREQUENCIES).astype(int))
    size = chain.push_size(omega[some], spectra[:, places[some]], share)
    found = np.zeros((len(plant.bodies), spectra.shape[1]), dtype=complex)
    step = max(NUMBERS_AT_ONCE // len(plant.bodies) ** 2, 1)
    for first in range(0, len(places), step):
        part = slice(first, first + step)
        found[:, places[part]] = chain.speeds(omega[part], spectra[:, places[part]], size)
    speeds = np.fft.irfft(found, 2 * n)[:, : len(difference.push)]
    return np.asarray(speeds - speeds.mean(axis=1, keepdims=True))


def mirrored(x: FloatArray, order: int, more: int = 0) -> FloatArray:
    """Return a signal and behind it the same backwards in time and negated, where it is periodic.

    Positions (order 0) are taken from the line between their ends; velocities (1) then come back with their
    sign, accelerations and forces (2) without: what one sensor reads stays the derivative of what another one
    does, and only damping is of the wrong sign there. `x` has the shape (n,) and goes back so for `more`
    samples first, the result (2 (n + more),), of its unit.
    """
    back = x[len(x) - more :][::-1]
    if order == 1:
        longer = np.concatenate([x, back])
        return np.concatenate([longer, longer[::-1]])
    x = x if order == 0 else x - np.mean(x)
    longer = np.concatenate([x, (2.0 * x[-1] if order == 0 else 0.0) - back])
    bent = longer - (np.linspace(longer[0], longer[-1], len(longer)) if order == 0 else 0.0)
    return np.concatenate([bent, -bent[::-1]])


@dataclass(frozen=True, eq=False)
class _Chain:
    """A chain with its sensors in units of their noise; b bodies, s sensors, 2 b states.

    A push of an unknown density moves every body, (b,) shares of it say which one more.
    """

    A: FloatArray
    inertia: FloatArray
    driven: int
    shares: FloatArray
    levers: FloatArray
    order: FloatArray
    absolute: FloatArray
    noise: FloatArray
    least: float

    @staticmethod
    def of(plant: Plant, difference: Beyond, least_hz: float) -> _Chain | None:
        A = np.asarray(plant.space(tuple(1 for _ in plant.sticking)).A)
        if not np.all(np.isfinite(A)):
            return None
        rows = {sensor.key: row for row, sensor in enumerate(plant.model.sensors)}
        sensors = [plant.model.sensors[rows[key]] for key in difference.read]
        friction = np.zeros(len(plant.bodies))
        for place in plant.sticking:
            one = plant.model.friction[place]
            friction[plant.bodies.index(one.body)] = plant.value(one.coulomb_plus)
        strongest = float(friction.max()) or 1.0
        power = [2.0 * difference.dt * float(np.mean(one**2)) for one in difference.read.values()]
        noise = np.maximum(list(difference.noise.values()), LEAST_NOISE * np.array(power))
        return _Chain(
            A,
            plant.inertia,
            plant.driven,
            np.maximum((friction / strongest) ** 2, ELSEWHERE),
            sensor_levers(plant.model)[[rows[key] for key in difference.read]],
            np.array([float(sensor.order) for sensor in sensors]),
            np.array([sensor.body is not None for sensor in sensors]),
            np.maximum(noise, float(np.finfo(float).tiny)),
            2.0 * pi * least_hz,
        )

    def push_size(self, omega: FloatArray, spectra: ComplexArray, share: float) -> float:
        """Return the density of the pushes that makes what the sensors read most likely."""
        _, read, seen = self._parts(omega, spectra)
        power, turned = np.linalg.eigh((seen * self.shares) @ _adjoint(seen))
        level = share * np.abs(_adjoint(turned) @ read[:, :, None])[:, :, 0] ** 2
        power = np.maximum(power, 0.0)
        # noise has a power of one: from pushes far below it at all frequencies to those that are all of it
        strongest, typical = float(power.max()) or 1.0, float(np.median(power.max(axis=1))) or 1.0
        sizes = np.geomspace(UNSEEN_PUSH / strongest, max(float(level.max()), 1.0) / typical, PUSHES_TRIED)
        fits = [np.sum(np.log1p(size * power) + level / (1.0 + size * power)) for size in sizes]
        return float(sizes[int(np.argmin(fits))])

    def speeds(self, omega: FloatArray, spectra: ComplexArray, size: float) -> ComplexArray:
        """Return the speeds of all bodies at some frequencies, shape (bodies, frequencies)."""
        compliance, read, seen = self._parts(omega, spectra)
        pushed = size * self.shares * _adjoint(seen).swapaxes(1, 2)
        of_reading = seen @ pushed.swapaxes(1, 2)
        # beside a strong push the noise would be rounding
        strongest = np.trace(of_reading, axis1=1, axis2=2).real
        of_reading += (1.0 + LEAST_NOISE * strongest)[:, None, None] * np.eye(len(self.noise))
        push = np.einsum("fsb,fs->fb", pushed, np.linalg.solve(of_reading, read[:, :, None])[:, :, 0])
        push[:, self.driven] += spectra[-1]
        return np.asarray(1j * omega * (compliance @ push[:, :, None])[:, :, 0].T)

    def _parts(
        self, omega: FloatArray, spectra: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return how forces move bodies (f, b, b), what is read for no known reason (f, s), and of forces."""
        b, s = len(self.inertia), 1j * omega[:, None, None]
        moved = s**2 * np.eye(b) - s * self.A[b:, b:] - self.A[b:, :b]
        compliance = np.asarray(np.linalg.inv(moved) / self.inertia, dtype=complex)
        # of other sensors than those of lowest order, noise rises without bound towards 0 Hz
        lowest = self.order[self.absolute].min()
        drifts = self.absolute & (self.order > lowest)
        ratio = np.where(drifts, (self.least / omega[:, None]) ** SCREENED_ORDER, 0.0)
        weight = 1.0 / np.sqrt(self.noise * (1.0 + ratio**2))
        slope = (1j * omega[:, None]) ** self.order
        seen = np.asarray((weight * slope)[:, :, None] * (self.levers @ compliance), dtype=complex)
        read = weight * spectra[:-1].T - seen[:, :, self.driven] * spectra[-1][:, None]
        return compliance, np.asarray(read, dtype=complex), seen


def _adjoint(matrices: ComplexArray) -> ComplexArray:
    return np.asarray(np.conj(matrices).swapaxes(1, 2))
