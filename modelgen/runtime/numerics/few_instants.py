"""How much more a long-run variance must be where few instants say what there is to be said.

A variance that is estimated from few instants is uncertain, and normal quantiles promise too much with it.
What a record says of an inertia may be spread over it, while friction is told from one change of speed: every
direction of the parameters has instants of its own. Directions that differ in that are eigenvectors of the
fourth moments of the influence made white (Cardoso 1989). A variance that grows by directions grows, in
any sum of parameters, by no more than the largest and no less than the smallest factor: near dependences,
which composites rest on, stay as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.decorrelation import principal_directions

# Numbers of a record that are kept to see on how many instants a variance rests; directions with less than
# this share of the largest variance, where rounding would show, grow by the mean of the others' factors.
KEPT_SUMS = 1 << 18
WITHOUT_DIRECTION = 1e-6
# They are not looked for where a variance would grow by less than the second number, even if one of them
# rested on so many times fewer instants than every column does.
FEWER, HARDLY_MORE = 4.0, 0.02
# The normal quantile of intervals of 95 %.
USUAL = 1.96


@dataclass(frozen=True, eq=False)
class KernelSums:
    """What a record gives.

    Attributes
    ----------
    total : array, shape (c, c)
        The kernel's sum over lags.
    kept : array, shape (k, c)
        The influence after its moving sums, over the root of their power, at every `stride`-th instant:
        their products add up to `total`, nearly, with each of them counted so many times.
    stride : int
    """

    total: FloatArray
    kept: FloatArray
    stride: int = 1


class EveryFew:
    """Keeps every so many instants of a series that comes in parts, fewer the longer it is."""

    def __init__(self, stride: int) -> None:
        self.stride = stride
        self._parts: list[FloatArray] = []
        self._numbers = self._seen = 0

    def add(self, part: FloatArray) -> None:
        """Take in the next instants, shape (n, c)."""
        chosen = part[-self._seen % self.stride :: self.stride]
        self._parts.append(chosen.copy())
        self._seen += len(part)
        self._numbers += chosen.size
        while self._numbers > KEPT_SUMS:
            self._parts = [np.concatenate(self._parts)[::2]]
            self._numbers = self._parts[0].size
            self.stride *= 2

    def result(self) -> FloatArray:
        """Return what is kept, shape (k, c)."""
        return np.concatenate(self._parts)


def joined_covariance(
    sums: Sequence[KernelSums], bandwidth: float, n: int, quantile: float = USUAL
) -> FloatArray:
    """Return the covariance, shape (c, c), from the sums of all records, n instants together.

    It grows in every direction by the factor for the instants that this one rests on, for that normal
    quantile.
    """
    result = np.asarray(np.sum([one.total for one in sums], axis=0))
    scale = np.sqrt(np.diag(result))
    if not np.any(scale > 0.0):
        return result
    scale = np.where(scale > 0.0, scale, 1.0)
    least = float(np.min(_instants([one.kept / scale for one in sums], sums, n)))
    if fixed_b_factor(bandwidth, least / FEWER, quantile) < 1.0 + HARDLY_MORE:
        return result * fixed_b_factor(bandwidth, least, quantile)
    powers, vectors = np.linalg.eigh(result / np.outer(scale, scale))
    known = powers > WITHOUT_DIRECTION * powers[-1]
    root = np.sqrt(powers[known])
    series = [(one.kept / scale) @ (vectors[:, known] / root) for one in sums]
    # eigenvectors of the sum of |z|^2 z z^T over instants
    roots = [np.sqrt(one.stride) * np.linalg.norm(z, axis=1) for z, one in zip(series, sums, strict=True)]
    _, own = principal_directions(
        np.concatenate([root[:, None] * z for z, root in zip(series, roots, strict=True)])
    )
    instants = _instants([z @ own for z in series], sums, n)
    more = np.array([fixed_b_factor(bandwidth, count, quantile) - 1.0 for count in instants.tolist()])
    # all others, those that the kept instants do not reach among them, grow by the mean
    directions = scale[:, None] * ((vectors[:, known] * root) @ own)
    mean = float(np.mean(more))
    return np.asarray(result * (1.0 + mean) + (directions * (more - mean)) @ directions.T)


def _instants(series: Sequence[FloatArray], sums: Sequence[KernelSums], n: int) -> FloatArray:
    """Return on how many of n instants each column of the records' series rests, shape (c,)."""
    squares = [z**2 for z in series]
    second = sum(one.stride * np.sum(z, axis=0) for z, one in zip(squares, sums, strict=True))
    fourth = sum(one.stride * np.sum(z**2, axis=0) for z, one in zip(squares, sums, strict=True))
    return effective_instants(np.asarray(second), np.asarray(fourth), n)


def effective_instants(second: FloatArray, fourth: FloatArray, n: int) -> FloatArray:
    """Return on how many of n instants variances rest, shape (c,).

    Parameters
    ----------
    second, fourth : array, shape (c,)
        Sums of squares and of fourth powers. Normal noise of even size has fourth moments of three squared
        variances: all n instants count. Where a few stretches say most of what is said, a variance is no
        more certain than these few make it.
    n : int
        Number of instants of all records.
    """
    found = np.full(len(second), float(n))
    np.divide(3.0 * second**2, fourth, out=found, where=fourth > 0.0)
    return np.asarray(np.minimum(found, float(n)))


def fixed_b_factor(bandwidth: float, n: float, quantile: float = USUAL) -> float:
    """Return by how much a variance grows so that a normal quantile holds with this bandwidth.

    Critical values of 95 % by b = bandwidth / n, n instants, after Kiefer and Vogelsang (2005), simulated
    for Parzen's kernel. Beyond these the tail is that of Student's distribution that has the same 95 %
    (Abramowitz and Stegun 26.7.5).
    """
    b = min(bandwidth / max(n, 1.0), 1.0)
    more = 1.8952 * b + 2.1790 * b**2 - 0.3610 * b**3
    if quantile > USUAL:
        first, second = _student_terms(USUAL)
        # one over the degrees of freedom
        v = 2.0 * more / (first + np.sqrt(first**2 + 4.0 * second * more))
        first, second = _student_terms(quantile)
        more = first * v + second * v**2
    return float((1.0 + more / max(quantile, USUAL)) ** 2)


def _student_terms(z: float) -> tuple[float, float]:
    """Return what a quantile z of Student's distribution has more than the normal one, by 1/v and 1/v^2."""
    return (z**3 + z) / 4.0, (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0
