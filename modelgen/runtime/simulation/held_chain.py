"""HeldChain: a chain held in place by a weak feedback, and how it answers pushes at all frequencies at once.

It is linear between reversals. Rows do not feel what holds it, as the force that it takes is a reading.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.simulation.closed_loop import vibration
from modelgen.runtime.simulation.plant import Plant, felt_accelerations
from modelgen.runtime.simulation.thresholds import HOLDING_SHARE


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
    """

    plant: Plant
    omega: FloatArray
    rates: ComplexArray
    entering: ComplexArray
    readings: Mapping[str, tuple[ComplexArray, bool]]
    _last: dict[tuple[float, ...], ComplexArray] = field(default_factory=dict, repr=False)

    def coordinates(self, push: FloatArray) -> ComplexArray:
        """Return the coordinates, (frequencies, states), per unit of a force `push` (bodies,)."""
        at = tuple(push.tolist())
        if at not in self._last:
            self._last.clear()  # they are as long as the record: those of one push are kept
            excited = self.entering @ (push / self.plant.inertia)
            self._last[at] = excited / (1j * self.omega[:, None] - self.rates)
        return self._last[at]

    def reading(self, channel: str, push: FloatArray, places: slice = slice(None)) -> ComplexArray:
        """Return what a channel reads per unit of a force on the bodies, at some frequencies, (chosen,)."""
        shares, slope = self.readings[channel]
        found = self.coordinates(push)[places] @ shares
        return np.asarray(1j * self.omega[places] * found if slope else found)

    def largest(self, channel: str, push: FloatArray, places: slice = slice(None)) -> FloatArray:
        """Return the same with all coordinates of one sign: rounding is a share of that, (chosen,)."""
        shares, slope = self.readings[channel]
        found = np.abs(self.coordinates(push)[places]) @ np.abs(shares)
        return np.asarray(self.omega[places] * found if slope else found)


def held_chain(plant: Plant, omega: FloatArray) -> HeldChain:
    """Return a chain held at its driven body; circular frequencies in rad/s, shape (frequencies,)."""
    n = len(plant.bodies)
    space = plant.space(tuple(1 for _ in plant.sticking))
    modes = vibration(plant)
    lowest = float(modes.elastic_hz[0] if modes.elastic_hz.size else 1.0 / omega[1])
    rate = HOLDING_SHARE * 2.0 * np.pi * lowest
    gains = np.zeros(2 * n)
    gains[plant.driven] = modes.drive_inertia * rate**2
    gains[n + plant.driven] = 2.0 * modes.drive_inertia * rate
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
    return HeldChain(plant, omega, rates, entering, readings)
