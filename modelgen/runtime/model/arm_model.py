"""The view of an arm's module that the road knows: signals, features and sums, as of a chain's.

Coordinates are the positions of joints. A motor that moves more than one has a coordinate of its own, a sum
of theirs (`COUPLED` behind the name of its joint), so that its direction is one as any other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.arm_functions import ArmFunctions
from modelgen.runtime.model.arm_kernel import SAMPLES_A_CANDIDATE, ArmKernel, Candidates, Sum

COUPLED = "_motor"
ORDERS = ("q", "d1_q", "d2_q")


class Coordinate(NamedTuple):
    """A joint's position, or that of a motor of several: `sum` says which joints' positions it is made of."""

    name: str
    revolute: bool
    sum: Sum

    @property
    def keys(self) -> tuple[str, str, str]:
        """Keys of its position, speed and acceleration; the first is that of its sensor."""
        position, speed, acceleration = (f"{order}_{self.name}" for order in ORDERS)
        return position, speed, acceleration


def arm_fields(module: Any) -> dict[str, Any]:
    """Return what a module of an arm holds in the form of a chain's: entries of the tables, and the columns.

    The keys are names of `modelgen.runtime.model.model.Model`, less those that both contracts share.
    """
    coordinates = _coordinates(module)
    entries, left, kernel, features = _lines(module, coordinates)
    derived = {one.keys[0]: one.sum for one in coordinates if one.name.endswith(COUPLED) and one.sum}
    names, groupings = _short_names(module.BASE_PARAMETERS, {*module.PARAMETERS, *module.KNOWN})
    leading = [name.partition(" ")[0] for name in module.BASE_PARAMETERS]
    regressor: list[dict[int, Sum]] = [{} for _ in module.ROWS]
    for (row, column), terms in zip(module.ENTRIES, entries, strict=True):
        regressor[row][column] = terms
    return {
        "module": ArmFunctions(module),
        "chain": module.ARM,
        "sensor_set": "joints" if module.ROW_KIND == "joint" else "motors",
        "sensors": _sensors(coordinates),
        "actuators": _actuators(module, coordinates),
        "base_parameters": names,
        "composites": {},
        "groupings": groupings,
        "units": {**module.UNITS, **{n: module.UNITS[of] for n, of in zip(names, leading, strict=True)}},
        "signals": _signals(module, coordinates),
        "features": features,
        "rows": _rows(module),
        "friction": (),
        "measurement": tuple(left),
        "regressor": tuple(regressor),
        "derived": derived,
        "kernel": kernel if kernel.keys else None,
    }


def _coordinates(module: Any) -> tuple[Coordinate, ...]:
    """Return the coordinates of the joints that move, and behind them those of motors that move several."""
    moving = [joint for joint in module.JOINTS if joint["kind"] != "fixed"]
    found = [Coordinate(joint["name"], joint["kind"] == "revolute", ()) for joint in moving]
    for index, row in enumerate(module.TRANSMISSION):
        moved = [(ratio, place) for place, ratio in enumerate(row) if ratio]
        if len(moved) > 1:
            own = row[index] or moved[0][0]
            lever = tuple((ratio / own, f"q_{moving[place]['name']}") for ratio, place in moved)
            found.append(Coordinate(f"{moving[index]['name']}{COUPLED}", found[index].revolute, lever))
    return tuple(found)


def _short_names(formulas: tuple[str, ...], taken: set[str]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return names for the columns and what those that are sums stand for: the first parameter and "_R"."""
    names, groupings = [], {}
    for formula in formulas:
        name, _, others = formula.partition(" ")
        if others:
            name += "_R"
            while name in taken:
                name += "R"
            groupings[name] = formula
        names.append(name)
    return tuple(names), groupings


def _lines(
    module: Any, coordinates: tuple[Coordinate, ...]
) -> tuple[list[Sum], list[Sum], ArmKernel, tuple[dict[str, Any], ...]]:
    """Return terms of every entry and left side, the kernel for those that are no sums, and the features."""
    rng = np.random.default_rng(0)
    candidates, signals, features = _candidates(module, coordinates, rng)
    forces = tuple(key for key in module.SIGNALS if key.startswith(("tau_", "base_")))
    pushing = {key: signals[key] for key in forces}  # columns of gains hold what drives report
    found = candidates.also(pushing).sums(np.asarray(module.entries(signals)))
    still = {**signals, **dict.fromkeys(forces, np.zeros(len(signals[module.SIGNALS[0]])))}
    known = np.asarray(module.measurement(still)).T
    pushed = np.asarray(module.measurement(signals)).T - known
    of_forces = Candidates(pushing, {}).sums(pushed)
    of_known = candidates.sums(known)
    entries = {f"entry {line}": line for line, terms in enumerate(found) if terms is None}
    left = {f"known {row}": row for row, terms in enumerate(of_known) if terms is None}
    inputs = tuple(key for key in module.SIGNALS if key not in forces)
    kernel = ArmKernel(module, inputs, forces, entries, left)
    kept = [((1.0, f"entry {line}"),) if terms is None else terms for line, terms in enumerate(found)]
    sides = [
        (*(force or ()), *(((1.0, f"known {row}"),) if terms is None else terms))
        for row, (force, terms) in enumerate(zip(of_forces, of_known, strict=True))
    ]
    used = {key for terms in (*kept, *sides) for _, key in terms}
    lines = tuple({"key": key, "function": "kernel", "of": (), "times": None} for key in kernel.keys)
    return kept, sides, kernel, (*(one for one in features if one["key"] in used), *lines)


