"""A generated module's rows -> rows over coordinates and parameters, which can be compared exactly."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from modelgen.errors import ModelError
from modelgen.symbolic.compare import FormalRegressor, FormalSignal

if TYPE_CHECKING:
    from modelgen.runtime.contract import Feature, Model, Sensor

ORDER_OF = {"position": 0, "velocity": 1, "acceleration": 2}
LARGEST_DENOMINATOR = 10**6
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
    found = Fraction(value).limit_denominator(LARGEST_DENOMINATOR)
    if float(found) != value:
        remedy = "compare specs with ratios of small whole numbers"
        raise ModelError.at("regressor", f"has the coefficient {value!r}, no small fraction", remedy)
    return found


def _column_parameters(model: Model) -> list[dict[str, Fraction]]:
    """Return every column as a sum of physical parameters, or as itself where it is no such sum."""
    rng = np.random.default_rng(0)
    jacobians = [
        model.base_jacobian({**model.known, **{name: rng.uniform(0.5, 2.0) for name in model.parameters}})
        for _ in range(2)
    ]
    columns = []
    for name, here, there in zip(model.base_parameters, *jacobians, strict=True):
        linear = name not in model.composites and np.allclose(here, there, rtol=1e-12, atol=1e-12)
        pairs = zip(model.parameters, here, strict=True)
        shares = {p: Fraction(float(c)).limit_denominator(1000) for p, c in pairs if abs(c) > 1e-9}
        columns.append(shares if linear and shares else {name: Fraction(1)})
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
            # the record brings a direction of motion itself: it stands for the body's velocity
            return {FormalSignal("q", key.removeprefix("sign_"), 1): Fraction(1)}
        sensor = self._sensors[signal.sensor]
        order = ORDER_OF[sensor.measures] + signal.derivative
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
        """Return the coordinates that a sensor reads; the direct model knows the ratio of a deflection."""
        if sensor.body is not None:
            return {sensor.body: Fraction(1)}
        from modelgen.runtime.plant import body_order

        bodies = body_order(self._model)
        ones = dict.fromkeys((*self._model.parameters, *self._model.known), 1.0)
        space = self._model.state_space(ones, {friction.body: 1 for friction in self._model.friction})
        row = space.C[[s.key for s in self._model.sensors].index(sensor.key)]
        n, order = len(bodies), ORDER_OF[sensor.measures]
        found = row[order * n : (order + 1) * n] if order < 2 else np.linalg.lstsq(space.A[n:].T, row)[0]
        pairs = zip(bodies, np.round(found, 9), strict=True)
        return {body: Fraction(float(c)).limit_denominator(LARGEST_DENOMINATOR) for body, c in pairs if c}
