"""Central differences: of order 2 as the paper takes them, and of order 8 for matched filtering."""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray

# f'(0) = sum of c_k (f(k) - f(-k)) / dt, exact for polynomials up to degree 8
EIGHTH_ORDER = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)


def differentiate(samples: FloatArray, dt: float, times: int = 1) -> FloatArray:
    """Differentiate with 9-point central differences of order 8, applied `times` times.

    Both ends are continued by their odd mirror image (four samples), as the filters do: values within
    ``4 * times`` samples of an end are good enough to be filtered further, not to be used.

    Parameters
    ----------
    samples : array, shape (n,)
        At least five samples.
    dt : float
        Sampling period in s.
    times : int
        Order of the derivative; 0 returns the samples.

    Returns
    -------
    array, shape (n,)
    """
    reach = len(EIGHTH_ORDER)
    derivative = samples
    for _ in range(times):
        before = 2.0 * derivative[0] - derivative[reach:0:-1]
        after = 2.0 * derivative[-1] - derivative[-2 : -reach - 2 : -1]
        padded = np.concatenate([before, derivative, after])
        n = len(samples)
        derivative = np.zeros(n)
        for k, coefficient in enumerate(EIGHTH_ORDER, start=1):
            derivative += coefficient * (
                padded[reach + k : reach + k + n] - padded[reach - k : reach - k + n]
            )
        derivative /= dt
    return derivative


def paper_difference(samples: FloatArray, dt: float, times: int = 1) -> FloatArray:
    """Differentiate samples, shape (n,), `times` times with 3-point central differences of order 2.

    The differences are one-sided at the ends; `dt` is in s, the result in unit/s^times.
    """
    derivative = samples
    for _ in range(times):
        derivative = np.asarray(np.gradient(derivative, dt), dtype=float)
    return derivative
