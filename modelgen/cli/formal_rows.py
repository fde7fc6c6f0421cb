"""A generated module's rows -> rows over coordinates and parameters, which can be compared exactly."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from modelgen.errors import ModelError
from modelgen.symbolic.compare import FormalRegressor, FormalSignal

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Feature, Model, Sensor

# A number is taken for the simplest fraction within its rounding. That of an arbitrary number has numerator
# times denominator near 2^53; a gear of 628.3, squared, has 100 * 39476089.
LARGEST_PRODUCT = 10**13
ROUNDING = 1e-15
DIGITS = 16
SOLVED = 1e-9
ONE = FormalSignal("one", "1", 0)
Sum = dict[FormalSignal, Fraction]


def formal_regressor(model: Model, title: str) -> FormalRegressor:
    """Return the rows of a model as exact vectors over (parameter, signal)."""
    translate = _Translation(model)
    columns = _column_parameters(model)
    rows = []
    for left, right in zip(model.measurement_columns, model.regressor_columns, strict=True):
        row: dict[tuple[str, FormalSignal], Fraction] = {}
        entries = [("", Fraction(1), left)]
        for column, terms in right.items():
            entries += [(name, -share, terms) for name, share in columns[column].items()]
        for parameter, share, terms in entries:
            for coefficient, key in terms:
                for signal, amount in translate.signal(key).items():
                    place = (parameter, signal)
                    row[place] = row.get(place, Fraction(0)) + share * exact(coefficient) * amount
        rows.append({place: value for place, value in row.items() if value})
    return FormalRegressor(title, tuple(info.name for info in model.rows), tuple(rows))


def exact(value: float) -> Fraction:
    """Return the small fraction that a coefficient was made from.

    Raises
    ------
    ModelError
        When there is none.
    """
    found = simplest(value, ROUNDING)
    if abs(found.numerator) * found.denominator > LARGEST_PRODUCT:
        remedy = "compare specs with ratios of small whole numbers"
        raise ModelError.at("regressor", f"has the coefficient {value!r}, no small fraction", remedy)
    return found


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
    rng = np.random.default_rng(0)
    jacobians = [
        model.base_jacobian({**model.known, **{name: rng.uniform(0.5, 2.0) for name in model.parameters}})
        for _ in range(2)
    ]
    columns = []
    for name, here, there in zip(model.base_parameters, *jacobians, strict=True):
        linear = name not in model.composites and np.allclose(here, there, rtol=1e-12, atol=0.0)
        pairs = zip(model.parameters, here, strict=True)
        shares = {p: exact(float(c)) for p, c in pairs if linear and c}
        columns.append(shares or {name: Fraction(1)})
    return columns


class _Translation:
    """From signal and feature keys to what they are of the bodies."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._signals = {signal.key: signal for signal in model.signals}
        self._features = {feature.key: feature for feature in model.features}
        self._sensors = {sensor.key: sensor for sensor in model.sensors}
        self._actuators = {actuator.key: actuator.body for actuator in model.actuators}

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
        pairs = [(1.0, feature.of)] if isinstance(feature.of, str) else feature.of
        inner: Sum = {}
        for coefficient, key in pairs:
            for signal, share in self.signal(key).items():
                inner[signal] = inner.get(signal, Fraction(0)) + exact(coefficient) * share
        text = " + ".join(f"{share} d{s.order} {s.kind}_{s.name}" for s, share in sorted(inner.items()))
        times = "" if feature.times is None else f" times {sorted(self.signal(feature.times).items())}"
        return {FormalSignal(feature.function, text + times, 0): Fraction(1)}

    def _combination(self, sensor: Sensor) -> dict[str, Fraction]:
        """Return the coordinates that a sensor reads; the direct model holds the ratio of a deflection."""
        if sensor.body is not None:
            return {sensor.body: Fraction(1)}
        from modelgen.runtime.simulation.plant import body_order

        bodies = body_order(self._model)
        ones = dict.fromkeys((*self._model.parameters, *self._model.known), 1.0)
        space = self._model.state_space(ones, {friction.body: 1 for friction in self._model.friction})
        row = space.C[[s.key for s in self._model.sensors].index(sensor.key)]
        n, order = len(bodies), sensor.order
        found = row[order * n : (order + 1) * n] if order < 2 else np.linalg.lstsq(space.A[n:].T, row)[0]
        # what the equations of motion were solved for has lost a few digits
        size = float(np.abs(found).max())
        pairs = zip(bodies, found.tolist(), strict=True)
        return {body: simplest(c, SOLVED) for body, c in pairs if abs(c) > SOLVED * size}
