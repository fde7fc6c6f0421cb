"""A generated module's rows -> rows over coordinates and parameters, which can be compared exactly."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from modelgen.symbolic.compare import FormalRegressor, FormalSignal

if TYPE_CHECKING:
    from modelgen.runtime.model.mechanical_parts import Sensor
    from modelgen.runtime.model.model import Feature, Model

# A number is taken for the simplest fraction within its rounding. That of an arbitrary number has numerator
# times denominator near 2^53; a gear of 628.3, squared, has 100 * 39476089.
LARGEST_PRODUCT = 10**13
ROUNDING = 1e-15
DIGITS = 16
SOLVED, LARGEST_SOLVED = 1e-9, 10**7  # likewise of a number of nine digits
ONE = FormalSignal("one", "1", 0)
# Entries of arms are compared by their values at so many samples.
SAMPLES = 6
Sum = dict[FormalSignal, Fraction]


def formal_regressor(model: Model, title: str) -> FormalRegressor:
    """Return the rows of a model as exact vectors over (parameter, signal)."""
    translate = _Translation(model, title)
    columns = _column_parameters(model)
    rows = []
    for left, right in zip(model.measurement_columns, model.regressor_columns, strict=True):
        row: dict[tuple[str, FormalSignal], Fraction] = {}
        sizes: dict[tuple[str, FormalSignal], Fraction] = {}
        entries = [("", Fraction(1), left)]
        for column, terms in right.items():
            entries += [(name, -share, terms) for name, share in columns[column].items()]
        for parameter, share, terms in entries:
            for coefficient, key in terms:
                for signal, amount in translate.signal(key).items():
                    place = (parameter, signal)
                    part = share * exact(coefficient) * amount
                    row[place] = row.get(place, Fraction(0)) + part
                    sizes[place] = sizes.get(place, Fraction(0)) + abs(part)
        # what cancels but for rounding is zero
        rows.append({place: value for place, value in row.items() if abs(value) > SOLVED * sizes[place]})
    rounded = not all(is_small(value) for row in rows for value in row.values())
    return FormalRegressor(title, tuple(info.name for info in model.rows), tuple(rows), rounded)


def exact(value: float) -> Fraction:
    """Return the small fraction that a coefficient was made from, or the coefficient where there is none."""
    found = simplest(value, ROUNDING)
    return found if is_small(found) else Fraction(value)


def is_small(value: Fraction) -> bool:
    """Return whether a fraction is one that a double distinguishes from its neighbours."""
    return abs(value.numerator) * value.denominator <= LARGEST_PRODUCT


def simplest(value: float, tolerance: float) -> Fraction:
    """Return a fraction within a relative tolerance of a number, with as short a denominator as can be."""
    given = Fraction(value)
    for digits in range(1, DIGITS):
        found = given.limit_denominator(10**digits)
        if abs(found - given) <= tolerance * abs(given):
            return found
    return given


def _column_parameters(model: Model) -> list[dict[str, Fraction]]:
    """Return every column as a sum of physical parameters, or as itself where it is no such sum."""
    from modelgen.runtime.exports.sums import linear_shares

    gradients, _, linear = linear_shares(model)
    columns = []
    for name, gradient, is_sum in zip(model.base_parameters, gradients, linear, strict=True):
        pairs = zip(model.parameters, gradient.tolist(), strict=True)
        shares = {p: exact(c) for p, c in pairs if is_sum and c and name not in model.composites}
        columns.append(shares or {name: Fraction(1)})
    return columns


def _solved(value: float) -> Fraction:
    found = simplest(value, SOLVED)
    return found if abs(found.numerator) * found.denominator <= LARGEST_SOLVED else exact(value)


def _text(share: Fraction) -> str:
    return str(share) if is_small(share) else f"{float(share):.10g}"


def _line_values(model: Model) -> dict[str, list[float]]:
    """Return each line of an arm's kernel at random values, which are the same for the same coordinates.

    Lines are the same function, up to a factor, where their values are in the same ratios.
    """
    from modelgen.runtime.model.arm_kernel import ArmKernel

    if not isinstance(model.kernel, ArmKernel):
        return {}
    places = {sensor.key: (sensor.body or sensor.key, sensor.order) for sensor in model.sensors}
    signals = {}
    for key, (source, order) in model.kernel.reads_of.items():
        body, first = places.get(source, (source, 0))
        seed = crc32(f"{body} {first + order}".encode())
        signals[key] = np.random.default_rng(seed).uniform(0.3, 1.3, SAMPLES)
    return {key: line.tolist() for key, line in model.kernel.lines(signals).items()}


class _Translation:
    """From signal and feature keys to what they are of the bodies."""

    def __init__(self, model: Model, title: str) -> None:
        self._model = model
        self._title = title
        self._lines = _line_values(model)
        self._signals = {signal.key: signal for signal in model.signals}
        self._features = {feature.key: feature for feature in model.features}
        self._sensors = {sensor.key: sensor for sensor in model.sensors}
        # of an arm, a drive's torque and one that is measured behind it are of the same joint
        self._actuators = {one.key: one.key if model.is_arm else one.body for one in model.actuators}

    def signal(self, key: str) -> Sum:
        if key == "1":
            return {ONE: Fraction(1)}
        if key in self._features:
            return self._feature(self._features[key])
        signal = self._signals[key]
        if signal.actuator is not None:
            return {FormalSignal("force", self._actuators[signal.actuator], signal.derivative): Fraction(1)}
        if signal.sensor is None:
            # the record holds a direction of motion itself, in place of the body's velocity
            return {FormalSignal("q", key.removeprefix("sign_"), 1): Fraction(1)}
        sensor = self._sensors[signal.sensor]
        order = sensor.order + signal.derivative
        return {FormalSignal("q", body, order): share for body, share in self._combination(sensor).items()}

    def _feature(self, feature: Feature) -> Sum:
        if feature.function == "kernel":
            if feature.key not in self._lines:  # made about an estimate: no other model has it
                return {FormalSignal("kernel", f"{self._title} {feature.key}", 0): Fraction(1)}
            first, *more = self._lines[feature.key]
            shape = " ".join(f"{value / first:.6e}" for value in more)
            return {FormalSignal("kernel", shape, 0): exact(first)}
        pairs = [(1.0, feature.of)] if isinstance(feature.of, str) else feature.of
        inner: Sum = {}
        for coefficient, key in pairs:
            for signal, share in self.signal(key).items():
                inner[signal] = inner.get(signal, Fraction(0)) + exact(coefficient) * share
        text = " + ".join(
            f"{_text(share)} d{s.order} {s.kind}_{s.name}" for s, share in sorted(inner.items())
        )
        times = "" if feature.times is None else f" times {sorted(self.signal(feature.times).items())}"
        return {FormalSignal(feature.function, text + times, 0): Fraction(1)}

    def _combination(self, sensor: Sensor) -> dict[str, Fraction]:
        """Return the coordinates that a sensor reads; the direct model holds the ratio of a deflection."""
        if sensor.body is not None:
            return {sensor.body: Fraction(1)}
        from modelgen.runtime.simulation.plant import body_order, sensor_levers

        bodies, place = body_order(self._model), [s.key for s in self._model.sensors].index(sensor.key)
        levers = sensor_levers(self._model)[place]
        if sensor.order == 2:
            # what the equations of motion were solved for has lost a few digits
            least = SOLVED * np.abs(levers).max()
            found = [_solved(c) if abs(c) > least else Fraction(0) for c in levers.tolist()]
        else:
            found = [exact(c) for c in levers.tolist()]
        return {body: share for body, share in zip(bodies, found, strict=True) if share}
