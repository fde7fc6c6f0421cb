"""Covariances of a fit: the printed one, eq. (11), and one that is right for coloured residuals (HAC).

Filtering and decimation colour the residuals, and their size varies along a record: eq. (11), made for white
ones, then promises too much. The Newey-West estimator takes both as they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from operator import is_
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.numerics.bandwidth import (
    KEPT_WHOLE,
    PART,
    KeptOnce,
    Series,
    in_parts,
    moving_sum,
    scores_bandwidth,
    window_power,
    window_width,
)
from modelgen.runtime.numerics.few_instants import USUAL, EveryFew, KernelSums, joined_covariance

# Of so many instants, or a multiple, an influence is held at a time: each part asks every block.
INSTANTS = 1 << 10


def printed_covariance(fit: Fit, residual_dof: str = "r-c") -> tuple[float, FloatArray]:
    """Return sigma of the weighted rows and C = sigma^2 (W^T W)^-1 (Pham 2002, eq. (11)), in SI, (c, c).

    `residual_dof` says what |Y - W X|^2 is divided by: "r-c" (eq. (11)) or "r-1", the residual's plain
    variance, with which published figures are reproduced.
    """
    lost = len(fit.columns) if residual_dof == "r-c" else 1
    variance = fit.residual_norm**2 / (fit.count - lost)
    return float(np.sqrt(variance)), variance * fit.solution.inverse


def hac_covariance(fit: Fit, grown: bool = True) -> FloatArray:
    """Return the heteroskedasticity- and autocorrelation-consistent covariance, in SI, (c, c).

    As Newey and West (1987), but with Parzen's kernel: differentiated noise has its power at high frequencies
    that their triangle lets through. Its bandwidth is `scores_bandwidth`, and what that wants of small
    samples `few_instants`. Rows of one instant are taken together; masked instants count as zeros at
    their place, records as independent. It is computed once a solution: copies of a fit with other notes or
    delays have the same.
    """
    return np.asarray(_long_run(fit, grown).covariances[0] * _of_all(fit))


def hac_bandwidth(fit: Fit) -> float:
    """Return the bandwidth of `hac_covariance`, in instants."""
    return _long_run(fit, True).bandwidth


def _long_run(fit: Fit, grown: bool) -> LongRun:
    """Return the covariance of the sum of a fit's influence, kept with its solution."""
    of = (fit.blocks, fit.weights, fit.residuals, fit.projected, fit.series, fit.carried)
    known, name = vars(fit.solution), "long_run" if grown else "shorter_run"
    if name not in known or not all(map(is_, known[name][0], of)):
        numbers = sum(fit.blocks[one[0]].grid for one in fit.by_record.values()) * len(fit.columns)
        most = KEPT_WHOLE if numbers <= KEPT_WHOLE else 0
        known[name] = of, long_run([KeptOnce(one, most) for one in influence_parts(fit)], grown=grown)
    found: LongRun = known[name][1]
    return found


def covariance_of_bandwidth(fit: Fit, series: Sequence[FloatArray], least: float) -> FloatArray:
    """Return `hac_covariance` of a fit with this influence and at least so many instants as bandwidth.

    `series` holds an array a record, shape (n, c), in SI units of the columns.
    """
    return long_run_covariance(series, least) * _of_all(fit)


def _of_all(fit: Fit) -> float:
    """Return r / (r - c), r all samples less the directions along which forces are left open."""
    r = fit.count - sum(block.opened for block in fit.blocks)
    return float(r / max(r - len(fit.columns) - fit.lost, 1.0))


def long_run_covariance(
    series: Sequence[Series | FloatArray], least: float = 1.0, grown: bool = True
) -> FloatArray:
    """Return the covariance of the sum over all instants and records, in its unit squared, shape (c, c).

    Parzen's kernel is the triangle's with itself: its weighted sum over lags is the sum of squares of
    the series after two moving sums, which is never negative and costs the same for every bandwidth, whatever
    the length of the record.

    Parameters
    ----------
    series : sequence of array or callable
        One a record: its influence, shape (n, c), or what yields it in parts from the first instant on.
    least : float
        Instants, the least bandwidth.
    grown : bool
        Whether the bandwidth may grow (`scores_bandwidth`).
    """
    return long_run(series, least=least, grown=grown).covariances[0]


class LongRun(NamedTuple):
    """Covariances of a sum, (c, c) each, one for each of some quantiles, and their bandwidth in instants."""

    covariances: list[FloatArray]
    bandwidth: float


