"""What an estimator can determine with instruments of a given noise: covariance and bias, no random numbers.

The rows Y = W x hold for the noise-free record. Every instrument adds white noise, which filters and
differences turn into coloured noise of W and Y with known correlations. From these follow

- the covariance of the estimate: the noise of the residual Y - W x seen through the columns of W (the
  adjoint of filters and differences takes each weighted column back to the raw samples), and for least
  squares also the noise of W times that of the residual (fourth moments of Gaussian noise);
- the bias of least squares, which comes from noise in W: (W'W + E[dW'dW])^-1 E[dW'(dY - dW x)]. Instrumental
  variables have none;
- the error that is left without any noise: reversals are seen up to a sample early or late, and a decimated
  record has W'(Y - W x) of its own. It is small, and yet may exceed the noise's part in frictions.

What is neglected: noise in signs of velocities and other nonlinear features, and the choice of the filter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.record_length import end_samples
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import Model, Terms
from modelgen.runtime.planning.thresholds import BEYOND
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.row_block import RowBlock

# coefficients of one row's residual or column: (channel, derivative) -> coefficient
Linear = dict[tuple[str, int], float]


@dataclass(frozen=True, eq=False)
class Information:
    """Covariance and bias of the base parameters, shape (columns, columns) and (columns,).

    `matrix` is W'W of the weighted noise-free rows, of which the condition number (columns of unit length)
    and the D-criterion are taken.
    """

    columns: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    bias: FloatArray
    matrix: FloatArray

    @property
    def condition_number(self) -> float:
        """Condition number of the weighted observation matrix with columns of unit length."""
        scale = np.sqrt(np.diag(self.matrix))
        return float(np.sqrt(np.linalg.cond(self.matrix / np.outer(scale, scale))))


def information(
    model: Model,
    parameters: Mapping[str, float],
    records: Sequence[Record],
    noise: Mapping[str, float],
    choice: FilterChoice,
    weights: Mapping[tuple[int, int], float],
    *,
    instruments: bool,
) -> Information:
    """Return what noise-free records determine once their instruments have this noise.

    Parameters
    ----------
    model, parameters
        The model and its true physical parameters.
    records : sequence of Record
        Without noise.
    noise : mapping of str to float
        Standard deviation (SI) of every channel; resolution counts as step / sqrt(12).
    choice : FilterChoice
        The estimator's filter.
    weights : mapping of (record, row) to float
        The estimator's weights; rows that are absent are not used.
    instruments : bool
        Whether the estimator uses noise-free instruments (iv), or W itself (wls).

    Raises
    ------
    IdentifiabilityError
        When the rows do not determine all base parameters.
    """
    x = np.asarray(model.base_from_physical(parameters), dtype=float)
    observation = observe(model, records, choice, turns=not instruments).dense()
    blocks = [b for b in observation.blocks if b.place.size and (b.record, b.row) in weights]
    c = len(x)
    M, spread, total = np.zeros((c, c)), np.zeros((c, c)), np.zeros(c)
    for block in blocks:
        weight = weights[block.record, block.row] ** 2
        M += weight * block.W.T @ block.W
        total += weight * block.W.T @ (block.Y - block.W @ x)
    scale = np.sqrt(np.diag(M))
    if not scale.all() or np.linalg.cond(M / np.outer(scale, scale)) > 1e18:
        remedy = "sense more, or excite more"
        raise IdentifiabilityError.at("rows", "do not determine all base parameters", remedy)
    by_record: dict[int, list[RowBlock]] = {}
    for block in blocks:
        by_record.setdefault(block.record, []).append(block)
    parts = [
        _RecordNoise(model, records[i], choice, choice.decimation[i], own, noise, weights)
        for i, own in by_record.items()
    ]
    if not instruments:
        extra = sum((part.noise_matrix() for part in parts), np.zeros((c, c)))
        for part in parts:
            total += part.pull(x)
        biased = M + extra
        bias = np.asarray(np.linalg.solve(biased, total), dtype=float)
        inverse = np.asarray(np.linalg.inv(biased), dtype=float)
        for part in parts:
            spread += part.linear_spread(x + bias, -bias) + part.product_spread(x + bias)
    else:
        inverse = np.asarray(np.linalg.inv(M), dtype=float)
        bias = inverse @ total
        for part in parts:
            spread += part.linear_spread(x, np.zeros(c))
    return Information(model.base_parameters, x, inverse @ spread @ inverse.T, bias, M)


class _RecordNoise:
    """The instruments' noise in the rows of one record."""

    def __init__(
        self,
        model: Model,
        record: Record,
        choice: FilterChoice,
        factor: int,
        blocks: Sequence[RowBlock],
        noise: Mapping[str, float],
        weights: Mapping[tuple[int, int], float],
    ) -> None:
        self._model, self._record, self._choice, self._factor = model, record, choice, factor
        self._blocks, self._noise = blocks, {key: std for key, std in noise.items() if std > 0.0}
        self._weights = [weights[block.record, block.row] ** 2 for block in blocks]
        self._start = end_samples(model, choice.filter_order, choice.cutoff_hz, record.fs)
        self._left = [self._linear(model.measurement_columns[block.row]) for block in blocks]
        self._columns = [
            [self._linear(model.column_terms(block.row, j)) for j in range(len(model.base_parameters))]
            for block in blocks
        ]
        self._correlations: dict[tuple[int, int], FloatArray] = {}
        self._responses: dict[int, FloatArray] = {}

    def _linear(self, terms: Terms) -> Linear:
        """Return what of a sum is linear in noisy channels."""
        signals = {signal.key: signal for signal in self._model.signals}
        found: Linear = {}
        for coefficient, key in terms:
            signal = signals.get(key)
            channel = None if signal is None else signal.sensor or signal.actuator
            if signal is not None and channel in self._noise:
                place = (str(channel), signal.derivative)
                found[place] = found.get(place, 0.0) + coefficient
        return found

    def _residual(self, block: int, x: FloatArray) -> Linear:
        """Return the noise of Y - W x."""
        found = dict(self._left[block])
        for j, column in enumerate(self._columns[block]):
            for place, coefficient in column.items():
                found[place] = found.get(place, 0.0) - coefficient * x[j]
        return found

    def linear_spread(self, x: FloatArray, offset: FloatArray) -> FloatArray:
        """Return the covariance of W'(dY - dW x) + dW' W offset: adjoint of filters and differences."""
        c, n = len(x), self._record.n
        back: dict[tuple[str, int], FloatArray] = {}
        for b, block in enumerate(self._blocks):
            at = self._start + self._factor * block.place
            own = block.W @ offset
            for place, coefficient in self._residual(b, x).items():
                series = back.setdefault(place, np.zeros((c, n)))
                series[:, at] += self._weights[b] * coefficient * block.W.T
            if offset.any():
                for j, column in enumerate(self._columns[b]):
                    for place, coefficient in column.items():
                        series = back.setdefault(place, np.zeros((c, n)))
                        series[j, at] += self._weights[b] * coefficient * own
        seen: dict[str, FloatArray] = {}
        for (channel, derivative), series in back.items():
            raw = np.array([self._adjoint(row, derivative) for row in series])
            seen[channel] = seen.get(channel, 0.0) + raw
        total = np.zeros((c, c))
        for channel, raw in seen.items():
            total += self._noise[channel] ** 2 * raw @ raw.T
        return total

    def _adjoint(self, series: FloatArray, derivative: int) -> FloatArray:
        """Return the adjoint of filter and differences: the filter is even, a difference is odd."""
        choice, fs = self._choice, self._record.fs
        moved = zero_phase(series, choice.filter_order, choice.cutoff_hz, fs)
        return (-1.0) ** derivative * differentiate(moved, self._record.dt, derivative)

    def noise_matrix(self) -> FloatArray:
        """Return E[dW'dW] of the weighted rows."""
        c = len(self._model.base_parameters)
        total = np.zeros((c, c))
        for b, block in enumerate(self._blocks):
            for i in range(c):
                for j in range(c):
                    value = self._covariance(self._columns[b][i], self._columns[b][j])[0]
                    total[i, j] += self._weights[b] * block.place.size * value
        return total

    def pull(self, x: FloatArray) -> FloatArray:
        """Return E[dW'(dY - dW x)] of the weighted rows."""
        c = len(x)
        total = np.zeros(c)
        for b, block in enumerate(self._blocks):
            residual = self._residual(b, x)
            for i in range(c):
                value = self._covariance(self._columns[b][i], residual)[0]
                total[i] += self._weights[b] * block.place.size * value
        return total

    def product_spread(self, x: FloatArray) -> FloatArray:
        """Return the covariance of dW'(dY - dW x): products of Gaussian noise, Isserlis' theorem."""
        c = len(x)
        total = np.zeros((c, c))
        residuals = [self._residual(b, x) for b in range(len(self._blocks))]
        for b, block in enumerate(self._blocks):
            for d, other in enumerate(self._blocks):
                pairs = self._pairs(block, other)
                weight = self._weights[b] * self._weights[d]
                rr = self._covariance(residuals[b], residuals[d])
                to_residual = [self._covariance(column, residuals[d]) for column in self._columns[b]]
                from_residual = [self._covariance(residuals[b], column) for column in self._columns[d]]
                for i in range(c):
                    for j in range(c):
                        ij = self._covariance(self._columns[b][i], self._columns[d][j])
                        total[i, j] += weight * pairs @ (ij * rr + to_residual[i] * from_residual[j])
        return total

    def _pairs(self, block: RowBlock, other: RowBlock) -> FloatArray:
        """Return how many pairs of used samples are so many kept samples apart, in the order of the lags."""
        used = np.zeros((2, block.grid))
        used[0, block.place], used[1, other.place] = 1.0, 1.0
        size = 2 * block.grid
        counts = np.fft.irfft(np.fft.rfft(used[0], size) * np.conj(np.fft.rfft(used[1], size)), size)
        lags = self._lags()
        inside = np.abs(lags) < block.grid
        return np.asarray(np.round(np.where(inside, counts[lags % size], 0.0)), dtype=float)

    def _lags(self) -> IntArray:
        """Return all lags in kept samples over which the filtered noise is correlated, 0 first."""
        reach = 2 * self._start // self._factor + 1
        return np.concatenate([np.arange(reach + 1), np.arange(-reach, 0)])

    def _covariance(self, first: Linear, second: Linear) -> FloatArray:
        """Return E[first(t + lag) second(t)] at all lags."""
        total = np.zeros(self._lags().size)
        for (channel, d), a in first.items():
            for (other, e), b in second.items():
                if channel == other:
                    total += self._noise[channel] ** 2 * a * b * self._correlation(d, e)
        return total

    def _correlation(self, d: int, e: int) -> FloatArray:
        """Return sum_s h_d(s + lag) h_e(s): correlation of two derivatives of filtered white noise."""
        if (d, e) not in self._correlations:
            h, g = self._response(d), self._response(e)
            size = 4 * h.size
            both = np.fft.irfft(np.fft.rfft(h, size) * np.conj(np.fft.rfft(g, size)), size)
            lags = self._lags() * self._factor
            inside = np.abs(lags) < 2 * h.size
            self._correlations[d, e] = np.where(inside, both[lags % size], 0.0)
        return self._correlations[d, e]

    def _response(self, derivative: int) -> FloatArray:
        if derivative not in self._responses:
            half = self._start + BEYOND
            impulse = np.zeros(2 * half + 1)
            impulse[half] = 1.0
            choice, fs = self._choice, self._record.fs
            smooth = zero_phase(impulse, choice.filter_order, choice.cutoff_hz, fs)
            self._responses[derivative] = differentiate(smooth, self._record.dt, derivative)
        return self._responses[derivative]
