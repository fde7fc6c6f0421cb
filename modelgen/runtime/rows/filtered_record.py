"""FilteredRecord: one record's signals and features behind the common filter, at the samples kept."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import support_samples, zero_phase
from modelgen.runtime.model.model import Feature, Model, Signal, Terms
from modelgen.runtime.records.record import Record

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# The filter's reach: where its response has fallen to this share of its peak.
SUPPORT_TOLERANCE = 1e-5
# A standstill is seen on the low-passed velocity, this share of whose response reaches into it.
DIRECTION_TOLERANCE = 1e-2
# Rounding error of a filtered channel, relative to its largest reading; and the largest gain of a difference.
ROUNDING = 64.0 * float(np.finfo(float).eps)
DIFFERENCE_GAIN = 1.74


class FilteredRecord:
    """A record's signals and features behind the common filter, at the samples kept; each filtered once."""

    def __init__(self, model: Model, record: Record, choice: FilterChoice, factor: int, drop: int) -> None:
        self.record = record
        self.choice = choice
        self._signals = {signal.key: signal for signal in model.signals}
        self._features = {feature.key: feature for feature in model.features}
        self._smooth: dict[tuple[str, int], FloatArray] = {}
        self._kept: dict[str, FloatArray] = {}
        self._directions: dict[str, FloatArray] = {}
        self._deepest = max(signal.derivative for signal in model.signals)
        self.edge = max(self.reach(derivative) for derivative in range(self._deepest + 1))
        self.grid = self._grid(factor, drop, len(model.base_parameters))

    def reach(self, derivative: int) -> int:
        """Return the reach in samples of the filter followed by so many differentiations."""
        order, cutoff_hz = self.choice.filter_order, self.choice.cutoff_hz
        return support_samples(order, cutoff_hz, self.record.fs, derivative, SUPPORT_TOLERANCE)

    def direction_reach(self) -> int:
        """Return how late, in samples, the low-passed velocity may show a standstill."""
        order, cutoff_hz = self.choice.filter_order, self.choice.direction_cutoff_hz
        return support_samples(order, cutoff_hz, self.record.fs, 0, DIRECTION_TOLERANCE)

    def sum_of(self, terms: Terms) -> FloatArray:
        """Return a column or left-hand side at the samples kept, shape (grid,)."""
        total = np.zeros(len(self.grid))
        for coefficient, key in terms:
            total += coefficient * self.kept(key)
        return total

    def kept(self, key: str) -> FloatArray:
        """Return a signal, a feature or the constant "1" behind the filter, at the samples kept."""
        if key == "1":
            return np.ones(len(self.grid))
        if key not in self._kept:
            if key in self._features:
                full = self._low_pass(self._feature(self._features[key]))
            else:
                signal = self._signals[key]
                full = self.smooth(_channel(signal), signal.derivative)
            self._kept[key] = full[self.grid]
        return self._kept[key]

    def smooth(self, channel: str, derivative: int) -> FloatArray:
        """Return a filtered channel's derivative at the full rate, shape (n,)."""
        if (channel, derivative) not in self._smooth:
            if derivative == 0:
                found = self._low_pass(self.record.signals[channel])
            else:
                found = differentiate(self.smooth(channel, derivative - 1), self.record.dt)
            self._smooth[channel, derivative] = self._without_rounding(found, channel, derivative)
        return self._smooth[channel, derivative]

    def direction(self, key: str) -> FloatArray:
        """Return the signal whose sign is a direction of motion, shape (n,): behind the direction cut-off.

        A direction that the record itself brings is taken as it is.
        """
        signal = self._signals[key]
        raw = self.record.signals[_channel(signal)]
        if signal.sensor is None and signal.actuator is None:
            return raw
        if key not in self._directions:
            order, cutoff_hz = self.choice.filter_order, self.choice.direction_cutoff_hz
            smooth = zero_phase(raw, order, cutoff_hz, self.record.fs)
            velocity = differentiate(smooth, self.record.dt, signal.derivative)
            self._directions[key] = self._without_rounding(velocity, _channel(signal), signal.derivative)
        return self._directions[key]

    def _without_rounding(self, samples: FloatArray, channel: str, derivative: int) -> FloatArray:
        """Return zeros for a derivative that is nothing but the rounding error of its channel."""
        largest = float(np.max(np.abs(self.record.signals[channel])))
        rounding = ROUNDING * largest * (DIFFERENCE_GAIN * self.record.fs) ** derivative
        return samples if float(np.max(np.abs(samples))) > rounding else np.zeros_like(samples)

    def _low_pass(self, samples: FloatArray) -> FloatArray:
        return zero_phase(samples, self.choice.filter_order, self.choice.cutoff_hz, self.record.fs)

    def _raw(self, key: str) -> FloatArray:
        signal = self._signals[key]
        return differentiate(self.record.signals[_channel(signal)], self.record.dt, signal.derivative)

    def _feature(self, feature: Feature) -> FloatArray:
        """Return a feature at the full rate, formed from unfiltered signals (it is filtered afterwards)."""
        factor = self._raw(feature.times) if feature.times is not None else 1.0
        if not isinstance(feature.of, str):
            total = np.zeros(self.record.n)
            for coefficient, key in feature.of:
                total += coefficient * self._raw(key)
            return np.asarray(total**3 * factor)
        velocity = self.direction(feature.of)
        value = {
            "sign": np.sign(velocity),
            "forward": (velocity > 0.0).astype(float),
            "backward": (velocity < 0.0).astype(float),
        }[feature.function]
        return np.asarray(value * factor)

    def _grid(self, factor: int, drop: int, columns: int) -> IntArray:
        record = self.record
        start = max(self.edge, drop)
        needed = start + self.edge + factor * (columns + 1)
        if record.n < needed:
            raise DataError.at(
                record.name,
                f"has {record.n} samples; a filter of {self.choice.cutoff_hz:.4g} Hz needs at least {needed}",
                "give a longer record, or a higher cutoff_hz",
            )
        return np.arange(start, record.n - self.edge, factor, dtype=np.int64)


def _channel(signal: Signal) -> str:
    """Return the record's channel that a signal derives from."""
    return signal.sensor or signal.actuator or signal.key
