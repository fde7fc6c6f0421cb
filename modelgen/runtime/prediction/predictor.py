"""Predictions some samples ahead: a stationary Kalman filter, then the chain under the measured forces.

The filter knows the noise of the sensors from the record; of the forces that drive what the model does not
explain it takes the size with which it predicts best, none at all (open loop) included. Coulomb friction
holds a body over a step as long as it can, and no longer; cubes of deflections enter with their values at
both ends of a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import DataError
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.prediction.discretised import discretised
from modelgen.runtime.prediction.thresholds import (
    DISTURBANCES,
    FADING,
    FILTER_ORDER,
    JUDGED_SAMPLES,
    LEAST_NOISE,
    NOISE_SHARE,
)
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import vibration
from modelgen.runtime.simulation.plant import Plant, felt_accelerations, measured_forces

TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Steps:
    """The chain from sample to sample for one choice of directions.

    x+ = states x + forces near + friction f + cubes c + disturbances w, and z = reading (x, u, f), all in SI.
    """

    states: FloatArray
    forces: FloatArray
    friction: FloatArray
    cubes: FloatArray
    disturbances: FloatArray
    reading: FloatArray


class SampledChain:
    """A plant from sample to sample under the measured forces of a record.

    Parameters
    ----------
    plant : Plant
    dt : float
        Sampling period in s.
    u : array, shape (n, forces)
        Measured forces of all actuators.
    """

    def __init__(self, plant: Plant, dt: float, u: FloatArray) -> None:
        self.plant, self._dt, self._u = plant, dt, u
        self._asymmetric = [j for j, entry in enumerate(plant.model.friction) if entry.asymmetric]
        self._turning = [plant.model.friction[j].state for j in self._asymmetric]
        self._cubes = plant.cubic_forces()
        self._bodies = tuple(zip(plant.sticking, plant.coulomb_bodies, strict=True))
        # of the sample before, this one, and the next two
        places = np.clip(np.arange(-1, 3) + np.arange(len(u))[:, None], 0, len(u) - 1)
        near = u[places].reshape(len(u), -1)
        self._steps = {signs: self._made(signs) for signs in product((1, -1), repeat=len(self._asymmetric))}
        self._drives = {
            signs: near @ steps.forces.T + plant.offsets @ steps.friction.T
            for signs, steps in self._steps.items()
        }
        n, m = 2 * len(plant.bodies), u.shape[1]
        self._seen, through, self._rubbed = np.split(self.forward.reading, [n, n + m], axis=1)
        self._told = u @ through.T + plant.offsets @ self._rubbed.T
        felt = felt_accelerations(plant.model)
        self._pushed = [felt @ spring.push[n // 2 :] for spring in self._cubes]

    def _made(self, signs: tuple[int, ...]) -> Steps:
        plant, n = self.plant, len(self.plant.bodies)
        m, r = len(plant.model.actuators), len(plant.model.friction)
        pushes = [spring.push for spring in self._cubes]
        each = np.vstack((np.zeros((n, n)), np.diag(1.0 / plant.inertia)))
        names = {plant.model.friction[j].body: s for j, s in zip(self._asymmetric, signs, strict=True)}
        further = np.column_stack((*pushes, each))
        motion, reading = discretised(plant.model, plant.parameters, names, self._dt, further)
        ends = np.cumsum([2 * n, 4 * m, r, len(pushes)])
        x, forces, friction, cubes, rest = np.split(motion, ends, axis=1)
        return Steps(x, forces, friction, cubes, rest, reading)

    @property
    def forward(self) -> Steps:
        """The steps with all bodies moving forward."""
        return self._steps[(1,) * len(self._asymmetric)]

    def step(self, x: FloatArray, at: int | IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the states one sample later, and what the sensors read now.

        Parameters
        ----------
        x : array, shape (states,) or (rows, states)
        at : int, or array of shape (rows,)
            The sample, or that of each row.

        Returns
        -------
        states : array, of the shape of x
        readings : array, shape (sensors,) or (rows, sensors)
        """
        if not self._asymmetric:
            return self._step((), x, at)
        signs = np.where(x[..., self._turning] < 0.0, -1, 1)
        if x.ndim == 1:
            return self._step(tuple(signs.tolist()), x, at)
        places, after, read = np.asarray(at), np.empty_like(x), np.empty((len(x), len(self._seen)))
        for key in self._steps:
            rows = (signs == key).all(axis=1)
            if rows.any():
                after[rows], read[rows] = self._step(key, x[rows], places[rows])
        return after, read

    def _step(
        self, signs: tuple[int, ...], x: FloatArray, at: int | IntArray
    ) -> tuple[FloatArray, FloatArray]:
        steps = self._steps[signs]
        after = x @ steps.states.T + self._drives[signs][at]
        read = x @ self._seen.T + self._told[at]
        for j, spring in enumerate(self._cubes):
            before = (x @ spring.deflection) ** 3
            column = steps.cubes[:, j]
            behind = ((after + before[..., None] * column) @ spring.deflection) ** 3
            after = after + (0.5 * (before + behind))[..., None] * column
            read = read + before[..., None] * self._pushed[j]
        for j, body in self._bodies:
            column = steps.friction[:, j]
            held = after[..., body.velocity] / -column[body.velocity]
            force = np.minimum(np.maximum(held, -body.minus), body.plus)[..., None]
            after = after + force * column
            read = read + force * self._rubbed[:, j]
        return after, read


