"""SignalPlan: the operators that take the channels of a record to the signals and features of a model.

Each channel is filtered once, all its derivatives together; only features are filtered as signals of their
own, because they are formed at the full rate from what is not linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Protocol

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.magnitudes import LARGEST
from modelgen.runtime.filter_choice.record_length import deepest_derivative
from modelgen.runtime.filters.block_numba import LoopBlocks
from modelgen.runtime.filters.block_numpy import largest
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.fused_operator import FusedOperator, fused_operator
from modelgen.runtime.filters.two_sided_kernel import Sections, squared_gain
from modelgen.runtime.model.given_directions import WAYS, sign_between
from modelgen.runtime.model.model import Feature, Model
from modelgen.runtime.rows.filter_sections import Filtering
from modelgen.runtime.rows.kernel_lines import KernelLines, kernel_lines
from modelgen.runtime.rows.speed_filter import SpeedFilter, speed_filter
from modelgen.runtime.rows.thresholds import DIFFERENCE_MARGIN, ROUNDING

# A few samples already tell that a derivative is more than rounding error.
FEW = 101


class PaddedStretch(Protocol):
    """A stretch of a record, in SI, and what lies around it, continued beyond the ends of the record."""

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a channel, shape (stop - start,)."""

    def not_finite(self, channel: str, start: int, stop: int) -> DataError:
        """Return the error that names the sample of a channel that is not finite."""

    def direction(self, key: str, start: int, stop: int) -> FloatArray:
        """Return samples start to stop of a velocity whose sign is a direction, shape (stop - start,)."""


