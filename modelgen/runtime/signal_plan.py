"""SignalPlan: the operators that take the channels of a record to the signals and features of a model.

Each channel is filtered once, all its derivatives together; only features are filtered as signals of their
own, because they are formed at the full rate from what is not linear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.runtime.contract import Feature, Model, Signal
from modelgen.runtime.derivatives import differentiate
from modelgen.runtime.filtered_record import DIFFERENCE_GAIN, ROUNDING
from modelgen.runtime.filtering import Filtering
from modelgen.runtime.fused import FusedOperator, fused_operator
from modelgen.runtime.two_sided import Sections, squared_gain

FloatArray = npt.NDArray[np.float64]
# (channel or velocity, start, stop) -> samples, continued beyond the ends of the record
Reader = Callable[[str, int, int], FloatArray]

# An unfiltered derivative is off this near to the ends of what it is made from, per order.
DIFFERENCE_MARGIN = 8


@dataclass(frozen=True, eq=False)
class SignalPlan:
    """What is to be done with each channel; made once for a model and a filtering.

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
    directions : dict
        Velocity key to (channel, its operator at the full rate); None where the record brings the direction.
    forces : dict
        Channel of a force to {times that rows are differentiated: column of its operator's output}.
    levers : dict
        Channel of a force to what makes it comparable across gears, see `modelgen.runtime.contract.Actuator`.
    full_rate_channels : frozenset
        Channels that directions and features are formed from.
    last_use : dict
        Channel or feature to the last row that needs it: a long chain is worked on from end to end, and
        nothing is kept longer than that.
    constant : float
        What the filter leaves of the constant 1.
    margin : int
        Samples that a kept one is felt from, on each side.
    """

    model: Model
    filtering: Filtering
    operators: dict[str, FusedOperator]
    signals: dict[str, tuple[str, int]]
    features: dict[str, Feature]
    feature_operator: FusedOperator
    directions: dict[str, tuple[str, FusedOperator | None]]
    forces: dict[str, dict[int, int]]
    levers: dict[str, float]
    full_rate_channels: frozenset[str]
    last_use: dict[str, int]
    constant: float
    margin: int

    def table(self, read: Reader, channel: str, start: int, count: int) -> FloatArray:
        """Return the derivatives of a channel at count samples kept, the first at `start`."""
        operator = self.operators[channel]
        stop = start + (count - 1) * self.filtering.factor + 1
        samples = read(channel, start - operator.reach, stop + operator.reach)
        found = operator.apply(samples, operator.reach, count)
        for column, derivative in enumerate(operator.derivatives):
            self._without_rounding(found[:, column], samples, derivative)
        return found

    def feature(self, read: Reader, direction: Reader, key: str, start: int, count: int) -> FloatArray:
        """Return a feature at count samples kept, the first at `start`."""
        reach = self.feature_operator.reach
        stop = start + (count - 1) * self.filtering.factor + 1
        samples = self._feature(self.features[key], read, direction, start - reach, stop + reach)
        return self.feature_operator.apply(samples, reach, count)[:, 0]

    def direction(self, read: Reader, key: str, start: int, stop: int) -> FloatArray:
        """Return a velocity whose sign is a direction of motion, at the full rate, shape (stop - start,)."""
        channel, operator = self.directions[key]
        if operator is None:
            return read(channel, start, stop)
        samples = read(channel, start - operator.reach, stop + operator.reach)
        found = operator.apply(samples, operator.reach, stop - start)[:, 0]
        self._without_rounding(found, samples, operator.derivatives[0])
        return found

    def _without_rounding(self, found: FloatArray, samples: FloatArray, derivative: int) -> None:
        """Set a derivative to zero where it is nothing but the rounding error of its channel."""
        if derivative == 0:
            return
        gain = ROUNDING * (DIFFERENCE_GAIN * self.filtering.fs) ** derivative
        largest = max(float(found.max()), -float(found.min()))
        if largest <= gain * max(float(samples.max()), -float(samples.min())):
            found[:] = 0.0

    def _feature(
        self, feature: Feature, read: Reader, direction: Reader, start: int, stop: int
    ) -> FloatArray:
        """Return a feature at the full rate, from directions and unfiltered signals."""
        factor = 1.0 if feature.times is None else self._raw(feature.times, read, start, stop)
        if not isinstance(feature.of, str):
            total = np.zeros(stop - start)
            for coefficient, key in feature.of:
                total += coefficient * self._raw(key, read, start, stop)
            return np.asarray(total**3 * factor)
        velocity = direction(feature.of, start, stop)
        if feature.function == "sign":
            value = np.sign(velocity)
        else:
            value = (velocity > 0.0 if feature.function == "forward" else velocity < 0.0).astype(float)
        return value if feature.times is None else np.asarray(value * factor)

    def _raw(self, key: str, read: Reader, start: int, stop: int) -> FloatArray:
        signal = next(signal for signal in self.model.signals if signal.key == key)
        margin = DIFFERENCE_MARGIN * signal.derivative
        samples = read(channel_of(signal), start - margin, stop + margin)
        slope = differentiate(samples, 1.0 / self.filtering.fs, signal.derivative)
        return slope[margin : len(slope) - margin]


def signal_plan(model: Model, filtering: Filtering, fast: bool | None = None) -> SignalPlan:
    """Return the plan of a model's signals; `fast` as for `modelgen.runtime.fused.fused_operator`.

    Raises
    ------
    DataError
        When a filter is too slow for its sampling frequency.
    """
    used = _used_keys(model)

    def operator(sections: Sections, orders: tuple[int, ...], factor: int) -> FusedOperator:
        return fused_operator(sections, filtering.fs, orders, factor, filtering.stencil, fast=fast)

    orders: dict[str, list[int]] = {}
    signals: dict[str, tuple[str, int]] = {}
    sections: dict[str, Sections] = {}
    for signal in model.signals:
        if signal.key not in used:
            continue
        channel = channel_of(signal)
        signals[signal.key] = (channel, len(orders.setdefault(channel, [])))
        orders[channel].append(signal.derivative)
        sections[channel] = filtering.sensors if signal.sensor else filtering.forces
    forces: dict[str, dict[int, int]] = {}
    counts = tuple(dict.fromkeys(row.differentiated for row in model.rows))
    for force in dict.fromkeys(s.actuator for s in model.signals if s.actuator in orders):
        own = orders[str(force)]
        own += [times for times in counts if times not in own]
        forces[str(force)] = {times: own.index(times) for times in counts}
    operators = {c: operator(sections[c], tuple(orders[c]), filtering.factor) for c in orders}
    features = {feature.key: feature for feature in model.features if feature.key in used}
    feature_operator = operator(filtering.features, (0,), filtering.factor)
    directions: dict[str, tuple[str, FusedOperator | None]] = {}
    direction_keys = frozenset(model.direction_keys)
    for signal in model.signals:
        if signal.key in direction_keys:
            brought = signal.sensor is None and signal.actuator is None
            smooth = None if brought else operator(filtering.directions, (signal.derivative,), 1)
            directions[signal.key] = (channel_of(signal), smooth)
    late = max((one.reach for _, one in directions.values() if one), default=0)
    deepest = max(signal.derivative for signal in model.signals)
    margin = max(
        max(one.reach for one in operators.values()),
        feature_operator.reach + max(late, DIFFERENCE_MARGIN * deepest),
    )
    # a constant times one pass forward and one backward
    gain = float(squared_gain(np.asarray(filtering.features, dtype=float), np.zeros(1))[0])
    return SignalPlan(
        model,
        filtering,
        operators,
        signals,
        features,
        feature_operator,
        directions,
        forces,
        {actuator.key: actuator.lever for actuator in model.actuators},
        _full_rate_channels(model, directions),
        _last_use(model),
        gain,
        margin,
    )


def channel_of(signal: Signal) -> str:
    """Return the record's channel that a signal derives from."""
    return signal.sensor or signal.actuator or signal.key


def _full_rate_channels(
    model: Model, directions: dict[str, tuple[str, FusedOperator | None]]
) -> frozenset[str]:
    """Return the channels that directions and features are formed from."""
    channel = {signal.key: channel_of(signal) for signal in model.signals}
    found = [name for name, _ in directions.values()]
    for feature in model.features:
        keys = [feature.of] if isinstance(feature.of, str) else [key for _, key in feature.of]
        found += [channel[key] for key in (*keys, *([feature.times] if feature.times else []))]
    return frozenset(found)


def _last_use(model: Model) -> dict[str, int]:
    """Return the last row that needs each channel or feature."""
    channel = {signal.key: channel_of(signal) for signal in model.signals}
    last: dict[str, int] = {}
    for row, touched in enumerate(model.regressor_columns):
        for terms in (*touched.values(), model.measurement_columns[row]):
            last |= {channel.get(key, key): row for _, key in terms}
    return last


def _used_keys(model: Model) -> frozenset[str]:
    """Return the keys that some row is linear in."""
    terms = [*model.measurement_columns, *(t for row in model.regressor_columns for t in row.values())]
    return frozenset(key for pairs in terms for _, key in pairs)
