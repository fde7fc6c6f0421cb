"""The HAC covariance of `covariance`, over records that are read in chunks.

Parzen's kernel is a sum of squares of the series after two moving sums: the cost does not depend on the
bandwidth, nor on what the memory holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from modelgen.runtime.least_squares.hac_covariance import (
    KernelSums,
    bandwidth_from_moments,
    joined_covariance,
    moving_sum,
    squared_sums,
    window_width,
)
from modelgen.runtime.least_squares.triangle_fit import FactorFit
from modelgen.runtime.rows.chunk import CHUNK_SAMPLES
from modelgen.runtime.rows.record_rows import RecordRows
from modelgen.runtime.rows.row_terms import RowTerms

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


class MomentSums:
    """Moments of an influence that comes in chunks."""

    def __init__(self, columns: int) -> None:
        self._power, self._product = np.zeros(columns), np.zeros(columns)
        self._last, self._n = np.zeros((0, columns)), 0

    def add(self, psi: FloatArray) -> None:
        """Take in the next instants, shape (count, c)."""
        joined = np.vstack([self._last, psi])
        self._power += np.sum(psi**2, axis=0)
        self._product += np.sum(joined[1:] * joined[:-1], axis=0)
        self._last, self._n = psi[-1:], self._n + len(psi)

    def result(self) -> Moments:
        """Return the moments of what was taken in."""
        return Moments(self._power, self._product, self._n)


class ParzenSums:
    """The sum over lags l of Parzen's kernel times psi_t psi_(t+l)^T, of an influence in chunks."""

    def __init__(self, columns: int, bandwidth: float) -> None:
        self._width = window_width(bandwidth)
        # before the record there is nothing
        self._tails = [np.zeros((self._width - 1, columns)) for _ in range(2)]
        self._total, self._fourth = np.zeros((columns, columns)), np.zeros(columns)

    def add(self, psi: FloatArray) -> None:
        """Take in the next instants, shape (count, c)."""
        for place, tail in enumerate(self._tails):
            joined = np.vstack([tail, psi])
            self._tails[place] = joined[len(joined) - len(tail) :]
            psi = moving_sum(joined, self._width)
        sums = squared_sums(psi, self._width)
        self._total += sums.total
        self._fourth += sums.fourth

    def result(self) -> KernelSums:
        """Return the sums over what was taken in."""
        # the moving sums that begin within the record and end behind it
        self.add(np.zeros((2 * (self._width - 1), len(self._total))))
        return KernelSums(self._total, self._fourth)


def stream_hac_covariance(fit: FactorFit, tasks: Sequence[RecordRows]) -> FloatArray:
    """Return the heteroskedasticity- and autocorrelation-consistent covariance, shape (c, c).

    As `covariance.hac_covariance`; c are the columns of the fit, which must have its whole inverse.
    """
    series = [_kept(fit, index, task) for index, task in enumerate(tasks)]
    found = []
    for one in series:
        moments = MomentSums(len(fit.columns))
        for psi in one():
            moments.add(psi)
        found.append(moments.result())
    bandwidth = bandwidth_of(found)
    sums = []
    for one in series:
        squares = ParzenSums(len(fit.columns), bandwidth)
        for psi in one():
            squares.add(psi)
        sums.append(squares.result())
    return covariance_from_sums(fit, found, sums)


def bandwidth_of(found: Sequence[Moments]) -> float:
    """Return the bandwidth that suits all records."""
    power = np.sum([one.power for one in found], axis=0)
    product = np.sum([one.product for one in found], axis=0)
    return bandwidth_from_moments(power, product, max(one.n for one in found))


def covariance_from_sums(fit: FactorFit, found: Sequence[Moments], sums: Sequence[KernelSums]) -> FloatArray:
    """Return the covariance, shape (c, c), from what all records gave."""
    lost = fit.samples / (fit.samples - len(fit.columns))
    return lost * joined_covariance(sums, bandwidth_of(found), sum(one.n for one in found))


def influence_chunks(fits: Sequence[tuple[FactorFit, int]], task: RecordRows) -> Iterator[list[FloatArray]]:
    """Yield what each instant of a record contributes to X's error, chunk by chunk, for each fit.

    Parameters
    ----------
    fits : sequence of (FactorFit, int)
        Fits with their whole inverse, and the number of the record in each.
    task : RecordRows
        The record.

    Yields
    ------
    list of array, shape (count, columns of the fit) each
    """
    columns = sum(len(fit.columns) for fit, _ in fits)
    most = max(1, KEPT // columns) * task.plan.filtering.factor
    if most < (task.samples or CHUNK_SAMPLES):  # many columns: their influences are what fills the memory
        task = replace(task, samples=most)
    for chunk in task.chunks():
        signals, places = chunk.signals(), task.places(chunk)
        found = [np.zeros((chunk.count, len(fit.columns))) for fit, _ in fits]
        for terms, used in zip(task.terms, places, strict=True):
            lines = terms.evaluate(signals)
            signals.forget(terms.row)
            for psi, (fit, record) in zip(found, fits, strict=True):
                _add_influence(psi, fit, record, terms, lines, used)
        yield found


def _add_influence(
    psi: FloatArray,
    fit: FactorFit,
    record: int,
    terms: RowTerms,
    lines: FloatArray,
    used: npt.NDArray[np.int64] | None,
) -> None:
    """Add one row's share; `lines` are 1, W and Y of the samples kept."""
    weight = fit.weights.get((record, terms.row))
    if weight is None or fit.inverse is None:
        return
    place = {column: index for index, column in enumerate(fit.columns)}
    error = lines[-1] - fit.x[list(terms.columns)] @ lines[1:-1]
    alive = [index for index, column in enumerate(terms.columns) if column in place]
    gain = fit.inverse[[place[terms.columns[index]] for index in alive]]
    part = (weight**2 * error * lines[1:-1][alive]).T @ gain
    if used is None:
        psi += part
    else:
        psi[used] += part[used]


def _kept(fit: FactorFit, record: int, task: RecordRows) -> Series:
    """Return the influence of a record, kept where it is small."""

    def series() -> Iterator[FloatArray]:
        return (psi for (psi,) in influence_chunks([(fit, record)], task))

    if len(task.grid) * len(fit.columns) > KEPT:
        return series
    parts = list(series())
    return lambda: iter(parts)
