"""Whether residuals show more than noise: whiteness, correlation with past inputs, what every period repeats.

The first two are what MATLAB's `resid` draws, with bounds that hold for coloured residuals; the third asks
the most of periodic records: noise differs from period to period, what the model lacks does not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.lagged_noise import LaggedNoise, lagged_noise
from modelgen.runtime.diagnostics.residual_whiteness import coloured, opened_bound, whiteness
from modelgen.runtime.diagnostics.row_noise import block_noise, row_noise
from modelgen.runtime.diagnostics.thresholds import (
    CONFIDENCE,
    INPUT_LAGS,
    LARGEST_NOISE,
    LEAST_EXPLAINED,
    LEAST_REPEATED,
    LEFT_OF_NOISE,
    MOST_SAMPLES,
    MOSTLY_ROUNDED,
    SMALLEST_ERROR,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.power_spectrum import quick_length, square
from modelgen.runtime.least_squares.fit import Fit, FittedStretch
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.tails import normal_beyond
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.thresholds import FEWEST_PERIODS
from modelgen.runtime.rows.row_block import STRETCH


@dataclass(frozen=True)
class Correlation:
    """How the residual follows the past of one column times its parameter, at the lag where it does so most.

    `value` is the correlation (-1 to 1) less what noise in both makes of it, `bound` what noise alone reaches
    in 1 % of all estimates.
    """

    column: str
    lag_s: float
    value: float
    bound: float

    @property
    def significant(self) -> bool:
        """Whether it is more than noise, and large enough to matter."""
        return abs(self.value) > self.bound and abs(self.value) > math.sqrt(LEAST_EXPLAINED)


@dataclass(frozen=True)
class ResidualTest:
    """What the residual of one row on one record shows; None where there was too little to test.

    `whiteness` is the statistic on the residual freed of the filter's colour, `whiteness_bound` its bound of
    99 %; `correlation` that with past inputs; `repeated` the share of power that comes back in every period.
    """

    record: str
    row: str
    whiteness: float | None
    whiteness_bound: float | None
    correlation: Correlation | None
    repeated: float | None

    @property
    def is_white(self) -> bool:
        """Whether white noise of the sensors explains the residual's colour, as far as was tested."""
        return (
            self.whiteness is None or self.whiteness_bound is None or self.whiteness <= self.whiteness_bound
        )

    @property
    def is_noise(self) -> bool:
        """Whether no test shows more than noise."""
        correlated = self.correlation is not None and self.correlation.significant
        return self.is_white and not correlated and not self.repeats

    @property
    def repeats(self) -> bool:
        """Whether a part of the residual that matters comes back in every period."""
        return self.repeated is not None and self.repeated > LEAST_REPEATED


