"""A chain discretised from sample to sample, and its derivatives by motion and parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.comparison.thresholds import RELATIVE_STEP, UNCERTAIN
from modelgen.runtime.prediction.discretised import discretised
from modelgen.runtime.simulation.plant import Plant

Directions = tuple[int, ...]
# values and slopes by the state, by the force, by the friction
Linearised = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Matrices:
    """x+ = motion (x, forces, f) and z = reading (x, u, f), with their derivatives by every parameter.

    The derivatives have the parameters as first axis. u is the force at a sample; `forces` are those at the
    sample before, this one, and the next two, with a cubic through them in between: a straight line would
    take (pi f / fs)^2 / 3 off a sine of f Hz, and make the inertias wrong by as much.
    """

    motion: FloatArray
    reading: FloatArray
    motion_slopes: FloatArray
    reading_slopes: FloatArray


@dataclass(frozen=True, eq=False)
class Sample:
    """The chain linearised at one sample.

    `friction`, its slopes by the parameters, shape (columns of E, parameters), and the covariance of what of
    it is unknown, `friction_noise`. `around` are the parameters of the matrices, shape (parameters,).
    """

    matrices: Matrices
    around: FloatArray
    friction: FloatArray
    friction_slopes: FloatArray
    friction_noise: FloatArray

    def motion(self, s: FloatArray, forces: FloatArray) -> Linearised:
        """Return the motion at the next sample; `s` has shape (states,), `forces` (4, forces), in SI."""
        n, count = len(self.matrices.motion), forces.size
        found, slope = self._linearise(self.matrices.motion, self.matrices.motion_slopes, s, forces.ravel())
        each = self.matrices.motion[:, n : n + count].reshape(n, *forces.shape)
        # noise of one sample acts through all steps that it enters, which is all of these
        return found, slope, each.sum(axis=1), self.matrices.motion[:, n + count :]

    def reading(self, s: FloatArray, u: FloatArray) -> Linearised:
        """Return the readings, shape (sensors,), in SI, from states `s` and forces `u`, shape (forces,)."""
        n, m = len(self.matrices.motion), u.size
        found, slope = self._linearise(self.matrices.reading, self.matrices.reading_slopes, s, u)
        return found, slope, self.matrices.reading[:, n : n + m], self.matrices.reading[:, n + m :]

    def _linearise(
        self, matrix: FloatArray, slopes: FloatArray, s: FloatArray, u: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        n = len(self.matrices.motion)
        given = np.concatenate([s[:n], u, self.friction])
        by_parameters = (slopes @ given).T + matrix[
            :, given.size - self.friction.size :
        ] @ self.friction_slopes
        # the friction is taken at the present parameters, the matrices at those of the pass before
        found = matrix @ given + (slopes @ given).T @ (s[n:] - self.around)
        return found, np.hstack((matrix[:, :n], by_parameters))


class KalmanModel:
    """A plant with a measured force and unknown parameters, at sampling period dt (s).

    Parameters
    ----------
    plant : Plant
    around : ndarray, shape (parameters,)
        Parameters around which products with the motion are linearised (SI).
    scale : ndarray, shape (parameters,)
        Their sizes.
    dt : float
    """

    def __init__(self, plant: Plant, around: FloatArray, scale: FloatArray, dt: float) -> None:
        self.plant, self.states = plant, 2 * len(plant.bodies)
        self._around, self._scale, self._dt = around, scale, dt
        self._made: dict[Directions, Matrices] = {}
        self._names = {name: i for i, name in enumerate(plant.model.parameters)}

    def sample(self, x: FloatArray, std: FloatArray, theta: FloatArray) -> Sample:
        """Return the chain linearised at a motion and parameters.

        The motion `x` and its standard deviations `std` have shape (states,), `theta` (parameters,); in SI.
        """
        friction = self.plant.model.friction
        f, noise = np.zeros(len(friction)), np.zeros(len(friction))
        slopes = np.zeros((len(friction), theta.size))
        directions = []
        for j, entry in enumerate(friction):
            v, sign = x[entry.state], 1 if x[entry.state] >= 0.0 else -1
            directions.append(sign)
            name = entry.coulomb_plus if sign > 0 else entry.coulomb_minus
            level = self._value(name, theta)
            braked = abs(level) / self.plant.inertia[entry.state - len(self.plant.bodies)] * self._dt
            if abs(v) <= max(UNCERTAIN * std[entry.state], braked):
                noise[j] = level**2
            else:
                f[j] += sign * level
                self._mark(slopes, j, name, float(sign))
            f[j] += self._value(entry.offset, theta)
            self._mark(slopes, j, entry.offset, 1.0)
        matrices = self._matrices(tuple(directions))
        return Sample(matrices, self._around, f, slopes, np.diag(noise))

    def _value(self, name: str | None, theta: FloatArray) -> float:
        return float(theta[self._names[name]]) if name in self._names else self.plant.value(name)

    def _mark(self, slopes: FloatArray, row: int, name: str | None, slope: float) -> None:
        if name in self._names:
            slopes[row, self._names[name]] += slope

    def _matrices(self, directions: Directions) -> Matrices:
        """Return the matrices, and their central differences by every parameter."""
        if directions not in self._made:
            motion, reading = self._discretised(self._around, directions)
            slopes: tuple[list[FloatArray], list[FloatArray]] = ([], [])
            for i, size in enumerate(self._scale):
                step = np.zeros(self._scale.size)
                step[i] = RELATIVE_STEP * size
                ends = [self._discretised(self._around + sign * step, directions) for sign in (1.0, -1.0)]
                for kept, high, low in zip(slopes, *ends, strict=True):
                    kept.append((high - low) / (2.0 * step[i]))
            self._made[directions] = Matrices(motion, reading, np.array(slopes[0]), np.array(slopes[1]))
        return self._made[directions]

    def _discretised(self, values: FloatArray, directions: Directions) -> tuple[FloatArray, FloatArray]:
        named = dict(zip(self.plant.model.parameters, values.tolist(), strict=True))
        friction = self.plant.model.friction
        by_body = {entry.body: sign for entry, sign in zip(friction, directions, strict=True)}
        return discretised(self.plant.model, {**self.plant.parameters, **named}, by_body, self._dt)
