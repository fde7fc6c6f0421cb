"""Energies and work of a chain's columns: its balances of force, each times the speed of its body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.model.arm_channels import differentiated
from modelgen.runtime.model.model import Feature, Model, Signal, Terms
from modelgen.runtime.model.power.balance_lines import BalanceLines

# (row's speed, its terms); the row's own body is what the speed is of
Rows = tuple[tuple[str, Mapping[str, Terms]], ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class ChainPower(BalanceLines):
    """Lines of the balance of power of a chain.

    Attributes
    ----------
    rows : tuple of (str, mapping)
        Of each row its speed, and its terms by what they are of: a column's number, or ``measured``.
    features : mapping of str to Feature
        What rows hold that is nonlinear.
    """

    rows: Rows
    features: Mapping[str, Feature]

    def lines(self, signals: Mapping[str, FloatArray]) -> Mapping[str, FloatArray]:
        """Return every line, shape (N,) each, from signals of that shape, in SI."""
        count = len(signals[self.inputs[0]])
        known = {**signals, "1": np.ones(count)}
        known |= {key: _formed(one, known) for key, one in self.features.items()}
        found = {key: np.zeros(count) for key in self.keys}
        for speed, lines in self.rows:
            for name, terms in lines.items():
                for factor, key in terms:
                    if key in self.risen:
                        found[f"energy {name}"] += 0.5 * factor * known[speed] * known[self.risen[key]]
                    else:
                        found[f"work {name}"] += factor * known[speed] * known[key]
        return found


def chain_power(model: Model) -> ChainPower:
    """Return the lines of a chain's balance of power.

    Raises
    ------
    DataError
        When no row is the balance of one body whose speed the sensors give.
    """
    speeds, further = _speeds(model)
    bodies = {sensor.key: sensor.body for sensor in model.sensors}
    orders = {sensor.key: sensor.order for sensor in model.sensors}
    features = {feature.key: feature for feature in model.features}
    risen = {
        signal.key: speeds[body]
        for signal in model.signals
        if signal.sensor is not None
        and orders[signal.sensor] + signal.derivative == 2
        and (body := bodies[signal.sensor]) in speeds
    }
    rows: list[tuple[str, Mapping[str, Terms]]] = []
    for place, info in enumerate(model.rows):
        body = info.bodies[0]
        if len(info.bodies) > 1 or info.differentiated or body not in speeds:
            continue
        terms = {str(column): one for column, one in model.regressor_columns[place].items()}
        rows.append((speeds[body], {**terms, "measured": model.measurement_columns[place]}))
    if not rows:
        what = "has no row that is the balance of one body, not differentiated, whose speed is known"
        remedy = "measure the positions of all bodies (encoders), or leave rows = power out"
        raise DataError.at(f"{model.chain}, sensors {model.sensor_set}", what, remedy)
    held = [(name, key) for _, lines in rows for name, terms in lines.items() for _, key in terms]
    used = {key: features[key] for _, key in held if key in features}
    read = [speed for speed, _ in rows] + [risen.get(key, key) for _, key in held if key not in used]
    read += [key for one in used.values() for key in _sources(one)]
    keys = dict.fromkeys(f"{'energy' if key in risen else 'work'} {name}" for name, key in held)
    inputs = tuple(dict.fromkeys(key for key in read if key != "1"))
    return ChainPower(
        inputs=inputs, rows=tuple(rows), risen=risen, features=used, keys=tuple(keys), further=further
    )


def _speeds(model: Model) -> tuple[dict[str, str], tuple[Signal, ...]]:
    """Return the signal of every body's speed, by the sensor of the highest order, and those that are new."""
    places = {(signal.sensor, signal.derivative): signal.key for signal in model.signals}
    found: dict[str, str] = {}
    further = []
    for sensor in sorted(model.sensors, key=lambda one: one.order):
        if sensor.body is None or sensor.order > 1:
            continue
        times = 1 - sensor.order
        if (sensor.key, times) not in places:
            made = Signal(differentiated(sensor.key, times), sensor.key, None, times, "")
            places[sensor.key, times] = made.key
            further.append(made)
        found[sensor.body] = places[sensor.key, times]
    return found, tuple(further)


def _sources(feature: Feature) -> Iterator[str]:
    yield from [feature.of] if isinstance(feature.of, str) else [key for _, key in feature.of]
    if feature.times is not None:
        yield feature.times


def _formed(feature: Feature, signals: Mapping[str, FloatArray]) -> FloatArray:
    """Return a nonlinear feature, shape (N,)."""
    factor = 1.0 if feature.times is None else signals[feature.times]
    if not isinstance(feature.of, str):
        total = sum((weight * signals[key] for weight, key in feature.of), np.zeros(len(signals["1"])))
        return np.asarray(total**3 * factor)
    speed = signals[feature.of]
    if feature.function == "sign":
        return np.asarray(np.sign(speed) * factor)
    return np.asarray((speed > 0.0 if feature.function == "forward" else speed < 0.0) * factor)