def residual_tests(
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    fit: Fit,
    period_s: Mapping[str, float],
    freed: bool = False,
) -> tuple[ResidualTest, ...]:
    """Test the residual of every row on every record; `period_s` names the periodic records' periods in s.

    The parameters of a fit that is `freed` are those of least squares without what noise does to them: what
    they leave follows noise in the past of the columns, too.
    """
    x = fit.all_parameters(model.base_parameters)
    found = []
    for index, block in enumerate(fit.blocks):
        record = records[block.record]
        step_s = choice.decimation[block.record] / record.fs
        colour = None
        run = fit.fitted(index, block.longest_run(MOST_SAMPLES))
        if freed:
            run = run._replace(residual=run.part.Y - run.part.W @ block.own(fit.solution.x))
        # noise in rows of power is that of forces times speeds: it has no colour of its own
        left = fit.residual_norms[index] > SMALLEST_ERROR * block.terms_norm(fit.solution.x)
        if left and not model.by_power:
            colour = coloured(model, record, block, run.residual, x, choice)
        white, bound = whiteness(colour, len(fit.blocks)) if colour else (None, None)
        if colour and bound and white and white > bound and block.opening is not None:
            bound = opened_bound(colour, block.opening, run.part, bound)
        if white and bound and white > bound and _is_rounding(model, record, choice, fit, index):
            white, bound = None, None
        correlation = None
        if colour:
            lags = min(INPUT_LAGS, len(run.residual) // 4)
            by_noise = LaggedNoise(np.zeros((len(fit.columns), lags)), 0.0)
            if freed:
                rms = float(np.std(run.residual))
                by_noise = lagged_noise(model, records, choice, fit, index, lags, rms)
            correlation = _correlation(fit, index, run, step_s, by_noise)
        repeated = None
        if colour and record.name in period_s:
            series = _on_the_grid(fit, index)
            repeated = repeated_share(series, block.grid, period_s[record.name] / step_s)
        found.append(ResidualTest(block.record_name, block.row_name, white, bound, correlation, repeated))
    return tuple(found)


def _is_rounding(model: Model, record: Record, choice: FilterChoice, fit: Fit, index: int) -> bool:
    """Return whether what a row leaves is what encoders round: of slow motion lines and bursts."""
    block, x = fit.blocks[index], fit.all_parameters(model.base_parameters)
    white = row_noise(model, record, choice, choice.decimation[block.record], block.row, x)
    rounded = block_noise(fit, index, model, record, choice, rounded=True)
    return rounded > MOSTLY_ROUNDED * white and fit.rms(index) < LARGEST_NOISE * rounded


def _on_the_grid(fit: Fit, index: int) -> Iterator[FloatArray]:
    """Yield the residual of a block at all points of its grid, in stretches; NaN where a sample is masked."""
    grid = fit.blocks[index].grid
    for start in range(0, grid, STRETCH):
        part, _, residual = fit.between(index, start, start + STRETCH)
        series = np.full(min(STRETCH, grid - start), np.nan)
        series[part.place - start] = residual
        yield series


def repeated_share(series: Iterable[FloatArray], n: int, period: float) -> float | None:
    """Return the share of a series' power that is the same in every period, 0 to 1.

    Parameters
    ----------
    series : iterable of array
        Its n samples in stretches, shape (k,) each; NaN where there is none.
    n : int
    period : float
        In samples. Where it is no integer, the smallest multiple that is one takes its place.

    Returns
    -------
    float or None
        None where fewer than four such periods are left.
    """
    multiple = next((k for k in range(1, 13) if abs(k * period - round(k * period)) < 1e-6 * k * period), 0)
    length = round(multiple * period)
    if length == 0 or n // length < FEWEST_PERIODS:
        return None
    count, first = n // length, 0
    # of each sample of the period; a NaN stays one
    sums, squares = np.zeros(length), np.zeros(length)
    for part in series:
        inside = part[: max(count * length - first, 0)]
        at = (first + np.arange(len(inside))) % length
        sums += np.bincount(at, inside, length)
        squares += np.bincount(at, inside**2, length)
        first += len(part)
    whole = np.isfinite(sums)
    if not whole.any():
        return None
    mean = sums[whole] / count
    noise = float(np.mean(squares[whole] / count - mean**2)) * count / (count - 1)
    total = float(np.mean(squares[whole])) / count - float(mean.mean()) ** 2
    # of noise alone the mean over the periods keeps 1 / count
    return max(0.0, (float(np.var(mean)) - noise / count) / total) if total > 0.0 else None


def residual_advice(tests: Sequence[ResidualTest]) -> tuple[Advice, ...]:
    """Return one advice for each row whose residual shows more than noise, with its remedy."""
    found = []
    for test in tests:
        if test.is_noise:
            continue
        seen = []
        if not test.is_white:
            seen.append(
                f"is not filtered noise of the sensors (whiteness {test.whiteness:.0f}, 99 % bound "
                f"{test.whiteness_bound:.0f})"
            )
        if test.correlation is not None and test.correlation.significant:
            one = test.correlation
            seen.append(
                f"follows {one.column}'s term of {1e3 * one.lag_s:.3g} ms before (correlation "
                f"{one.value:.2f}, bound {one.bound:.2f})"
            )
        if test.repeats and test.repeated is not None:
            seen.append(f"repeats in every period ({100.0 * test.repeated:.0f} % of its power)")
        found.append(
            Advice(
                "more than noise",
                f"{test.record}, row {test.row}: the residual",
                " and ".join(seen),
                "the model lacks something: the intervals are wider for the residual's colour (Newey-West) "
                "and for what other cut-offs change; compare records and sensor sets, too",
            )
        )
    return tuple(found)


def _correlation(
    fit: Fit, index: int, run: FittedStretch, step_s: float, by_noise: LaggedNoise
) -> Correlation | None:
    """Return the largest correlation, against its bound, of a stretch of a residual with past inputs."""
    e = run.residual - run.residual.mean()
    touched = fit.touched(index)
    n = len(e)
    lags = by_noise.products.shape[1]
    size = quick_length(2 * n)
    E = np.fft.rfft(e, size)
    density = _smooth(square(E))
    count = len(fit.blocks) * lags * len(fit.columns)
    quantile = normal_beyond(0.5 * (1.0 - CONFIDENCE) / count)
    best: tuple[float, Correlation] | None = None
    inputs = run.regressor.chosen(touched) * fit.solution.x[touched]
    least = 1e-9 * max(float(inputs.max()), -float(inputs.min()))
    for column, u in zip(touched.tolist(), inputs.T, strict=True):
        name, u = fit.columns[column], u - u.mean()
        power = float(e @ e) * float(u @ u)
        if power <= 0.0 or np.ptp(u) < least:
            continue
        U = np.fft.rfft(u, size)
        products = np.fft.irfft(E * np.conj(U), size)[1 : lags + 1] / np.sqrt(power)
        # sum of R_e(k) R_u(k): the variance of a sum of products of two coloured series
        powers = density * square(U)
        both = (2.0 * powers.sum() - powers[0] - (powers[-1] if size % 2 == 0 else 0.0)) / size
        expected = n * fit.solution.x[column] * by_noise.products[column] / np.sqrt(power)
        bounds = quantile * float(np.sqrt(both / n / power)) + by_noise.squared
        bounds = bounds + LEFT_OF_NOISE * np.abs(expected)
        ratios = np.abs(products - expected) / bounds
        lag = int(np.argmax(ratios))
        if best is None or ratios[lag] > best[0]:
            value = float(products[lag] - expected[lag])
            best = float(ratios[lag]), Correlation(name, (lag + 1) * step_s, value, float(bounds[lag]))
    return best[1] if best else None


def _smooth(power: FloatArray) -> FloatArray:
    """Return the moving average of a periodogram over about the root of its length."""
    width = 2 * int(np.sqrt(len(power)) / 2.0) + 1
    total = np.concatenate([[0.0], np.cumsum(np.pad(power, width // 2, mode="reflect"))])
    return np.asarray((total[width:] - total[:-width]) / width)