@dataclass(frozen=True, eq=False)
class SignalPlan:
    """What is to be done with each channel, in SI; made once for a model and a filtering.

    Attributes
    ----------
    operators : dict
        Channel to the operator that gives the derivatives the rows are linear in.
    signals : dict
        Signal key to (channel, column of its operator's output).
    features : dict
        Feature key to the feature.
    feature_operator : FusedOperator
        Filters and decimates a feature.
    feature_margins : tuple of int
        Samples of features that are looked at before and behind those kept.
    directions : dict
        Velocity key to (channel, its filter at the full rate); None where the record brings the direction.
    forces : dict
        Channel of a force to {times that rows are differentiated: column of its operator's output}.
    levers : dict
        Channel of a force to what makes it comparable across gears, see `Actuator` in `runtime.model`.
    full_rate_channels : frozenset
        Channels that directions and features are formed from.
    last_use : dict
        Channel or feature to the last row that needs it: a long chain is worked on from end to end, and
        nothing is kept longer than that.
    constant : float
        What the filter leaves of the constant 1.
    margins : tuple of int
        Samples that are looked at before and behind those kept.
    fast : bool
        Whether compiled code is used.
    kernel : KernelLines, optional
        Features that are nonlinear in several signals, of an arm.
    """

    model: Model
    filtering: Filtering
    operators: dict[str, FusedOperator]
    signals: dict[str, tuple[str, int]]
    features: dict[str, Feature]
    feature_operator: FusedOperator
    feature_margins: tuple[int, int]
    directions: dict[str, tuple[str, SpeedFilter | None]]
    forces: dict[str, dict[int, int]]
    levers: dict[str, float]
    full_rate_channels: frozenset[str]
    last_use: dict[str, int]
    constant: float
    margins: tuple[int, int]
    fast: bool
    kernel: KernelLines | None = None

    def table(self, stretch: PaddedStretch, channel: str, start: int, count: int) -> FloatArray:
        """Return the derivatives of a channel at samples kept from `start` on, shape (count, derivatives)."""
        return self._filtered(stretch, channel, self.operators[channel], start, count)

    def feature(self, stretch: PaddedStretch, feature: Feature, start: int, count: int) -> FloatArray:
        """Return a feature, formed at full rate, filtered, at samples kept from `start`, shape (count,)."""
        return self.filtered_feature(stretch, feature, self.feature_operator, start, count)[:, 0]

    def kernel_features(self, stretch: PaddedStretch, start: int, count: int) -> dict[str, FloatArray]:
        """Return the features of the kernel at samples kept from `start` on, shape (count,) each."""
        assert self.kernel is not None  # a feature of it was asked for
        return self.kernel.at(partial(self._read, stretch), start, count)

    def given_speeds(self, stretch: PaddedStretch, start: int, count: int) -> dict[str, FloatArray]:
        """Return speeds that rows give at samples from `start` on, (count,) each: `KernelLines.speeds_at`."""
        assert self.kernel is not None  # it gives them
        return self.kernel.speeds_at(partial(self._read, stretch), start, count)

    def kernel_signals(self, stretch: PaddedStretch, start: int, count: int) -> dict[str, FloatArray]:
        """Return what the kernel is formed from, (count,) each: `KernelLines.signals_at`."""
        assert self.kernel is not None  # it reads them
        return self.kernel.signals_at(partial(self._read, stretch), start, count)

    def _read(
        self, stretch: PaddedStretch, source: str, operator: FusedOperator, start: int, count: int
    ) -> FloatArray:
        """Return what an operator makes of a channel or feature, shape (count, derivatives)."""
        if source in self.features:
            return self.filtered_feature(stretch, self.features[source], operator, start, count)
        return self._filtered(stretch, source, operator, start, count)

    def direction(self, stretch: PaddedStretch, key: str, start: int, stop: int) -> FloatArray:
        """Return a velocity whose sign is a direction of motion, at the full rate, shape (stop - start,)."""
        channel, smooth = self.directions[key]
        if smooth is None:
            return self._checked(stretch, channel, start, stop)
        return smooth.speed(partial(self._filtered, stretch, channel), start, stop - start)

    def _filtered(
        self, stretch: PaddedStretch, channel: str, operator: FusedOperator, start: int, count: int
    ) -> FloatArray:
        """Return what an operator makes of a channel, shape (count, derivatives)."""
        before, behind = operator.margins
        low, high = start - before, start + (count - 1) * operator.factor + 1 + behind
        found, reading = operator.checked(stretch.read(channel, low, high), before, count)
        if not reading <= LARGEST:
            raise stretch.not_finite(channel, low, high)
        for column, derivative in enumerate(operator.derivatives):
            self._without_rounding(found[:, column], reading, derivative)
        return found

    def filtered_feature(
        self, stretch: PaddedStretch, feature: Feature, operator: FusedOperator, start: int, count: int
    ) -> FloatArray:
        """Return what an operator makes of a feature, formed at the full rate, shape (count, derivatives)."""
        before, behind = operator.margins
        low, high = start - before, start + (count - 1) * operator.factor + 1 + behind
        if feature.function == "sign" and feature.times is None and not self.filtering.between:
            return operator.apply(stretch.direction(str(feature.of), low, high), before, count, signs=True)
        return operator.apply(self._feature(feature, stretch, low, high), before, count)

    def _checked(self, stretch: PaddedStretch, channel: str, start: int, stop: int) -> FloatArray:
        """Return samples of a channel as they are."""
        samples = stretch.read(channel, start, stop)
        if not largest(samples) <= LARGEST:
            raise stretch.not_finite(channel, start, stop)
        return samples

    def _without_rounding(self, found: FloatArray, reading: float, derivative: int) -> None:
        """Set a derivative to zero where it is nothing but the rounding error of its channel."""
        if derivative == 0:
            return
        rounding = ROUNDING * (self.filtering.largest_gain * self.filtering.fs) ** derivative * reading
        if largest(found[::FEW]) <= rounding and largest(found) <= rounding:
            found[:] = 0.0

    def _feature(self, feature: Feature, stretch: PaddedStretch, start: int, stop: int) -> FloatArray:
        """Return a feature at the full rate, from directions and unfiltered signals."""
        factor = 1.0 if feature.times is None else self._raw(feature.times, stretch, start, stop)
        if not isinstance(feature.of, str):
            total = np.zeros(stop - start)
            for coefficient, key in feature.of:
                total += coefficient * self._raw(key, stretch, start, stop)
            return np.asarray(total**3 * factor)
        velocity = stretch.direction(feature.of, start, stop)
        way, between = WAYS.get(feature.function), self.filtering.between
        value = sign_between(velocity) if between else np.sign(velocity)
        if way is not None:
            value = 0.5 + way * value if between else (way * velocity > 0.0).astype(float)
        return value if feature.times is None else np.asarray(value * factor)

    def _raw(self, key: str, stretch: PaddedStretch, start: int, stop: int) -> FloatArray:
        signal, stencil = next(one for one in self.model.signals if one.key == key), self.filtering.stencil
        margin, dt = DIFFERENCE_MARGIN * len(stencil) * signal.derivative, 1.0 / self.filtering.fs
        samples = self._checked(stretch, signal.channel, start - margin, stop + margin)
        slope = differentiate(samples, dt, signal.derivative, stencil)
        return slope[margin : len(slope) - margin]


