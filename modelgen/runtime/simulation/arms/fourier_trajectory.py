"""Motions of joints as finite Fourier series that begin at rest, and bounds that hold between samples.

A trigonometric polynomial of degree n that stays within r at M equidistant points of its period, M > 2 n,
stays within r / cos(pi n / M) everywhere (Ehlich and Zeller 1964): so samples prove a limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi

import numpy as np

from modelgen.array_types import FloatArray

#: Samples a period for every harmonic: the bound is then 0.12 % above the largest of them.
DENSITY = 64


@dataclass(frozen=True)
class Bounds:
    """What coordinates, speeds, accelerations of joints never exceed (rad or m, per s, s^2), each (J,)."""

    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True)
class FourierTrajectory:
    """q_j(t) = offset_j + sum over k of sines_jk sin(k w t) + cosines_jk cos(k w t), with w = 2 pi / period.

    Attributes
    ----------
    period_s
        Its period in s.
    offsets
        Shape (joints,), rad or m.
    sines, cosines
        Shape (joints, harmonics), rad or m.
    """

    period_s: float
    offsets: FloatArray
    sines: FloatArray
    cosines: FloatArray

    @property
    def harmonics(self) -> int:
        """The degree of the series."""
        return int(self.sines.shape[1])

    def at(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return coordinates, speeds and accelerations at times [s], each of shape (joints, times)."""
        rates = 2.0 * pi / self.period_s * np.arange(1, self.harmonics + 1)
        angles = rates[:, None] * times_s
        sine, cosine = np.sin(angles), np.cos(angles)
        q = self.offsets[:, None] + self.sines @ sine + self.cosines @ cosine
        speed = (self.sines * rates) @ cosine - (self.cosines * rates) @ sine
        acceleration = -(self.sines * rates**2) @ sine - (self.cosines * rates**2) @ cosine
        return q, speed, acceleration

    def grid(self, a_harmonic: int = DENSITY) -> FloatArray:
        """Return equidistant times in s of one period without its end, so many a harmonic, shape (n,)."""
        count = a_harmonic * self.harmonics
        return np.asarray(self.period_s / count * np.arange(count), dtype=float)

    def bounds(self) -> Bounds:
        """Return what the trajectory never exceeds, between samples too."""
        q, speed, acceleration = self.at(self.grid())
        wider = 1.0 / cos(pi / DENSITY)
        middle = 0.5 * (q.max(axis=1) + q.min(axis=1))
        half = wider * 0.5 * (q.max(axis=1) - q.min(axis=1))
        largest = (wider * np.abs(array).max(axis=1) for array in (speed, acceleration))
        return Bounds(middle - half, middle + half, *largest)


def at_rest(
    sines: FloatArray, cosines: FloatArray, used: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the nearest coefficients with which speed and acceleration are zero at the beginning and end.

    All have shape (joints, harmonics), coefficients in any unit; `used`, ones and zeros, keeps harmonics at
    zero.
    """
    orders = np.arange(1.0, sines.shape[1] + 1.0) * (np.ones_like(sines) if used is None else used)
    squares = orders**2
    found = []
    for given, weights in ((sines, orders), (cosines, squares)):
        share = np.sum(given * weights, axis=1) / np.sum(weights * weights, axis=1)
        found.append(given - share[:, None] * weights)
    return found[0], found[1]
