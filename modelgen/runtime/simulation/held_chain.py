"""HeldChain: a chain held in place by a weak feedback, and how it answers pushes at all frequencies at once.

It is linear between reversals. Rows do not feel what holds it, as the force that it takes is a reading.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.simulation.closed_loop import vibration
from modelgen.runtime.simulation.plant import Plant, felt_accelerations
from modelgen.runtime.simulation.thresholds import DAMPING_RATIO, HOLDING_SHARE


@dataclass(frozen=True, eq=False)
class HeldChain:
    """A held chain in coordinates in which its states move apart from each other.

    Attributes
    ----------
    plant : Plant
    omega : array, shape (frequencies,)
        Circular frequencies in rad/s.
    rates : array, shape (states,)
        Its poles, in 1/s.
    entering : array, shape (states, bodies)
        What each coordinate takes of accelerations of the bodies.
    readings : mapping of str to pair of array (states,) and bool
        What a channel reads of each coordinate, and whether it is the slope of that.
    speeds : array, shape (bodies, states)
        What each coordinate adds to the speeds of the bodies.
    """

    plant: Plant
    omega: FloatArray
    rates: ComplexArray
    entering: ComplexArray
    readings: Mapping[str, tuple[ComplexArray, bool]]
    speeds: ComplexArray
    _last: dict[tuple[float, ...], dict[str, ComplexArray]] = field(default_factory=dict, repr=False)

    @cached_property
    def _answers(self) -> ComplexArray:
        """What each pair of poles, then each real pole, answers at all frequencies, (pairs, frequencies)."""
        swings, single = self.rates[self.rates.imag > 0.0], self.rates[self.rates.imag == 0.0]
        s = 1j * self.omega
        whole = s * (s - 2.0 * swings.real[:, None]) + np.abs(swings[:, None]) ** 2
        found = np.concatenate([whole, s - single[:, None]])
        # a division of complex numbers takes several times as long; what nothing holds, a body on a spring of
        # no stiffness, has no answer to a constant push
        size = found.real**2
        size += found.imag**2
        # in place: zero stays zero
        np.divide(np.conj(found, out=found), size, out=found, where=size > 0.0)
        return found

    def _excited(self, push: FloatArray) -> ComplexArray:
        return np.asarray(self.entering @ (push / self.plant.inertia))

    def read(self, channels: Collection[str], push: FloatArray) -> dict[str, ComplexArray]:
        """Return what channels read per unit of a force `push` (bodies,) at all frequencies."""
        at = tuple(push.tolist())
        if at not in self._last:
            self._last.clear()  # they are as long as the record: those of one push are kept
            self._last[at] = {}
        known = self._last[at]
        missing = [channel for channel in channels if channel not in known]
        if missing:
            found = self._answered(np.array([self.readings[channel][0] for channel in missing]), push)
            for channel, line in zip(missing, found, strict=True):
                known[channel] = 1j * self.omega * line if self.readings[channel][1] else line
        return {channel: known[channel] for channel in channels}

    def _answered(self, shares: ComplexArray, push: FloatArray) -> ComplexArray:
        """Return sums of the coordinates with these shares (sums, states), shape (sums, frequencies)."""
        swings, single = self.rates.imag > 0.0, self.rates.imag == 0.0
        weight = shares * self._excited(push)
        # w / (s - p) and its conjugate together: (2 Re(w) s - 2 Re(w conj(p))) / (s^2 - 2 Re(p) s + |p|^2)
        pairs, ones = weight[:, swings], weight[:, single]
        level = np.hstack([-2.0 * (pairs * self.rates[swings].conj()).real, ones.real])
        rise = np.hstack([2.0 * pairs.real, np.zeros(ones.shape)])
        # all at once, as the answers are long; a real matrix with real and imaginary parts side by side
        found = (np.vstack([level, rise]) @ self._answers.view(float)).view(complex)
        return np.asarray(found[: len(shares)] + 1j * self.omega * found[len(shares) :])

    def driven(self, forces: ComplexArray) -> dict[str, ComplexArray]:
        """Return what the sensors read while these forces drive the bodies, (bodies, frequencies); 0 at 0 Hz.

        All at once: a chain has as many forces as bodies.
        """
        swing = 1j * self.omega - self.rates[:, None]
        swing[:, self.omega == 0.0] = np.inf
        coordinates = (self.entering @ (forces / self.plant.inertia[:, None])) / swing
        keys = [sensor.key for sensor in self.plant.model.sensors]
        found = np.array([self.readings[key][0] for key in keys]) @ coordinates
        return {
            key: 1j * self.omega * line if self.readings[key][1] else line
            for key, line in zip(keys, found, strict=True)
        }

    def acceleration(self, push: FloatArray) -> ComplexArray:
        """Return the acceleration of what a unit of force is on, along it, shape (frequencies,)."""
        return np.asarray(1j * self.omega * self._answered((push @ self.speeds)[None], push)[0])

    def readings_at(self, places: slice, push: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return what all channels read at some frequencies, and the same with all coordinates of one sign.

        Both have the shape (chosen, channels); rounding is a share of the latter.
        """
        omega = self.omega[places, None]
        coordinates = self._excited(push) / (1j * omega - self.rates)
        shares = np.array([share for share, _ in self.readings.values()]).T
        slope = np.array([slope for _, slope in self.readings.values()])
        read, most = coordinates @ shares, np.abs(coordinates) @ np.abs(shares)
        return np.where(slope, 1j * omega * read, read), np.where(slope, omega * most, most)


def held_chain(plant: Plant, omega: FloatArray, rate: float | None = None) -> HeldChain:
    """Return a chain held at its driven body; circular frequencies in rad/s, shape (frequencies,).

    `rate`, in rad/s, is how fast it is held, by default a share of its lowest elastic frequency.
    """
    n = len(plant.bodies)
    space = plant.space(tuple(1 for _ in plant.sticking))
    modes = vibration(plant)
    lowest = float(modes.elastic_hz[0] if modes.elastic_hz.size else 1.0 / omega[1])
    rate, damping = (HOLDING_SHARE * 2.0 * np.pi * lowest, 1.0) if rate is None else (rate, DAMPING_RATIO)
    gains = np.zeros(2 * n)
    gains[plant.driven] = modes.drive_inertia * rate**2
    gains[n + plant.driven] = 2.0 * damping * modes.drive_inertia * rate
    held = space.A - np.outer(space.B[:, plant.actuator], gains)
    rates, vectors = np.linalg.eig(held)
    entering = np.linalg.solve(vectors, np.vstack([np.zeros((n, n)), np.eye(n)]))
    felt = felt_accelerations(plant.model)
    readings = {
        # accelerations are what velocities change by
        sensor.key: (felt[place] @ vectors[n:], True)
        if sensor.order == 2
        else (space.C[place] @ vectors, False)
        for place, sensor in enumerate(plant.model.sensors)
    }
    readings[plant.force] = (-gains @ vectors, False)
    return HeldChain(plant, omega, rates, entering, readings, vectors[n:])