def long_run(
    series: Sequence[Series | FloatArray],
    quantiles: Sequence[float] = (USUAL,),
    least: float = 1.0,
    grown: bool = True,
) -> LongRun:
    """Return `long_run_covariance`, in its unit, (c, c), for each of some quantiles, from the same sums.

    They are normal quantiles, 1.96 or more, that are to hold where few instants tell a variance.
    """
    series = [KeptOnce(one) if callable(one) and not isinstance(one, KeptOnce) else one for one in series]
    bandwidth = max(least, scores_bandwidth(series, grown))
    sums = [ParzenSums(bandwidth) for _ in series]
    for one, parzen in zip(series, sums, strict=True):
        for psi in in_parts(one, least=2 * parzen.width):
            parzen.add(psi)
    n, found = sum(one.n for one in sums), [one.result() for one in sums]
    covariances = [joined_covariance(found, bandwidth, n, quantile) for quantile in quantiles]
    return LongRun(covariances, bandwidth)


class ParzenSums:
    """The sum over lags l of Parzen's kernel times psi_t psi_(t+l)^T, of an influence in parts."""

    def __init__(self, bandwidth: float) -> None:
        self.width = window_width(bandwidth)
        self._root = float(np.sqrt(window_power(self.width)))
        self._tails: list[FloatArray] = []
        self._total = np.zeros(1)
        # neighbours within half a window say the same
        self._kept = EveryFew(max(1, self.width // 2))
        self.n = 0

    def add(self, psi: FloatArray) -> None:
        """Take in the next instants, in any unit, shape (n, c)."""
        if not self._tails:  # before the record there is nothing
            self._tails = [np.zeros((self.width - 1, psi.shape[1]), order="F") for _ in range(2)]
        self.n += len(psi)
        self._add(psi)

    def _add(self, psi: FloatArray) -> None:
        for place, tail in enumerate(self._tails):
            joined = np.concatenate([tail, psi])
            self._tails[place] = joined[len(joined) - len(tail) :]
            psi = moving_sum(joined, self.width)
        psi = psi / self._root
        self._total = self._total + psi.T @ psi
        self._kept.add(psi)

    def result(self) -> KernelSums:
        """Return the sums over what was taken in; to be called once."""
        # the moving sums that begin within the record and end behind it
        self._add(np.zeros((2 * (self.width - 1), self._tails[0].shape[1])))
        return KernelSums(self._total, self._kept.result(), self._kept.stride)


def influence(fit: Fit) -> list[FloatArray]:
    """Return for every record what each instant contributes to X's error, in SI, shape (grid, c) each."""
    return [np.concatenate(list(parts())) for parts in influence_parts(fit)]


def influence_parts(fit: Fit) -> list[Series]:
    """Return the same as one function a record, which yields it in parts, again whenever called."""
    known = fit.series if fit.carried is None else fit.carried.series
    if known is not None:
        return [partial(_whole, psi) for psi in known]
    return [partial(_parts, fit, tuple(indices)) for indices in fit.by_record.values()]


def influence_of_stretches(
    fit: Fit, series: Sequence[FloatArray], decimation: Sequence[int], samples: Sequence[int], count: int
) -> list[FloatArray]:
    """Return the influence (SI) summed over so many equal stretches of each record, shape (count, c) each.

    Fits behind different filters and decimations can then be subtracted. `samples` are the lengths of the
    records; those that a fit holds nothing of give zeros.
    """
    found = [np.zeros((count, len(fit.columns))) for _ in samples]
    for record, psi in zip(fit.by_record, series, strict=True):
        first = next(block.start for block in fit.blocks if block.record == record)
        instants = first + decimation[record] * np.arange(len(psi))
        stretch = np.minimum(instants * count // samples[record], count - 1)
        for column, change in enumerate(psi.T):
            found[record][:, column] = np.bincount(stretch, change, minlength=count)
    return found


def _whole(psi: FloatArray) -> Iterator[FloatArray]:
    yield psi


def _parts(fit: Fit, indices: Sequence[int]) -> Iterator[FloatArray]:
    """Yield the influence of one record, whose blocks of the fit these are."""
    mix = None if fit.projected is None else fit.projected.mix
    weigh = fit.solution.inverse if mix is None else mix @ fit.solution.inverse
    grid = fit.blocks[indices[0]].grid
    step = max(1, PART // weigh.shape[1] // INSTANTS) * INSTANTS
    for start in range(0, grid, step):
        stop = min(start + step, grid)
        lines = np.zeros((len(weigh), stop - start))
        for index in indices:
            part, regressor, residual = fit.between(index, start, stop)
            change = regressor.samples.T * (fit.weights[index] ** 2 * residual)
            places = range(len(lines)) if regressor.places is None else regressor.places.tolist()
            # where nothing is masked the places follow each other
            at = slice(None) if len(part.place) == stop - start else part.place - start
            for place, more in zip(places, change, strict=True):
                lines[place, at] += more
        # sums over time run along lines
        yield (weigh.T @ lines).T
