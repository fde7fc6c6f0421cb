"""An arm's rows as the sensors of its set give them: coordinates replaced by sums of their readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from modelgen.render.arms.kernel_names import kernel_names, load_name
from modelgen.spec.arms.arm import ArmSensor
from modelgen.symbolic.arms.arm_rows import ArmRows
from modelgen.symbolic.arms.drives import drives
from modelgen.symbolic.arms.expressions.derivative import substituted
from modelgen.symbolic.arms.expressions.graph import Direction, Graph, Ref, Symbol

_REVERSED: Mapping[Direction, Direction] = {"forward": "backward", "backward": "forward"}
_INITIALS = {"link": "q", "motor": "p"}


@dataclass(frozen=True)
class SensorReadings:
    """What is computed, made of readings.

    Attributes
    ----------
    refs
        The references that were asked for.
    names
        As `kernel_names` has them.
    speeds
        Speeds whose directions are needed, by name, none of them negative.
    angles
        What stands for the coordinate in its cosine and sine, by joint; none of them negative.
    signals
        What may be read, in order.
    """

    refs: tuple[Ref, ...]
    names: Mapping[int, str]
    speeds: Mapping[str, Ref]
    angles: Mapping[str, Ref]
    signals: tuple[Symbol, ...]


def from_sensors(rows: ArmRows, refs: Sequence[Ref]) -> SensorReadings:
    """Return references that are made of coordinates as ones that are made of the sensors' readings."""
    names = kernel_names(rows)
    if not rows.sensor_set:
        moving = [joint.name for joint in rows.spec.moving]
        order = [Symbol("position", name, k) for name in moving for k in (0, 1, 2)]
        order += [Symbol("force", name) for name in (*moving, *rows.base_names)]
        return SensorReadings(tuple(refs), names, rows.speeds, {}, (*order, *_loads(rows)))
    graph = rows.graph
    values = {symbol: _sum(graph, channels) for symbol, channels in rows.channels.items()}
    # a symbol of a direction, a cosine or a sine is that of a positive node
    angles = {s.name: ref for s, ref in values.items() if s.kind == "position" and not s.order}
    values |= {Symbol("sine", n): -graph.symbol(Symbol("sine", n)) for n, ref in angles.items() if ref < 0}
    speeds = dict(zip(rows.speeds, substituted(graph, [*rows.speeds.values()], values), strict=True))
    for name, ref in speeds.items():
        if ref < 0:
            values[Symbol("direction", name, of="sign")] = -graph.symbol(Symbol("direction", name, of="sign"))
            for one, other in _REVERSED.items():
                values[Symbol("direction", name, of=one)] = graph.symbol(Symbol("direction", name, of=other))
    signals = _signals(rows)
    known = {graph.symbol(symbol): _local(rows, symbol) for symbol in signals}
    moved = substituted(graph, list(names), values)
    for (old, name), ref in zip(names.items(), moved, strict=True):
        symbol = graph.nodes[old].symbol
        if abs(ref) > 1 and (symbol is None or symbol.kind in ("cosine", "sine")):
            known.setdefault(abs(ref), name)
    return SensorReadings(
        tuple(substituted(graph, refs, values)),
        known,
        {name: abs(ref) for name, ref in speeds.items()},
        {name: abs(ref) for name, ref in angles.items()},
        signals,
    )


def _sum(graph: Graph, channels: Sequence[tuple[str, int, Fraction]]) -> Ref:
    return graph.total(
        graph.scale(factor, graph.symbol(Symbol("reading", key, times))) for key, times, factor in channels
    )


def _signals(rows: ArmRows) -> tuple[Symbol, ...]:
    """Return all readings that rows may need in the order of the file, behind them the forces."""
    read = {(key, times) for channels in rows.channels.values() for key, times, _ in channels}
    highest = max((times for _, times in read), default=0)
    keys = [key for sensor in rows.sensors for key in sensor.channels]
    found = [Symbol("reading", key, n) for key in keys for n in range(highest + 1) if (key, n) in read]
    names = [*(joint.name for joint in rows.spec.moving), *rows.base_names]
    orders = range(1 + max(rows.differentiated))
    forces = (Symbol("force", name, order) for name in names for order in orders)
    return (*found, *forces, *_loads(rows))


def _loads(rows: ArmRows) -> tuple[Symbol, ...]:
    return tuple(Symbol("load", payload.name) for payload in rows.spec.payloads)


def _local(rows: ArmRows, symbol: Symbol) -> str:
    """Return how operations call a signal: q3, p3 for links and motors, y and a number for others."""
    front = f"d{symbol.order}_" if symbol.order else ""
    numbers = {joint.name: n for n, joint in enumerate(rows.spec.joints, start=1)}
    if symbol.kind == "load":
        return load_name(rows, symbol.name)
    if symbol.kind == "force":
        return front + (symbol.name if symbol.name in rows.base_names else f"tau{numbers[symbol.name]}")
    channels = [(key, sensor) for sensor in rows.sensors for key in sensor.channels]
    place, (_, sensor) = next((k, c) for k, c in enumerate(channels, start=1) if c[0] == symbol.name)
    if _first_encoder(rows, sensor):
        return f"{front}{_INITIALS[sensor.side]}{numbers[sensor.joint]}"
    return f"{front}y{place}"


def _first_encoder(rows: ArmRows, sensor: ArmSensor) -> bool:
    if sensor.measures != "position" or sensor.side not in _INITIALS:
        return False
    alike = (
        s for s in rows.sensors if (s.joint, s.side, s.measures) == (sensor.joint, sensor.side, "position")
    )
    return next(alike).key == sensor.key


def drive_speeds(rows: ArmRows) -> dict[str, tuple[tuple[Fraction, str, int], ...]]:
    """Return the speed of every drive that the rows can read as (factor, channel, times differentiated)."""
    found = {}
    for drive in drives(rows.spec):
        total: dict[tuple[str, int], Fraction] = {}
        read = [(ratio, rows.channels.get(Symbol("position", name, 1))) for name, ratio in drive.lever]
        for ratio, channels in read:
            for key, times, factor in channels or ():
                total[key, times] = total.get((key, times), Fraction(0)) + ratio * factor
        if all(channels is not None for _, channels in read):
            found[drive.speed_name] = tuple((f, *place) for place, f in total.items() if f)
    return found
