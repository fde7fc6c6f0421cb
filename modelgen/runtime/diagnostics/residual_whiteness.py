"""Is a residual no more than noise of the sensors? Whiteness, once the filter's colour is taken out.

A residual behind filter and differentiation is never white. But if the model is right, all that is left in a
row is noise of the channels, filtered and differentiated as the row does it: with white noises the shape of
its spectrum is known up to their levels. These are fitted to the periodogram (Whittle 1953), the periodogram
is divided by the fit, and what remains must be that of white noise: uncorrelated, as Box and Pierce (1970)
test it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.diagnostics.noise_ways import NoiseWays, noise_ways
from modelgen.runtime.diagnostics.thresholds import (
    BOUND_DEVIATIONS,
    CONFIDENCE,
    DRAWS,
    FEWEST_LINES,
    LEAST_POWER,
    MOST_BANDS,
    WHITENESS_HALVINGS,
    WHITENESS_LAGS,
    WHITENESS_ROUNDS,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import gain
from modelgen.runtime.filters.power_spectrum import hann, square
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.nonnegative import nonnegative
from modelgen.runtime.numerics.tails import chi_square_beyond
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_block import RowBlock, Stretch

# Lines two apart are independent behind this window.
LINES = slice(2, None, 2)


@dataclass(frozen=True, eq=False)
class Coloured:
    """A stretch of a block's residual: its periodogram and the spectrum that noise of the sensors fits to it.

    `frequency_hz`, `power` and `noise` share a shape, of the lines that are `inside`; `shapes`, (frequencies,
    channels), are the spectra of white noise in each channel, `rate` is in Hz.
    """

    frequency_hz: FloatArray
    power: FloatArray
    noise: FloatArray
    shapes: FloatArray
    inside: BoolArray
    rate: float

    def of(self, series: FloatArray) -> Coloured:
        """Return the same of another series in its place, shape (n,), in the row's unit."""
        power = _periodogram(series)[self.inside]
        return replace(self, power=power, noise=likely_spectrum(self.shapes, power))

    def drawn(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return noise of that spectrum, shape (count,), in the row's unit to within a factor."""
        every = np.fft.rfftfreq(count, 1.0 / self.rate)
        size = np.sqrt(np.interp(every, self.frequency_hz, self.noise))
        parts = rng.standard_normal((2, len(every)))
        return np.asarray(np.fft.irfft(size * (parts[0] + 1j * parts[1]), count))

    @property
    def whitened(self) -> FloatArray:
        """The periodogram over the fitted spectrum, shape (frequencies,), with a mean of 1."""
        ratio = self.power / self.noise
        return np.asarray(ratio / ratio.mean())


def coloured(
    model: Model, record: Record, block: RowBlock, residual: FloatArray, x: FloatArray, choice: FilterChoice
) -> Coloured | None:
    """Fit the noise of the channels to a residual's spectrum; None where there is too little of it.

    Parameters
    ----------
    record : Record
        That of the block.
    block : RowBlock
        The block of the residual.
    residual : array, shape (n,)
        Of a stretch without a gap, in the row's unit.
    x : array, shape (columns,)
        All base parameters in SI, in the model's order, zero for those not in the fit.
    """
    n = len(residual)
    factor = choice.decimation[block.record]
    rate = record.fs / factor
    frequency_hz = np.asarray(np.fft.rfftfreq(n, 1.0 / rate)[LINES], dtype=float)
    power = _periodogram(residual)
    ways = noise_ways(model, record, choice, factor)[block.row].of_residual(x)
    shapes = _shapes(ways, model.rows[block.row].differentiated, choice, frequency_hz, rate, record.fs)
    inside = shapes.max(axis=1) > LEAST_POWER * shapes.max() if shapes.size else np.zeros(0, dtype=bool)
    if inside.sum() < FEWEST_LINES or not np.any(power[inside] > 0.0):
        return None
    noise = likely_spectrum(shapes[inside], power[inside])
    return Coloured(frequency_hz[inside], power[inside], noise, shapes[inside], inside, rate)


def opened_bound(
    found: Coloured, opening: Callable[[Stretch], Stretch], part: Stretch, bound: float
) -> float:
    """Return the bound of `whiteness` where rows leave forces open: what is left of noise has another colour.

    Along directions in which nothing is left of rows nothing is left of noise, which is then no longer as
    even: the bound grows as the statistic of noise drawn from the fitted spectrum does, on average and most.
    """
    rng, count, found_again = np.random.default_rng(0), len(part.place), []
    for _ in range(DRAWS):
        drawn = part._replace(Y=found.drawn(count, rng), W=np.zeros((count, 0)))
        found_again.append(whiteness(found.of(opening(drawn).Y))[0])
    lags = min(WHITENESS_LAGS, len(found.power) // 4)
    return max(bound, bound * float(np.mean(found_again)) / lags, max(found_again))


def largest_density(
    model: Model,
    record: Record,
    block: RowBlock,
    residuals: Sequence[FloatArray],
    x: FloatArray,
    choice: FilterChoice,
    channel: str,
) -> float:
    """Return how dense white noise of a channel is at most, in its unit^2/Hz, for what a row leaves.

    A row leaves no less than that noise in any band. Where the row does not hold the channel, or stretches
    are short, that is no bound. The other parameters are those of `coloured`.

    Parameters
    ----------
    residuals : sequence of array
        Of stretches without a gap, shape (n,) each, in the row's unit.
    x : array, shape (columns,)
        All base parameters in SI, in the model's order, zero for those not in the fit.
    """
    factor = choice.decimation[block.record]
    rate, row = record.fs / factor, model.rows[block.row]
    ways = noise_ways(model, record, choice, factor)[block.row].of_residual(x)
    long = [one for one in residuals if len(one) >= FEWEST_LINES]
    if channel not in ways.slopes or not long:
        return inf
    ways = replace(ways, slopes={channel: ways.slopes[channel]})
    each = [np.asarray(np.fft.rfftfreq(len(one), 1.0 / rate)[LINES], dtype=float) for one in long]
    frequency_hz = np.concatenate(each)
    shape = _shapes(ways, row.differentiated, choice, frequency_hz, rate, record.fs)[:, 0]
    scales = [2.0 / (rate * float(np.sum(hann(len(one)) ** 2))) for one in long]
    left = np.concatenate([scale * _periodogram(one) for scale, one in zip(scales, long, strict=True)])
    order = np.argsort(frequency_hz, kind="stable")
    order = order[shape[order] > LEAST_POWER * shape.max()]
    bands = min(MOST_BANDS, len(order) // FEWEST_LINES)
    # of m lines the mean is known to 1 / sqrt(m)
    bounds = [
        float(left[band].mean() / shape[band].mean()) * (1.0 + BOUND_DEVIATIONS / sqrt(len(band)))
        for band in np.array_split(order, max(bands, 1))
    ]
    return min(bounds) if bands else inf


def _periodogram(series: FloatArray) -> FloatArray:
    """Return the power of a series at `LINES`, shape (frequencies,), in its unit squared."""
    e = series - series.mean()
    return square(np.fft.rfft(e * hann(len(e)))[LINES])


def whiteness(found: Coloured, tests: int = 1) -> tuple[float, float]:
    """Return the statistic of Box and Pierce on the whitened lines, and its bound.

    The autocorrelations are those of a white series with these lines as its whole periodogram; m lines give
    each of them the variance 1 / (2 m). With a right model all of so many `tests` stay below the bound in 99
    %.
    """
    lines = found.whitened
    m = len(lines)
    lags = min(WHITENESS_LAGS, m // 4)
    # cosines of multiples of an angle, as Chebyshev's polynomials follow from each other
    cosine = np.cos(np.pi * (np.arange(m) + 0.5) / m)
    before, now, correlation = np.ones(m), cosine, np.empty(lags)
    for lag in range(lags):
        correlation[lag] = now @ lines / m
        before, now = now, 2.0 * cosine * now - before
    return float(2.0 * m * np.sum(correlation**2)), chi_square_beyond((1.0 - CONFIDENCE) / tests, lags)


def _shapes(
    ways: NoiseWays,
    differentiated: int,
    choice: FilterChoice,
    frequency_hz: FloatArray,
    rate: float,
    fs: float,
) -> FloatArray:
    """Return the spectrum that white noise of each channel gives the row, shape (frequencies, channels).

    A white force in the row comes last. What lies above half the decimated rate is folded back.
    """
    folds = range(int(np.ceil(0.5 * fs / rate)) + 1)
    shapes = np.zeros((len(frequency_hz), len(ways.slopes) + 1))
    for fold in folds:
        for sign in (1.0, -1.0):
            at = fold * rate + sign * frequency_hz
            valid = (at > 0.0) & (at <= 0.5 * fs)
            if not valid.any():
                continue
            force = (2.0 * np.pi * at[valid]) ** (2 * differentiated)
            power = np.column_stack([*(ways.spectrum(key, at[valid]) for key in ways.slopes), force])
            shapes[valid] += gain(at[valid], choice, 0, fs)[:, None] ** 2 * power
    return shapes[:, shapes.max(axis=0, initial=0.0) > 0.0]


def likely_spectrum(shapes: FloatArray, power: FloatArray) -> FloatArray:
    """Return the sum of shapes, none negative, that makes a periodogram most likely, shape (frequencies,).

    `shapes`, (frequencies, channels), in any unit, and `power`, (frequencies,), in its own, are as `Coloured`
    has them.
    Weighted least squares give the next levels (Fisher's scoring); where these make it less likely, as those
    of shapes that are nearly alike but for a dip take turns, a part of the way is gone.
    """
    scale, least = shapes.max(axis=0), 1e-12 * power.mean()

    def spectrum(levels: FloatArray) -> FloatArray:
        return np.asarray(np.maximum(shapes @ (levels / scale), least))

    levels, noise, before = np.zeros(len(scale)), np.full(len(power), power.mean()), np.inf
    for _ in range(WHITENESS_ROUNDS):
        step = nonnegative(shapes / scale / noise[:, None], power / noise) - levels
        for _ in range(WHITENESS_HALVINGS if np.isfinite(before) else 1):
            other = spectrum(levels + step)
            misfit = float(np.sum(np.log(other) + power / other))
            if misfit < before:
                break
            step *= 0.5
        else:
            break
        gained, before = before - misfit, misfit
        levels, noise = levels + step, other
        if gained < 1e-6:
            break
    return noise