def predicted_readings(
    plant: Plant, record: Record, horizon: int, start: FloatArray
) -> dict[str, FloatArray]:
    """Return readings as predicted from those `horizon` samples before, and the forces until then.

    Parameters
    ----------
    plant : Plant
    record : Record
        With the forces of all actuators, and at least one sensor of the model.
    horizon : int
        In samples, 1 or more.
    start : array, shape (2 bodies,)
        Positions, then velocities, at the first sample.

    Returns
    -------
    mapping of str to array, shape (n - horizon,)
        Sensor to its reading from sample `horizon` on, in SI.

    Raises
    ------
    DataError
        When the record lacks a force, is no longer than the horizon, or no filter exists.
    """
    keys = [s.key for s in plant.model.sensors if s.key in record.signals]
    rows = [i for i, s in enumerate(plant.model.sensors) if s.key in record.signals]
    if not 1 <= horizon < record.n:
        remedy = f"give 1 to {record.n - 1} samples"
        raise DataError.at("horizon", f"is {horizon}, and {record.name} has {record.n} samples", remedy)
    force, further = measured_forces(plant, record)
    every = {plant.force: force, **further}
    u = np.column_stack([every[a.key] for a in plant.model.actuators])
    z = np.column_stack([record.signals[key] for key in keys])
    chain = SampledChain(plant, record.dt, u)
    filtering = FilteredRecord(chain, rows, z, start, float(np.std(force)))
    read = filtering.ahead(filtering.run(filtering.best_gain(record.fs, horizon), len(z)), horizon)
    return {key: read[:, i] for i, key in enumerate(keys)}


class FilteredRecord:
    """A record filtered by a chain, under disturbances of a size that is looked for.

    `rows` are the sensors that read `z`, shape (n, rows), and `force` the size of the measured force, in SI.
    """

    def __init__(
        self, chain: SampledChain, rows: list[int], z: FloatArray, start: FloatArray, force: float
    ) -> None:
        self._chain, self._rows, self._z, self._start, self._force = chain, rows, z, start, force or 1.0

    def best_gain(self, fs: float, horizon: int) -> FloatArray:
        """Return the gain, shape (states, sensors), that predicts the beginning of the record best.

        Each sensor's error counts by the logarithm of its size; `fs` is in Hz, `horizon` in samples.
        """
        rounding = [LEAST_NOISE * (float(np.std(column)) or 1.0) for column in self._z.T]
        noise = np.maximum([noise_of(column, fs) for column in self._z.T], rounding)
        judged = min(len(self._z), JUDGED_SAMPLES)
        horizon = min(horizon, judged // 2)
        best, least = np.zeros((len(self._start), len(self._rows))), np.inf
        for gain in (best, *(self._gain(share, noise) for share in DISTURBANCES)):
            if gain is None:
                continue
            with np.errstate(all="ignore"):  # what a wrong model lets grow is not the best
                read = self.ahead(self.run(gain, judged), horizon)
                errors = (self._z[horizon:judged] - read)[judged // 10 :]
                cost = float(np.sum(np.log(np.maximum(np.mean(errors**2, axis=0), TINY))))
            if cost < least:
                best, least = gain, cost
        return best

    def run(self, gain: FloatArray, count: int) -> FloatArray:
        """Return the states predicted one sample ahead, shape (count + 1, states)."""
        states = np.empty((count + 1, len(self._start)))
        states[0] = self._start
        for k in range(count):
            after, read = self._chain.step(states[k], k)
            states[k + 1] = after + gain @ (self._z[k] - read[self._rows])
        return states

    def ahead(self, states: FloatArray, horizon: int) -> FloatArray:
        """Return the readings so many samples ahead, shape (samples - horizon, sensors)."""
        # the state at sample k + 1 from readings up to k, carried on
        at = np.arange(1, len(states) - horizon)
        x = states[at]
        for _ in range(horizon - 1):
            x, _ = self._chain.step(x, at)
            at = at + 1
        return self._chain.step(x, at)[1][:, self._rows]

    def _gain(self, share: float, noise: FloatArray) -> FloatArray | None:
        """Return the stationary gain of the one-step predictor; None where there is none."""
        from scipy.linalg import solve_discrete_are

        plant, steps = self._chain.plant, self._chain.forward
        n = len(plant.bodies)
        levers = np.abs(vibration(plant).lowest)
        sizes = share * self._force / np.where(levers > 0.0, levers, 1.0)
        C = steps.reading[self._rows, : 2 * n]
        felt = felt_accelerations(plant.model)[self._rows] / plant.inertia
        G = steps.disturbances * sizes
        H = felt * sizes
        R, Q, S = np.diag(noise**2) + H @ H.T, G @ G.T, G @ H.T
        Phi = FADING * steps.states
        try:
            P = solve_discrete_are(Phi.T, C.T, Q, R, s=S)
        except (np.linalg.LinAlgError, ValueError):
            return None
        return np.asarray(np.linalg.solve(C @ P @ C.T + R, (Phi @ P @ C.T + S).T).T)


def noise_of(samples: FloatArray, fs: float) -> float:
    """Return the standard deviation of white noise on a channel, from what lies above its dynamics.

    Samples have shape (n,), in the channel's unit; `fs` is in Hz.
    """
    left_over = samples - zero_phase(samples, FILTER_ORDER, NOISE_SHARE * fs, fs)
    middle = left_over[len(samples) // 20 : -len(samples) // 20 or None]
    # of white noise, the share of the band above the filter remains
    return float(np.std(middle)) / float(np.sqrt(1.0 - 2.0 * NOISE_SHARE))
