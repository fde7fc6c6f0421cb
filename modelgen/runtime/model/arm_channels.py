"""What a record of an arm must bring, and the speeds whose directions its rows hold.

Of a rigid arm the positions of joints; of an arm with sensors what these read. A drive whose speed is no
single reading (a motor that moves two joints, an encoder in front of a gear) has a channel of its own, a sum
of those, so that its direction is one as any other.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from modelgen.errors import DataError
from modelgen.runtime.model.arm_kernel import Sum

COUPLED = "_motor"
# What names of channels of drives begin with; joint torques have others.
DRIVE = "tau_"
LOAD = "load_"
Entry = dict[str, Any]
_FIRST = ("position", "velocity", "acceleration")
_KINDS = {"gyro": "velocity", "accelerometer": "acceleration"}
_ORDERED = re.compile(r"d([1-3])_")


class Speed(NamedTuple):
    """A speed whose direction rows hold: its signal, and the module's signals that it is the sum of."""

    name: str
    key: str
    terms: Sum


@dataclass(frozen=True)
class ArmChannels:
    """The tables of a model that say what is read: entries as a chain's module has them.

    `forces` are the keys of signals that stand on the left: forces of motors, the base's, measured torques;
    `loads` those that say which payload is carried. `given` are speeds of motors that no sensor sees.
    """

    sensors: tuple[Entry, ...]
    actuators: tuple[Entry, ...]
    signals: tuple[Entry, ...]
    derived: Mapping[str, Sum]
    speeds: tuple[Speed, ...]
    forces: tuple[str, ...]
    loads: tuple[str, ...]
    given: tuple[Speed, ...] = ()


def arm_channels(module: Any) -> ArmChannels:
    """Return the channels of an arm's module.

    Raises
    ------
    DataError
        If the speed of a drive is a sum of positions and speeds.
    """
    return _of_sensors(module) if hasattr(module, "SENSORS") else _of_joints(module)


def also_read(channels: ArmChannels, reads: Iterable[tuple[str, int]]) -> ArmChannels:
    """Return the channels with further signals: derivatives of what is read already."""
    by_key = {one["key"]: one for one in channels.sensors}
    forces = {one["key"]: one for one in channels.actuators}
    signals = {one["key"]: one for one in channels.signals}
    for source, order in reads:
        key = differentiated(source, order)
        if source in by_key:
            signals.setdefault(key, _read(by_key[source], order))
        elif source in forces:
            signals.setdefault(key, _pushed(forces[source], order))
    return replace(channels, signals=tuple(signals.values()))


def moving(module: Any) -> list[Entry]:
    """Return the entries of an arm's joints that are not fixed, in the order of TRANSMISSION."""
    return [one for one in module.JOINTS if one["kind"] != "fixed"]


def moving_joints(module: Any) -> list[str]:
    """Return their names."""
    return [one["name"] for one in moving(module)]


def _of_joints(module: Any) -> ArmChannels:
    joints = moving(module)
    sensors = [_sensor(f"q_{j['name']}", j["name"], "position", j["kind"] == "revolute") for j in joints]
    speeds = [Speed(j["name"], f"d1_q_{j['name']}", ((1.0, f"d1_q_{j['name']}"),)) for j in joints]
    derived: dict[str, Sum] = {}
    for index, row in enumerate(module.TRANSMISSION):
        moved = [(ratio, place) for place, ratio in enumerate(row) if ratio]
        if len(moved) > 1:
            own, name = row[index] or moved[0][0], joints[index]["name"] + COUPLED
            lever = tuple((ratio / own, f"q_{joints[place]['name']}") for ratio, place in moved)
            derived[f"q_{name}"] = lever
            speeds.append(Speed(name, f"d1_q_{name}", tuple((r, f"d1_{key}") for r, key in lever)))
            sensors.append(_sensor(f"q_{name}", name, "position", joints[index]["kind"] == "revolute"))
    signals = [_read(sensor, order) for sensor in sensors for order in (0, 1, 2)]
    forces = _actuators(module)
    signals += [_pushed(force, 0) for force in forces]
    keys, loads = (tuple(k for k in module.SIGNALS if k.startswith(s)) for s in ((DRIVE, "base_"), LOAD))
    signals += [_carried(key) for key in loads]
    return ArmChannels(tuple(sensors), tuple(forces), tuple(signals), derived, tuple(speeds), keys, loads)


def _of_sensors(module: Any) -> ArmChannels:
    estimated = getattr(module, "ESTIMATED", {})  # no sensor has them
    sensors = [
        one for sensor in module.SENSORS for one in _sensors(module, sensor) if one["key"] not in estimated
    ]
    forces = _actuators(module)
    by_key = {one["key"]: one for one in sensors}
    pushing = {one["key"]: one for one in forces}
    signals: dict[str, Entry] = {}
    loads = tuple(key for key in module.SIGNALS if key.startswith(LOAD) and key not in by_key)
    for key in module.SIGNALS:
        if key in loads:
            signals[key] = _carried(key)
            continue
        channel, order = _split(key)
        if channel in estimated:
            continue
        made = _pushed(pushing[channel], order) if channel in pushing else _read(by_key[channel], order)
        signals[key] = made
    speeds, given, derived = [], [], {}
    for name, terms in module.SPEEDS.items():
        key = _speed_key(terms, [*by_key, *pushing], name)
        sums = tuple((factor, differentiated(channel, times)) for factor, channel, times in terms)
        if any(channel in estimated for _, channel, _ in terms):
            given.append(Speed(name, differentiated(key, 1), sums))
            continue
        if key not in by_key:
            times = _times(module, name, terms)
            derived[key] = tuple((factor, channel) for factor, channel, _ in terms)
            turns = _turns(module, name) or _turns(module, name.removesuffix(COUPLED))
            by_key[key] = _sensor(key, f"{name} motor", ("velocity", "position")[times], turns)
            sensors.append(by_key[key])
        speed = differentiated(key, 1 if by_key[key]["measures"] == "position" else 0)
        signals.setdefault(speed, _read(by_key[key], _split(speed)[1]))
        speeds.append(Speed(name, speed, sums))
    left = tuple(key for key, one in signals.items() if one["actuator"] is not None)
    every = tuple(signals.values())
    return ArmChannels(
        tuple(sensors), tuple(forces), every, derived, tuple(speeds), left, loads, tuple(given)
    )


