"""A chain discretised from sample to sample, under measured forces and friction that rests in between."""

from __future__ import annotations

from collections.abc import Mapping
from math import factorial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.matrix_exponential import matrix_exponential

# Value and derivatives at 0 of the cubic through values at -1, 0, 1 and 2.
CUBIC = np.linalg.inv([[t**k / factorial(k) for k in range(4)] for t in (-1.0, 0.0, 1.0, 2.0)])


def discretised(
    model: Model,
    parameters: Mapping[str, float],
    directions: Mapping[str, int],
    dt: float,
    further: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return x+ = motion (x, forces, f, w) and z = reading (x, u, f).

    u is the force at a sample; `forces` are those of all actuators at the sample before, this one, and the
    next two, with a cubic through them in between: a straight line would take (pi f / fs)^2 / 3 off a sine
    of f Hz. f (columns of E) and w rest over the step.

    Parameters
    ----------
    model : Model
    parameters : mapping of str to float
        All of them, in SI.
    directions : mapping of str to int
        Of bodies whose friction depends on the direction.
    dt : float
        Sampling period in s.
    further : array, shape (states, w), optional
        How w changes x'.

    Returns
    -------
    motion : array, shape (states, states + 4 forces + columns of E + w)
    reading : array, shape (sensors, states + forces + columns of E)
    """
    A, B, C, D, E, F = model.state_space(parameters, directions)
    n, m = B.shape
    held = E if further is None else np.hstack((E, further))
    # over a step of 1: (x, u, its three derivatives, f and w)
    M = np.zeros((n + 4 * m + held.shape[1],) * 2)
    M[:n] = dt * np.hstack((A, B, np.zeros((n, 3 * m)), held))
    M[n : n + 3 * m, n + m : n + 4 * m] = np.eye(3 * m)
    moved = matrix_exponential(M)[:n]
    by_samples = moved[:, n : n + 4 * m] @ np.kron(CUBIC, np.eye(m))
    return np.hstack((moved[:, :n], by_samples, moved[:, n + 4 * m :])), np.hstack((C, D, F))