@lru_cache(maxsize=8)  # one record after the other has the same
def signal_plan(model: Model, filtering: Filtering, fast: bool | None = None) -> SignalPlan:
    """Return the plan of a model's signals; `fast` as for `fused_operator`.

    Raises
    ------
    DataError
        When a filter is too slow for its sampling frequency.
    """
    used, kernel = _used_keys(model), kernel_lines(model, filtering, fast)

    def operator(sections: Sections, orders: tuple[int, ...], factor: int) -> FusedOperator:
        return fused_operator(sections, filtering.fs, orders, factor, filtering.stencil, fast=fast)

    orders: dict[str, list[int]] = {}
    signals: dict[str, tuple[str, int]] = {}
    for signal in model.signals:
        if signal.key not in used:
            continue
        channel = signal.channel
        signals[signal.key] = (channel, len(orders.setdefault(channel, [])))
        orders[channel].append(signal.derivative)
    forces: dict[str, dict[int, int]] = {}
    counts = tuple(dict.fromkeys(row.differentiated for row in model.rows))
    for force in dict.fromkeys(s.actuator for s in model.signals if s.actuator in orders):
        own = orders[str(force)]
        own += [times for times in counts if times not in own]
        forces[str(force)] = {times: own.index(times) for times in counts}
    operators = {c: operator(filtering.linear, tuple(orders[c]), filtering.factor) for c in orders}
    formed = {source for source, _ in kernel.inputs} if kernel else set()
    features = {feature.key: feature for feature in model.features if feature.key in used | formed}
    feature_operator = operator(filtering.linear, (0,), filtering.factor)
    directions: dict[str, tuple[str, SpeedFilter | None]] = {}
    direction_keys = frozenset(model.direction_keys)
    for signal in model.signals:
        if signal.key in direction_keys:
            brought = signal.sensor is None and signal.actuator is None
            speed = partial(operator, orders=(signal.derivative,), factor=1)
            smooth = None if brought else speed_filter(filtering, signal.channel, speed)
            directions[signal.key] = (signal.channel, smooth)
    deepest = DIFFERENCE_MARGIN * len(filtering.stencil) * deepest_derivative(model)
    of_directions = [one.margins for _, one in directions.values() if one is not None]
    of_features = [feature_operator.margins]
    of_features += [kernel.margins] if kernel and formed.intersection(features) else []
    reach = np.max(of_features, axis=0)
    full_rate = np.max([(deepest, deepest), *of_directions], axis=0) + reach
    inner = [one.margins for one in operators.values()] + ([kernel.margins] if kernel else [])
    margins = np.max([full_rate, *inner], axis=0)
    # of a constant, one pass forward and one backward
    gain = float(squared_gain(np.asarray(filtering.linear, dtype=float), np.zeros(1))[0])
    return SignalPlan(
        model,
        filtering,
        operators,
        signals,
        features,
        feature_operator,
        (int(reach[0]), int(reach[1])),
        directions,
        forces,
        {actuator.key: actuator.lever for actuator in model.actuators},
        _full_rate_channels(model, directions),
        _last_use(model),
        gain,
        (int(margins[0]), int(margins[1])),
        isinstance(feature_operator.blocks, LoopBlocks),
        kernel,
    )


def _full_rate_channels(
    model: Model, directions: dict[str, tuple[str, SpeedFilter | None]]
) -> frozenset[str]:
    """Return the channels that directions and features are formed from."""
    channel, found = (
        {one.key: one.channel for one in model.signals},
        [name for name, _ in directions.values()],
    )
    found += [source for source, _ in (model.kernel.reads if model.kernel else ())]
    for feature in model.features:
        keys = [feature.of] if isinstance(feature.of, str) else [key for _, key in feature.of]
        found += [channel[key] for key in (*keys, *([feature.times] if feature.times else []))]
    return frozenset(found)


def _last_use(model: Model) -> dict[str, int]:
    """Return the last row that needs each channel or feature."""
    channel = {signal.key: signal.channel for signal in model.signals}
    last: dict[str, int] = {}
    for row, touched in enumerate(model.regressor_columns):
        for terms in (*touched.values(), model.measurement_columns[row]):
            # the constant is no channel: every row asks it for the number of samples
            last |= {channel.get(key, key): row for _, key in terms if key != "1"}
    return last


def _used_keys(model: Model) -> frozenset[str]:
    """Return the keys that some row is linear in."""
    terms = [*model.measurement_columns, *(t for row in model.regressor_columns for t in row.values())]
    return frozenset(key for pairs in terms for _, key in pairs)
