"""Iterated extended Kalman filter on motion and parameters together; a yardstick.

The state holds motion and physical parameters. Between samples the chain is linear for given parameters and
directions, so that it is discretised exactly (`kalman_model`); only its product with the parameters is
linearised, around the motion just estimated and the parameters of the pass before. Passes follow one another
until the parameters rest. Noise of the sensors is read off the records above their dynamics; noise of the
measured force drives the motion.

Coulomb friction is no function that could be linearised. While a body's velocity is not clearly different
from zero, its friction is unknown between its two levels: there, and only there, it is process noise.

The filter's own covariance holds if the model does. What is returned is the sandwich of prediction error
methods (Ljung 1999, section 9.2), which takes innovations as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.comparison.kalman_model import KalmanModel
from modelgen.runtime.comparison.thresholds import LEAST_NOISE, PARAMETER_STD, PASSES, SETTLED, VELOCITY_STD
from modelgen.runtime.iv.output_error import Response
from modelgen.runtime.least_squares.hac_covariance import long_run_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.prediction.predictor import noise_of
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.thresholds import CUTOFF_SHARE
from modelgen.runtime.simulation.validate import initial_state


def filter_parameters(model: Model, records: Sequence[Record], start: Mapping[str, float]) -> Response:
    """Run the filter over all records in turn, parameters carried on, from a start (SI).

    Raises
    ------
    DataError
        When the filter diverges, or the chain has a cubic stiffness.
    """
    if model.cubic_springs:
        raise DataError.at("Kalman filter", "cannot handle a cubic stiffness", "use another method")
    plant = make_plant(model, start)
    first = np.array([plant.parameters[name] for name in model.parameters])
    scale = np.where(first == 0.0, 1.0, np.abs(first))
    around = first
    for _ in range(PASSES):
        theta, P = first, np.diag((PARAMETER_STD * scale) ** 2)
        trails = []
        for record in records:
            with np.errstate(all="ignore"):
                theta, P, trail = _pass(KalmanModel(plant, around, scale, record.dt), record, theta, P)
            trails.append(trail)
            if not (np.isfinite(theta).all() and np.isfinite(P).all() and (np.diag(P) > 0.0).all()):
                raise DataError.at("Kalman filter", f"diverges on {record.name}", "use another method")
        moved = np.abs(theta - around) / np.sqrt(np.diag(P))
        around = theta
        if moved.max() < SETTLED:
            break
    scores = long_run_covariance([trail.scores(theta) for trail in trails])
    return Response(model.parameters, theta, P @ scores @ P)


@dataclass(frozen=True, eq=False)
class Trail:
    """Of every sample the innovation, shape (n, sensors), and its weight, for given parameters; in SI.

    `theta` are the parameters then, shape (n, parameters), `slopes` minus the innovation's derivatives by
    them, shape (n, sensors, parameters), `spreads` its covariance, shape (n, sensors, sensors).
    """

    innovations: FloatArray
    theta: FloatArray
    slopes: FloatArray
    spreads: FloatArray

    def scores(self, theta: FloatArray) -> FloatArray:
        """Return the gradients of the log-likelihood at these parameters, shape (n, parameters)."""
        moved = np.einsum("kij,kj->ki", self.slopes, theta - self.theta)
        weighted = np.linalg.solve(self.spreads, (self.innovations - moved)[..., None])[..., 0]
        return np.asarray(np.einsum("kij,ki->kj", self.slopes, weighted))


def _pass(
    chain: KalmanModel, record: Record, theta: FloatArray, P_theta: FloatArray
) -> tuple[FloatArray, FloatArray, Trail]:
    """Return parameters and their covariance after one record, and its innovations."""
    model, n = chain.plant.model, chain.states
    z = np.column_stack([record.signals[sensor.key] for sensor in model.sensors])
    u = np.column_stack([record.signals[actuator.key] for actuator in model.actuators])
    R = np.diag([max(noise_of(column, record.fs), LEAST_NOISE) ** 2 for column in z.T])
    q = np.diag([max(noise_of(column, record.fs), LEAST_NOISE) ** 2 for column in u.T])
    s = np.concatenate([initial_state(chain.plant, record, CUTOFF_SHARE * record.fs), theta])
    P = np.zeros((s.size,) * 2)
    P[:n, :n] = np.diag(_first_variances(chain, record, R))
    P[n:, n:] = P_theta
    one, transition = np.eye(s.size), np.eye(s.size)
    # of the sample before, this one, and the next two
    near = np.clip(np.arange(-1, 3) + np.arange(len(u))[:, None], 0, len(u) - 1)
    N, m, c = len(z), z.shape[1], theta.size
    trail = Trail(np.zeros((N, m)), np.zeros((N, c)), np.zeros((N, m, c)), np.zeros((N, m, m)))
    for k in range(N):
        at = chain.sample(s[:n], np.sqrt(np.diag(P)[:n]), s[n:])
        expected, H, by_force, by_friction = at.reading(s, u[k])
        spread = R + by_force @ q @ by_force.T + by_friction @ at.friction_noise @ by_friction.T
        innovation, whole = z[k] - expected, H @ P @ H.T + spread
        gain = np.linalg.solve(whole, H @ P).T
        # for given parameters the motion follows them with this slope, and the rest is its uncertainty
        slope = H[:, :n] @ np.linalg.solve(P[n:, n:], P[n:, :n]).T + H[:, n:]
        trail.innovations[k], trail.theta[k], trail.slopes[k] = innovation, s[n:], slope
        trail.spreads[k] = whole - slope @ P[n:, n:] @ slope.T
        rest = one - gain @ H
        s = s + gain @ innovation
        P = rest @ P @ rest.T + gain @ spread @ gain.T
        moved, transition[:n], by_force, by_friction = at.motion(s, u[near[k]])
        s = np.concatenate([moved, s[n:]])
        P = transition @ P @ transition.T
        P[:n, :n] += by_force @ q @ by_force.T + by_friction @ at.friction_noise @ by_friction.T
    return s[n:].copy(), P[n:, n:].copy(), trail


def _first_variances(chain: KalmanModel, record: Record, R: FloatArray) -> FloatArray:
    """Return the variances of positions and velocities at the first sample."""
    moving = max(float(np.ptp(record.signals[chain.plant.model.sensors[0].key])) * VELOCITY_STD, 1e-9)
    half = chain.states // 2
    return np.repeat([max(float(np.diag(R).max()), 1e-18), moving**2], half)
