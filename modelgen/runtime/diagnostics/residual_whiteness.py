"""Is a residual no more than noise of the sensors? Whiteness, once the filter's colour is taken out.

A residual behind filter and differentiation is never white. But if the model is right, all that is left in a
row is noise of the channels, filtered and differentiated as the row does it: with white noises the shape of
its spectrum is known up to their levels. These are fitted to the periodogram (Whittle 1953), the periodogram
is divided by the fit, and what remains must be that of white noise: uncorrelated, as Box and Pierce (1970)
test it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.thresholds import (
    CONFIDENCE,
    FEWEST_LINES,
    LEAST_POWER,
    WHITENESS_LAGS,
    WHITENESS_ROUNDS,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import gain
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.nonnegative import nonnegative
from modelgen.runtime.numerics.tails import chi_square_beyond
from modelgen.runtime.rows.row_block import RowBlock


@dataclass(frozen=True, eq=False)
class Coloured:
    """A stretch of a block's residual: its periodogram and the spectrum that noise of the sensors fits to it.

    `frequency_hz`, `power` and `noise` share a shape.
    """

    frequency_hz: FloatArray
    power: FloatArray
    noise: FloatArray

    @property
    def whitened(self) -> FloatArray:
        """The periodogram over the fitted spectrum, shape (frequencies,), with a mean of 1."""
        ratio = self.power / self.noise
        return np.asarray(ratio / ratio.mean())


def coloured(
    model: Model, block: RowBlock, residual: FloatArray, x: FloatArray, choice: FilterChoice, fs: float
) -> Coloured | None:
    """Fit the noise of the channels to a residual's spectrum; None where there is too little of it.

    Parameters
    ----------
    block : RowBlock
        The block of the residual.
    residual : array, shape (n,)
        Of a stretch without a gap.
    x : array, shape (columns,)
        All base parameters in the model's order, zero for those not in the fit.
    fs : float
        Sampling frequency of the record in Hz.
    """
    e = residual - residual.mean()
    n = len(e)
    rate = fs / choice.decimation[block.record]
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / max(n, 1))
    # lines two apart are independent behind this window
    every = slice(2, None, 2)
    frequency_hz = np.asarray(np.fft.rfftfreq(n, 1.0 / rate)[every], dtype=float)
    power = np.abs(np.fft.rfft(e * window)[every]) ** 2
    shapes = _shapes(model, block.row, x, choice, frequency_hz, rate, fs)
    inside = shapes.max(axis=1) > LEAST_POWER * shapes.max() if shapes.size else np.zeros(0, dtype=bool)
    if inside.sum() < FEWEST_LINES or not np.any(power[inside] > 0.0):
        return None
    noise = _fitted(shapes[inside], power[inside])
    return Coloured(frequency_hz[inside], power[inside], noise)


def whiteness(found: Coloured, tests: int = 1) -> tuple[float, float]:
    """Return the statistic of Box and Pierce on the whitened lines, and its bound.

    The autocorrelations are those of a white series with these lines as its whole periodogram; m lines give
    each of them the variance 1 / (2 m). With a right model all of so many `tests` stay below the bound in 99
    %.
    """
    lines = found.whitened
    m = len(lines)
    lags = min(WHITENESS_LAGS, m // 4)
    place = (np.arange(m) + 0.5) / m
    correlation = np.cos(np.pi * np.outer(np.arange(1, lags + 1), place)) @ lines / m
    return float(2.0 * m * np.sum(correlation**2)), chi_square_beyond((1.0 - CONFIDENCE) / tests, lags)


def _shapes(
    model: Model,
    row: int,
    x: FloatArray,
    choice: FilterChoice,
    frequency_hz: FloatArray,
    rate: float,
    fs: float,
) -> FloatArray:
    """Return the spectrum that white noise of each channel gives the row, shape (frequencies, channels).

    What lies above half the decimated rate is folded back.
    """
    folds = range(int(np.ceil(0.5 * fs / rate)) + 1)
    # noise of the channels on their ways into the row, and a white force in it
    ways = [*channel_terms(model, row, x).values(), [(1.0, model.rows[row].differentiated)]]
    shapes = np.zeros((len(frequency_hz), len(ways)))
    for fold in folds:
        for sign in (1.0, -1.0):
            at = fold * rate + sign * frequency_hz
            valid = (at > 0.0) & (at <= 0.5 * fs)
            if not valid.any():
                continue
            low_pass = gain(at[valid], choice, 0, fs)
            for column, terms in enumerate(ways):
                shapes[valid, column] += (low_pass * np.abs(response(terms, at[valid]))) ** 2
    return shapes[:, shapes.max(axis=0, initial=0.0) > 0.0]


def channel_terms(
    model: Model, row: int, x: FloatArray, measured: bool = True
) -> dict[str, list[tuple[float, int]]]:
    """Return for every channel its way into Y - W x of a row, as pairs (weight, derivative).

    Without `measured` Y is left out. What is not linear in a channel (a direction of motion) does not count.
    """
    signals = {signal.key: signal for signal in model.signals}
    terms = list(model.measurement_columns[row]) if measured else []
    for column, entries in model.regressor_columns[row].items():
        if x[column]:
            terms += [(-float(x[column]) * coefficient, key) for coefficient, key in entries]
    found: dict[str, list[tuple[float, int]]] = {}
    for weight, key in terms:
        signal = signals.get(key)
        channel = signal and (signal.sensor or signal.actuator)
        if signal is not None and channel:
            found.setdefault(channel, []).append((weight, signal.derivative))
    return found


def response(terms: list[tuple[float, int]], frequency_hz: FloatArray) -> npt.NDArray[np.complex128]:
    """Return the sum of weight times (j omega)^derivative at frequencies in Hz, shape (n,)."""
    s = 2j * np.pi * frequency_hz
    return np.asarray(sum((weight * s**order for weight, order in terms), np.zeros(len(s), dtype=complex)))


def _fitted(shapes: FloatArray, power: FloatArray) -> FloatArray:
    """Return the sum of shapes, none negative, that fits a periodogram, by weighted least squares."""
    scale = shapes.max(axis=0)
    noise = np.full(len(power), power.mean())
    for _ in range(WHITENESS_ROUNDS):
        levels = nonnegative(shapes / scale / noise[:, None], power / noise)
        noise = np.maximum(shapes @ (levels / scale), 1e-12 * power.mean())
    return noise
