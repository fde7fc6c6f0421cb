"""Factors of units: between sensors of one motion, and between an estimate and the values expected.

Only a wrong unit explains a thousand, or degrees in a radian where springs let two bodies move as one; only a
wrong sign that they move against each other then. A deflection does not grow with the way that both have
gone: where the difference of two positions does, the spec's ratio or a scale is wrong, by however little.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations, pairwise

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.samples.low_frequencies import (
    Ratios,
    alike_lines,
    low_frequency_ratios,
)
from modelgen.runtime.diagnostics.thresholds import (
    ALIKE,
    APART,
    FALLING,
    FEW_SENSORS,
    FIRST_BIN,
    OFF,
    REVERSED,
    SAME,
    SAME_FACTOR,
    SMALLEST_BAND,
    TURNED_UNITS,
    UNIT_FACTOR,
    UNIT_TOLERANCE,
    WAY_OF_ITS_OWN,
    WAY_POINTS,
    WAY_SHARE,
)
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import rigid_motion

OF_RATIOS = "check the ratios of links in the spec, and the scale of both"


def unlike_units(model: Model, record: Record, keys: Collection[str]) -> Iterator[Advice]:
    """Yield an advice for every two of the named sensors that contradict each other absurdly."""
    levers = _levers(model)
    sensors = [sensor for sensor in model.sensors if sensor.body in levers and sensor.key in keys]
    # along a long chain a wrong unit shows between neighbours
    pairs = combinations(sensors, 2) if len(sensors) <= FEW_SENSORS else pairwise(sensors)
    moves = rigid_motion(model) if len(sensors) > 1 and not model.is_arm else {}
    for one, other in pairs:
        found = low_frequency_ratios(record, one, other)
        where = f"{record.name}, channel {other.key}, samples 0 to {record.n - 1}"
        if found is None:
            continue
        # a body's lever is how far it moves when the chain moves as one
        ratios = found.values * levers[str(one.body)] / levers[str(other.body)]
        ratio = float(np.median(ratios))
        # beyond a resonance a body moves the less the faster the motion is, and the other way
        falls = float(np.ptp(np.log(np.abs(ratios)))) > np.log(FALLING)
        as_one = not falls and moves_as_one(model) and not _may_be_held(model, record, (one, other), levers)
        known = _known_factor(one, other, abs(ratio)) if as_one else ""
        if known or not (falls or 1.0 / UNIT_FACTOR < abs(ratio) < UNIT_FACTOR):
            other_unit = f"one of them may be in {known}" if known else "one of them has another unit"
            what = f"moves {_times(abs(ratio))} what {one.key} says at low frequencies: {other_unit}"
            meant = known or "mm for m?"
            yield Advice("unit", where, what, f"check the units of both ({meant}), and scale to SI")
        elif as_one and (off := _off_ratio(ratios, found)):
            what = f"moves {off:.4g} times as far at low frequencies as {one.key} and the spec's ratios say"
            yield Advice("unit", where, what, OF_RATIOS)
        elif as_one and (off := _off_way(record, (one, other), levers, moves)):
            what = f"moves {off:.5g} times as far as {one.key} and the spec's ratios say, the farther both go"
            yield Advice("unit", where, what, OF_RATIOS)
        # gears may turn two bodies against each other, and beyond a resonance, or about one that friction
        # holds, bodies do
        turned = moves.get(str(one.body), 1.0) * moves.get(str(other.body), 1.0)
        if as_one and 1.0 / REVERSED < abs(ratio) < REVERSED and ratio * turned < 0.0:
            what = f"moves against {one.key} at low frequencies: one of them is reversed in sign"
            yield Advice("swapped", where, what, "check the signs of both (--map)")


def _levers(model: Model) -> dict[str, float]:
    """Return how far bodies move when the chain moves as one, those of rows and of actuators."""
    levers = {row.bodies[0]: row.lever for row in model.rows}
    return levers | {actuator.body: actuator.lever for actuator in model.actuators}


def _may_be_held(
    model: Model, record: Record, pair: tuple[Sensor, Sensor], levers: Mapping[str, float]
) -> bool:
    """Tell whether friction may hold another body than two that sensors see move.

    Springs bend between a motor that sticks and a load that is moved: other bodies go a part of the way then
    that is no matter of gears. A body that a sensor sees move along is not held; without one, a body that the
    spec gives no dry friction is not.
    """
    own = {one.body for one in pair}
    seen = [one for one in model.sensors if one.body in levers and one.key in record.signals]
    others = [one for one in seen if one.body not in own]
    held = {role.bodies[0] for role in model.roles.values() if role.role == "coulomb"}
    held |= {str(one.body) for one in others}
    held -= {str(one.body) for one in others if _goes_along(record, pair, one, levers)}
    return bool(held - own)


def _goes_along(
    record: Record, pair: tuple[Sensor, Sensor], third: Sensor, levers: Mapping[str, float]
) -> bool:
    """Tell whether a sensor reads as much slow motion, by gears, as one of two others nearly does."""
    parts = []
    for sensor in pair:
        lines = alike_lines(record, sensor, third)
        size = [float(np.linalg.norm(one[FIRST_BIN : FIRST_BIN + SMALLEST_BAND])) for one in lines]
        parts.append(size[1] / levers[str(third.body)] * levers[str(sensor.body)] - size[0] / REVERSED)
    return max(parts) > 0.0


def amplitudes_off(model: Model, records: Sequence[Record], one: Sensor, other: Sensor) -> float | None:
    """Return how far amplitudes of two sensors at low frequencies are from what gears say, a logarithm.

    Noise of one of them is in it, which lets them differ by less than other channels in their place do. Of
    records the worst; None of a chain that does not move as one.
    """
    levers = _levers(model)
    if model.is_arm or not moves_as_one(model) or not {one.body, other.body} <= levers.keys():
        return None
    found = [0.0]
    for record in records:
        band = slice(FIRST_BIN, FIRST_BIN + SMALLEST_BAND)
        first, second = (
            float(np.linalg.norm(lines[band])) / levers[str(sensor.body)]
            for lines, sensor in zip(alike_lines(record, one, other), (one, other), strict=True)
        )
        found.append(abs(float(np.log(second / first))) if first and second else np.inf)
    return max(found)


def _off_ratio(ratios: FloatArray, found: Ratios) -> float | None:
    """Return the ratio that slow motion tends to, where neither a resonance above nor noise explains that.

    `ratios` are those that are `found` with levers in account, shape (bands,).
    """
    logs = np.log(np.abs(ratios))
    bent, above = np.abs(np.diff(logs))[:2].tolist()
    # a resonance bends it more the higher the bands are; noise bends the lowest of an acceleration
    explained = bent if bent <= above + OFF else np.inf
    # far below it as the square of the frequency does
    first, second = found.squares[:2].tolist()
    still = float(logs[0] - (logs[1] - logs[0]) * first / (second - first))
    certain = min(abs(logs[0]), abs(still)) > OFF + explained + found.noise[0]
    return float(np.exp(still)) if certain else None


def _off_way(
    record: Record, pair: tuple[Sensor, Sensor], levers: Mapping[str, float], moves: Mapping[str, float]
) -> float | None:
    """Return how many times as far as the spec says the second of two positions goes, where that is certain.

    None also beyond a factor of two, where it is no ratio. Their difference is compared with the way, beyond
    what springs bend by inertia, friction and damping, and what a delay or a zero is: the acceleration, the
    speed and its sign, a constant. A motion whose way these explain (one slow sine) says nothing.
    """
    if any(sensor.measures != "position" for sensor in pair) or not moves:
        return None
    ways = [record.facts.stretches(sensor.key) for sensor in pair]
    most = int(np.argmax([np.ptp(part) for part in ways[0]]))
    points = -(-len(ways[0][most]) // WAY_POINTS)
    first, second = (
        np.mean(part[most][: len(part[most]) // points * points].reshape(-1, points), axis=1)
        * np.sign(moves[str(sensor.body)])
        / levers[str(sensor.body)]
        for part, sensor in zip(ways, pair, strict=True)
    )
    speed = np.gradient(first)
    others = np.column_stack([np.ones_like(first), speed, np.sign(speed), np.gradient(speed)])
    basis = np.linalg.qr(others / np.maximum(np.max(np.abs(others), axis=0), np.finfo(float).tiny))[0]
    way, apart = (one - basis @ (basis.T @ one) for one in (first, second - first))
    whole, own, left = float(np.var(first) * len(first)), float(way @ way), float(apart @ apart)
    if own <= WAY_OF_ITS_OWN * whole:
        return None
    off = float(way @ apart) / own
    certain = abs(off) > APART and off**2 * own > WAY_SHARE * left
    return 1.0 + off if certain and 1.0 / REVERSED < 1.0 + off < REVERSED else None


def _known_factor(one: Sensor, other: Sensor, ratio: float) -> str:
    """Return in which unit one of two sensors is whose ratio only that accounts for, empty for none."""
    units = [TURNED_UNITS.get(sensor.unit, {}) for sensor in (one, other)]
    for factor, unit in {**units[0], **units[1]}.items() if all(units) else ():
        if abs(abs(np.log(ratio)) - np.log(factor)) < UNIT_TOLERANCE:
            return unit
    return ""


def moves_as_one(model: Model) -> bool:
    """Return whether a chain moves as one where it moves slowly: no spring holds it to ground."""
    springs = (role for role in model.roles.values() if role.role in ("stiffness", "stiffness3"))
    return all(len(role.bodies) > 1 for role in springs)


def unlike_nominal(model: Model, physical: Mapping[str, float], records: Sequence[str]) -> tuple[Advice, ...]:
    """Return an advice where inertias and stiffnesses are absurdly far from every parameter set: all by about
    the same, or inertias alone, as a wrong unit of times does.

    Parameters
    ----------
    model : Model
    physical : mapping of str to float
        Values found, SI.
    records : sequence of str
        Names of the records.
    """
    roles = {name: role.role for name, role in model.roles.items()}
    found = {n: v for n, v in physical.items() if roles.get(n) in ("inertia", "stiffness") and v > 0.0}
    ratios, limits, times = list[float](), list[float](), list[float]()
    for values in model.parameter_sets.values():
        logs = {name: np.log10(found[name] / values[name]) for name in found if values.get(name, 0.0) > 0.0}
        inertias, springs = ([logs[n] for n in logs if roles[n] == r] for r in ("inertia", "stiffness"))
        if springs and inertias and _is_same(inertias) and _is_same([*springs, 0.0]):
            times.append(float(10.0 ** (0.5 * np.mean(inertias))))
        every = [*logs.values()]
        if every and np.ptp(every) <= np.log10(ALIKE):
            ratios.append(float(10.0 ** np.mean(every)))
            # no guess is off by the same in everything
            limits.append(SAME_FACTOR if len(every) > 1 and _is_same(every) else UNIT_FACTOR)
    where = f"{', '.join(records)}, channels {', '.join(model.channels)}"
    say = f"what the spec's parameter sets say ({', '.join(model.parameter_sets)})"
    if _are_beyond(times, [SAME_FACTOR] * len(times), model):
        of, longer = ", ".join(name for name in found if roles[name] == "inertia"), _nearest(times)
        off = f"{max(longer, 1.0 / longer):.4g} times too {'long' if longer > 1.0 else 'short'}"
        what = f"give {of} {_times(longer**2)} {say}, and stiffnesses as there: as times do that are {off}"
        remedy = "check the sampling frequency and the unit of times (--fs, --time-unit)"
        return (Advice("unit", where, what, remedy),)
    if not _are_beyond(ratios, limits, model):
        return ()
    what = f"give {', '.join(found)} {_times(_nearest(ratios))} {say}"
    return (Advice("unit", where, what, "check the units of forces and sensors, and scale them to SI"),)


def _is_same(logs: Sequence[float]) -> bool:
    return bool(np.ptp(logs) < np.log10(SAME))


def _are_beyond(ratios: Sequence[float], limits: Sequence[float], model: Model) -> bool:
    """Return whether every parameter set has a ratio that is beyond its limit."""
    beyond = [not 1.0 / limit < ratio < limit for ratio, limit in zip(ratios, limits, strict=True)]
    return 0 < sum(beyond) == len(model.parameter_sets)


def _nearest(ratios: Sequence[float]) -> float:
    return min(ratios, key=lambda ratio: abs(np.log(ratio)))


def _times(ratio: float) -> str:
    return f"{ratio:.4g} times" if ratio > 1.0 else f"1/{1.0 / ratio:.4g} of"