def _speed_key(terms: tuple[tuple[float, str, int], ...], taken: list[str], name: str) -> str:
    """Return the channel of a drive's speed: the one that reads it, or a name for the sum."""
    if len(terms) == 1 and terms[0][0] == 1.0:
        return terms[0][1]
    key = f"motor_{name}"
    while key in taken:
        key += "_"
    return key


def _times(module: Any, name: str, terms: tuple[tuple[float, str, int], ...]) -> int:
    """Return how often the channels of a drive's speed are differentiated, all of them alike."""
    often = {times for *_, times in terms}
    if len(often) > 1:
        raise DataError.at(
            f"{module.ARM}: sensors of {module.SENSOR_SET}",
            f"give the speed of motor {name} as a sum of positions and speeds",
            "give all motors that move its joints the same kind of sensor",
        )
    return often.pop()


def _sensors(module: Any, sensor: Mapping[str, Any]) -> Iterator[Entry]:
    """Yield what a sensor reads; measured torques are no motion."""
    name, side, measures = sensor["joint"], sensor["side"], sensor["measures"]
    if measures == "torque":
        return
    turns = measures != "accelerometer" and (measures == "gyro" or _turns(module, name))
    kind = _KINDS.get(measures, measures)
    for channel in sensor["channels"]:
        if side == "deflection":
            yield _sensor(channel, None, kind, turns) | {"deflection": (f"{name} motor", name)}
        elif measures in ("gyro", "accelerometer"):
            yield _sensor(channel, f"link {name} {channel[-1]}", kind, turns)
        else:
            yield _sensor(channel, f"{name} motor" if side == "motor" else name, kind, turns)


def _sensor(key: str, body: str | None, measures: str, turns: bool) -> Entry:
    unit = _per_s("rad" if turns else "m", _FIRST.index(measures))
    return {"key": key, "body": body, "deflection": None, "measures": measures, "unit": unit}


def _actuators(module: Any) -> list[Entry]:
    """Return the forces of motors and of the base that are read, and the torques of joints."""
    read = dict.fromkeys(_split(key)[0] for key in module.SIGNALS)
    torques = {s["key"]: s["joint"] for s in getattr(module, "SENSORS", ()) if s["measures"] == "torque"}
    found = []
    for key in read:
        if key in torques:
            found.append(_force(key, torques[key], _turns(module, torques[key])))
        elif key.startswith("base_"):
            found.append(_force(key, key, key[5] == "n"))
        elif key.startswith(DRIVE):
            found.append(_force(key, key[4:], _turns(module, key[4:]), gear(module, key[4:])))
    return found


def _force(key: str, body: str, turns: bool, lever: float = 1.0) -> Entry:
    return {"key": key, "body": body, "unit": "N m" if turns else "N", "lever": lever}


def gear(module: Any, joint: str) -> float:
    """Return what a motor's force is multiplied by at the joints that it moves, at most."""
    return float(max(map(abs, module.TRANSMISSION[moving_joints(module).index(joint)])))


def _turns(module: Any, joint: str) -> bool:
    return any(one["name"] == joint and one["kind"] != "prismatic" for one in module.JOINTS)


def _read(sensor: Entry, order: int) -> Entry:
    """Return the signal of a sensor's channel, differentiated so many times."""
    first = _FIRST.index(sensor["measures"])
    unit = _per_s("rad" if sensor["unit"].startswith("rad") else "m", first + order)
    return _signal(differentiated(sensor["key"], order), sensor["key"], None, order, unit)


def _pushed(force: Entry, order: int) -> Entry:
    unit = _per_s(force["unit"], order)
    return _signal(differentiated(force["key"], order), None, force["key"], order, unit)


def _carried(key: str) -> Entry:
    """Return the signal that is 1 while the arm carries a payload, and else 0."""
    return _signal(key, None, None, 0, "1")


def _per_s(unit: str, order: int) -> str:
    return unit + ("", "/s", f"/s^{order}")[min(order, 2)]


def _signal(key: str, sensor: str | None, actuator: str | None, derivative: int, unit: str) -> Entry:
    return {"key": key, "sensor": sensor, "actuator": actuator, "derivative": derivative, "unit": unit}


def differentiated(channel: str, times: int) -> str:
    """Return the key of a channel's derivative, as modules write it: d2_q_m."""
    return f"d{times}_{channel}" if times else channel


def _split(key: str) -> tuple[str, int]:
    """Return the channel of a signal, and how often it is differentiated."""
    match = _ORDERED.match(key)
    return (key[match.end() :], int(match[1])) if match else (key, 0)
