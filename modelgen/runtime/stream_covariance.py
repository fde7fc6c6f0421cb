"""The HAC covariance of `covariance`, over records that are read in chunks.

The Bartlett kernel of a whole bandwidth S is a sum of squares of moving sums over S instants, and that of a
broken bandwidth lies between two whole ones: the cost does not depend on the bandwidth,
nor on what the memory holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.runtime.covariance import bandwidth_from_moments, fixed_b_factor
from modelgen.runtime.factor_fit import FactorFit
from modelgen.runtime.record_factors import Task

FloatArray = npt.NDArray[np.float64]
Series = Callable[[], Iterator[FloatArray]]

# Influences of a record are kept between passes up to this many numbers, else computed again.
KEPT = 1 << 20


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums of squares and of products of neighbours of an influence, shape (c,) each, and its length."""

    power: FloatArray
    product: FloatArray
    n: int


def stream_hac_covariance(fit: FactorFit, tasks: Sequence[Task]) -> FloatArray:
    """Return the heteroskedasticity- and autocorrelation-consistent covariance, shape (c, c).

    Newey and West (1987), bandwidth of Andrews (1991); c are the columns of the fit. The fit must have its
    whole inverse.
    """
    series = [_kept(fit, index, task) for index, task in enumerate(tasks)]
    found = [moments(one) for one in series]
    bandwidth = bandwidth_of(found)
    total = sum((bartlett_sum(one, bandwidth) for one in series), np.zeros((len(fit.columns),) * 2))
    small_sample = fit.samples / (fit.samples - len(fit.columns))
    return total * small_sample * fixed_b_factor(bandwidth, sum(one.n for one in found))


def bandwidth_of(found: Sequence[Moments]) -> float:
    """Return the bandwidth that suits all records."""
    power = np.sum([one.power for one in found], axis=0)
    product = np.sum([one.product for one in found], axis=0)
    return bandwidth_from_moments(power, product, max(one.n for one in found))


def influence_chunks(fit: FactorFit, record: int, task: Task) -> Iterator[FloatArray]:
    """Yield what each instant of a record contributes to X's error, chunk by chunk, shape (count, c) each."""
    assert fit.inverse is not None
    place = {column: index for index, column in enumerate(fit.columns)}
    for chunk in task.chunks():
        signals = chunk.signals()
        psi = np.zeros((chunk.count, len(fit.columns)))
        for terms, used in zip(task.rows, task.places(chunk), strict=True):
            weight = fit.weights.get((record, terms.row))
            if weight is None:
                continue
            lines = terms.evaluate(signals)
            signals.forget(terms.row)
            touched = list(terms.columns)
            error = lines[-1] - fit.x[touched] @ lines[1:-1]
            alive = [index for index, column in enumerate(touched) if column in place]
            gain = fit.inverse[[place[touched[index]] for index in alive]]
            part = (weight**2 * error * lines[1:-1][alive]).T @ gain
            if used is None:
                psi += part
            else:
                psi[used] += part[used]
        yield psi


def moments(series: Series) -> Moments:
    """Return the moments of an influence that the bandwidth is chosen from."""
    power, product, n = np.zeros(1), np.zeros(1), 0
    last: FloatArray | None = None
    for psi in series():
        power = power + np.sum(psi**2, axis=0)
        joined = psi if last is None else np.vstack([last, psi])
        product = product + np.sum(joined[1:] * joined[:-1], axis=0)
        last, n = psi[-1:], n + len(psi)
    return Moments(power, product, n)


def bartlett_sum(series: Series, bandwidth: float) -> FloatArray:
    """Return the sum over all lags l of (1 - |l| / bandwidth) psi_t psi_(t+l)^T."""
    whole = int(bandwidth)
    # a triangle of broken width is piecewise linear between those of the two whole widths beside it
    share = (whole + 1) * (1.0 - whole / bandwidth)
    widths = [(whole, (1.0 - share) / whole), (whole + 1, share / (whole + 1))]
    total: FloatArray = np.zeros((1, 1))
    tail: FloatArray | None = None
    for psi in series():
        if tail is None:
            tail = np.zeros((whole + 1, psi.shape[1]))
        total = total + _moving(np.vstack([tail, psi]), len(psi), widths)
        tail = np.vstack([tail, psi])[-(whole + 1) :]
    assert tail is not None
    # the sums that begin within the record and end behind it
    return total + _moving(np.vstack([tail, np.zeros_like(tail)]), whole, widths)


def _moving(psi: FloatArray, count: int, widths: Sequence[tuple[int, float]]) -> FloatArray:
    """Return the weighted squares of the moving sums that end at `count` lines, after the first `edge`."""
    edge = widths[-1][0]
    sums = np.vstack([np.zeros(psi.shape[1]), np.cumsum(psi, axis=0)])
    total = np.zeros((psi.shape[1], psi.shape[1]))
    for width, share in widths:
        ends = np.arange(edge, edge + count)
        moved = sums[ends + 1] - sums[ends + 1 - width]
        total += share * (moved.T @ moved)
    return total


def _kept(fit: FactorFit, record: int, task: Task) -> Series:
    """Return the influence of a record, kept where it is small."""
    if len(task.grid) * len(fit.columns) > KEPT:
        return lambda: influence_chunks(fit, record, task)
    parts = list(influence_chunks(fit, record, task))
    return lambda: iter(parts)