def _candidates(
    module: Any, coordinates: tuple[Coordinate, ...], rng: np.random.Generator
) -> tuple[Candidates, dict[str, FloatArray], tuple[dict[str, Any], ...]]:
    """Return what entries may be sums of at random samples, the module's signals there, and all features."""
    count = SAMPLES_A_CANDIDATE * (8 * len(coordinates) + 1)
    signals = {key: rng.uniform(-1.0, 1.0, count) for key in module.SIGNALS}
    summed: dict[str, FloatArray] = {"1": np.ones(count)}
    alone: dict[str, FloatArray] = {}
    features: list[dict[str, Any]] = []
    for one in coordinates:
        speed, rising = (_derivative(one, order, signals, count) for order in (1, 2))
        if not one.sum:  # speeds and accelerations of coupled motors are sums of these
            summed |= {one.keys[1]: speed, one.keys[2]: rising}
        summed[f"sign {one.name}"] = np.sign(speed)
        features.append(_feature(f"sign {one.name}", "sign", one.keys[1], None))
        for way, moves in (("forward", speed > 0.0), ("backward", speed < 0.0)):
            alone |= {
                f"{way} {one.name}": np.asarray(moves, dtype=float),
                f"{way} {one.keys[1]}": moves * speed,
            }
            features.append(_feature(f"{way} {one.name}", way, one.keys[1], None))
            features.append(_feature(f"{way} {one.keys[1]}", way, one.keys[1], one.keys[1]))
    # the first joint's position acts on nothing, nor do all others' speeds everywhere
    moving = {key: value for key, value in summed.items() if value.any()}
    still = {key: value for key, value in alone.items() if value.any()}
    return Candidates(moving, still), signals, tuple(features)


def _feature(key: str, function: str, of: str, times: str | None) -> dict[str, Any]:
    return {"key": key, "function": function, "of": of, "times": times}


def _derivative(one: Coordinate, order: int, signals: Mapping[str, FloatArray], count: int) -> FloatArray:
    """Return a speed or an acceleration at random samples; zero where the module does not read it."""
    terms = one.sum or ((1.0, f"q_{one.name}"),)
    parts = [(weight, f"{ORDERS[order]}_{key.removeprefix('q_')}") for weight, key in terms]
    return sum((weight * signals[key] for weight, key in parts if key in signals), np.zeros(count))


def _sensors(coordinates: tuple[Coordinate, ...]) -> tuple[dict[str, Any], ...]:
    return tuple(
        {
            "key": one.keys[0],
            "body": one.name,
            "deflection": None,
            "measures": "position",
            "unit": "rad" if one.revolute else "m",
        }
        for one in coordinates
    )


def _actuators(module: Any, coordinates: tuple[Coordinate, ...]) -> tuple[dict[str, Any], ...]:
    turns = {f"tau_{one.name}": one.revolute for one in coordinates}
    found = []
    for key in (key for key in module.SIGNALS if key.startswith(("tau_", "base_"))):
        base = key.startswith("base_")
        unit = "N m" if (key[5] == "n" if base else turns[key]) else "N"
        found.append({"key": key, "body": key if base else key[4:], "unit": unit, "lever": 1.0})
    return tuple(found)


def _signals(module: Any, coordinates: tuple[Coordinate, ...]) -> tuple[dict[str, Any], ...]:
    """Return position, speed and acceleration of every coordinate, and the forces."""
    found = []
    for one in coordinates:
        units = ("rad", "rad/s", "rad/s^2") if one.revolute else ("m", "m/s", "m/s^2")
        for order, (key, unit) in enumerate(zip(one.keys, units, strict=True)):
            entry = {"sensor": one.keys[0], "actuator": None, "derivative": order, "unit": unit}
            found.append({"key": key, **entry})
    for force in _actuators(module, coordinates):
        entry = {"sensor": None, "actuator": force["key"], "derivative": 0, "unit": force["unit"]}
        found.append({"key": force["key"], **entry})
    return tuple(found)


def _rows(module: Any) -> tuple[dict[str, Any], ...]:
    """Return the rows: force or torque of a joint, of a motor, or of the base."""
    kinds = {joint["name"]: joint["kind"] for joint in module.JOINTS}
    found = []
    for name in module.ROWS:
        base = name not in kinds
        turns = name.startswith("base_n") if base else kinds[name] == "revolute"
        word = "torque" if turns else "force"
        origin = f"{word} on the base" if base else f"{word} of {module.ROW_KIND} {name}"
        entry = {"bodies": (name,), "differentiated": 0, "order": 2, "reversals": (), "lever": 1.0}
        found.append({"name": name, "origin": origin, **entry, "unit": "N m" if turns else "N"})
    return tuple(found)
