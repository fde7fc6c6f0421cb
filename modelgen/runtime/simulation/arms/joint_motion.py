"""JointMotion: positions, speeds and accelerations of all joints at equal steps of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray


@dataclass(frozen=True, eq=False)
class JointMotion:
    """q, q', q'' in rad or m (and s), shape (joints, N) each, at k / rate_hz."""

    q: FloatArray
    v: FloatArray
    a: FloatArray
    rate_hz: float

    @property
    def n(self) -> int:
        """Samples."""
        return int(self.q.shape[1])

    def part(self, start: int, stop: int) -> JointMotion:
        """Return the samples from start to stop."""
        q, v, a = (one[:, start:stop] for one in (self.q, self.v, self.a))
        return JointMotion(q, v, a, self.rate_hz)

    def finer(self, factor: int) -> JointMotion:
        """Return so many times as many steps: polynomials of fifth degree between the nodes."""
        if factor == 1:
            return self
        h, count = 1.0 / self.rate_hz, (self.n - 1) * factor + 1
        left = np.minimum(np.arange(count) // factor, self.n - 2)
        s = np.arange(count) / factor - left
        q0, v0, a0 = self.q[:, left], self.v[:, left] * h, self.a[:, left] * h**2
        q1, v1, a1 = self.q[:, left + 1], self.v[:, left + 1] * h, self.a[:, left + 1] * h**2
        # what the end lacks of a parabola, in s^3, s^4, s^5
        dq, dv, da = q1 - q0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
        c3, c4, c5 = (
            10.0 * dq - 4.0 * dv + 0.5 * da,
            -15.0 * dq + 7.0 * dv - da,
            6.0 * dq - 3.0 * dv + 0.5 * da,
        )
        q = q0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
        v = (v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h
        a = (a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / h**2
        return JointMotion(q, v, a, self.rate_hz * factor)


def motion_of(q: FloatArray, rate_hz: float) -> JointMotion:
    """Return the motion through positions, shape (joints, N), in rad or m: cubic splines between them."""
    from scipy.interpolate import CubicSpline

    times = np.arange(q.shape[1]) / rate_hz
    spline = CubicSpline(times, q, axis=1)
    return JointMotion(q, spline(times, 1), spline(times, 2), rate_hz)
