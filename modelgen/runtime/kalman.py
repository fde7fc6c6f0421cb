"""Extended Kalman filter on motion and parameters together; a yardstick.

The state is extended by the logarithms of all physical parameters over their start. Noise of the sensors is
read off the records above their dynamics; the measured force carries the process noise. Coulomb friction is
smoothed over the speed that it brakes away within a sample: what an extended Kalman filter can follow. Its
intervals know nothing of that smoothing, nor of the linearisation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.runtime.contract import Model
from modelgen.runtime.data import Record
from modelgen.runtime.filters import zero_phase
from modelgen.runtime.output_error import CUTOFF_SHARE, FILTER_ORDER, Response
from modelgen.runtime.plant import Plant, make_plant
from modelgen.runtime.validate import initial_state

FloatArray = npt.NDArray[np.float64]

TAYLOR_ORDER = 4
# What is known of a parameter before the first sample, in shares of its start; and of the velocities.
PARAMETER_STD = 0.1
VELOCITY_STD = 0.02
STEP = 1e-6
# Noise is what a filter at this share of the sampling frequency leaves over.
NOISE_SHARE = 0.25


def filter_parameters(model: Model, records: Sequence[Record], start: Mapping[str, float]) -> Response:
    """Run the filter over all records in turn, parameters carried on, from a start (SI).

    Raises
    ------
    DataError
        When the filter diverges.
    """
    plant = make_plant(model, start)
    names = model.parameters
    theta, P = np.zeros(len(names)), np.eye(len(names)) * PARAMETER_STD**2
    with np.errstate(all="ignore"):
        for record in records:
            theta, P = _filter(_Motion(plant, record.dt), record, theta, P)
            if not (np.isfinite(theta).all() and np.isfinite(P).all()):
                raise DataError.at("Kalman filter", f"diverges on {record.name}", "use another method")
    values = np.array([plant.parameters[name] for name in names]) * np.exp(theta)
    return Response(names, values, P * np.outer(values, values))


class _Motion:
    """One sample of the extended state s = (x, theta): where it goes, and what is read meanwhile."""

    def __init__(self, plant: Plant, dt: float) -> None:
        self.plant, self.dt = plant, dt
        self._names = plant.model.parameters
        self._start = np.array([plant.parameters[name] for name in self._names])
        self.motions = 2 * len(plant.bodies)

    def __call__(self, s: FloatArray, u: FloatArray, mean: FloatArray) -> FloatArray:
        """Return the next x under the sample's mean force, then the readings at s under the force now."""
        x, theta = s[: self.motions], s[self.motions :]
        values = dict(zip(self._names, (self._start * np.exp(theta)).tolist(), strict=True))
        known = {**self.plant.parameters, **values}
        directions = {f.body: 1 if x[f.state] >= 0.0 else -1 for f in self.plant.model.friction}
        A, B, C, D, E, F = self.plant.model.state_space(known, directions)
        f = np.array([self._friction(entry, x, known, E) for entry in self.plant.model.friction])
        push = B @ mean + E @ f
        # x(dt) = x + dt (1 + A dt/2 + ...) (A x + push)
        term = self.dt * (A @ x + push)
        moved = x + term
        for order in range(2, TAYLOR_ORDER + 1):
            term = self.dt / order * (A @ term)
            moved = moved + term
        return np.concatenate([moved, C @ x + D @ u + F @ f])

    def _friction(self, entry: object, x: FloatArray, known: Mapping[str, float], E: FloatArray) -> float:
        """Return friction and offset of a body, smooth where it would stop within a sample."""
        state = int(getattr(entry, "state"))  # noqa: B009
        column = [f.state for f in self.plant.model.friction].index(state)
        plus, minus, offset = (
            known.get(getattr(entry, name) or "", 0.0) for name in ("coulomb_plus", "coulomb_minus", "offset")
        )
        v = float(x[state])
        size = plus if v >= 0.0 else minus
        width = 2.0 * size * abs(float(E[state, column])) * self.dt
        return float(offset + size * (min(1.0, max(-1.0, v / width)) if width else 0.0))

    def jacobian(
        self, s: FloatArray, u: FloatArray, mean: FloatArray, here: FloatArray, scale: FloatArray
    ) -> FloatArray:
        """Return d (next x, readings) / d s by forward differences."""
        columns = []
        for i in range(s.size):
            moved = s.copy()
            moved[i] += STEP * scale[i]
            columns.append((self(moved, u, mean) - here) / (STEP * scale[i]))
        return np.array(columns).T


def _filter(
    motion: _Motion, record: Record, theta: FloatArray, P_theta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return parameters and their covariance after one record."""
    model, n, c = motion.plant.model, motion.motions, theta.size
    z = np.column_stack([record.signals[sensor.key] for sensor in model.sensors])
    u = np.column_stack([record.signals[actuator.key] for actuator in model.actuators])
    R = np.diag([_noise(column, record.fs) ** 2 for column in z.T])
    q = np.diag([_noise(column, record.fs) ** 2 for column in u.T])
    x = initial_state(motion.plant, record, CUTOFF_SHARE * record.fs)
    speed = max(float(np.ptp(z[:, 0])) * VELOCITY_STD, 1e-9)
    s, P = np.concatenate([x, theta]), np.zeros((n + c, n + c))
    P[n:, n:] = P_theta
    half = n // 2
    P[:half, :half] = np.eye(half) * max(float(np.max(np.diag(R))), 1e-18)
    P[half:n, half:n] = np.eye(half) * speed**2
    scale = np.concatenate([np.full(half, 1e-2), np.full(half, 1.0), np.ones(c)])
    G = np.zeros((n + c, u.shape[1]))
    for k in range(len(z)):
        # the force is taken as linear between samples: half a sample late would bias the inertias
        mean = 0.5 * (u[k] + u[min(k + 1, len(u) - 1)])
        here = motion(s, u[k], mean)
        H = motion.jacobian(s, u[k], mean, here, scale)[n:]
        gain = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        s = s + gain @ (z[k] - here[n:])
        rest = np.eye(n + c) - gain @ H
        P = rest @ P @ rest.T + gain @ R @ gain.T
        here = motion(s, u[k], mean)
        F = np.eye(n + c)
        F[:n] = motion.jacobian(s, u[k], mean, here, scale)[:n]
        for j in range(u.shape[1]):
            push = mean.copy()
            step = STEP * (abs(push[j]) or 1.0)
            push[j] += step
            G[:n, j] = (motion(s, u[k], push) - here)[:n] / step
        s = np.concatenate([here[:n], s[n:]])
        P = F @ P @ F.T + G @ q @ G.T
    return s[n:], P[n:, n:]


def _noise(samples: FloatArray, fs: float) -> float:
    """Return the standard deviation of white noise on a channel, from what lies above its dynamics."""
    left_over = samples - zero_phase(samples, FILTER_ORDER, NOISE_SHARE * fs, fs)
    # of white noise, the share of the band above the filter remains
    middle = left_over[len(samples) // 20 : -len(samples) // 20 or None]
    return max(float(np.std(middle)) / float(np.sqrt(1.0 - 2.0 * NOISE_SHARE)), 1e-12)
