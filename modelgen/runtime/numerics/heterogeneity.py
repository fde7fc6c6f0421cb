"""Several estimates of one number: their mean, whether they are of one number, and many such tests at once.

Cochran, Biometrics 10 (1954) 101-129; DerSimonian and Laird, Controlled Clinical Trials 7 (1986) 177-188;
Holm, Scandinavian Journal of Statistics 6 (1979) 65-70.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.numerics.tails import chi_square_tail


@dataclass(frozen=True)
class Heterogeneity:
    """Weighted mean of estimates and what they scatter beyond their own deviations.

    `value` and `std` include the spread between the true values, `between_std`, as far as it shows (0 where
    it does not). `statistic` is Cochran's Q, `p_value` how probable a larger one is if there is no spread.
    """

    value: float
    std: float
    between_std: float
    statistic: float
    p_value: float


def heterogeneity(values: FloatArray, variances: FloatArray, groups: IntArray | None = None) -> Heterogeneity:
    """Return mean and spread of independent estimates.

    Parameters
    ----------
    values, variances : arrays, shape (k,)
        Variances above zero.
    groups : array of int, shape (k,), optional
        Estimates of one group have one true value, apart from the spread; one group by default. The mean is
        that of all.
    """
    weights = 1.0 / variances
    of = np.zeros(len(values), dtype=int) if groups is None else groups
    Q = freedom = scale = 0.0
    for group in np.unique(of):
        w, x = weights[of == group], values[of == group]
        Q += float(w @ (x - w @ x / w.sum()) ** 2)
        freedom += len(x) - 1
        scale += float(w.sum() - (w @ w) / w.sum())
    between = max(0.0, (Q - freedom) / scale) if freedom > 0 and scale > 0.0 else 0.0
    spread = 1.0 / (variances + between)
    return Heterogeneity(
        float(spread @ values / spread.sum()),
        float(1.0 / np.sqrt(spread.sum())),
        float(np.sqrt(between)),
        Q if freedom else 0.0,
        chi_square_tail(Q, int(freedom)) if freedom else 1.0,
    )


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Return p values adjusted for all of the tests: below 0.05 in 5 % of all families without any effect."""
    order = sorted(range(len(p_values)), key=lambda k: p_values[k])
    adjusted, largest = [1.0] * len(p_values), 0.0
    for rank, k in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[k]))
        adjusted[k] = largest
    return tuple(adjusted)
