"""Rows that the sensors of a set give: differentiated until all in them can be read, or left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from modelgen.errors import ModelError, listed
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.balances import Balance
from modelgen.symbolic.arms.drives import motor_coordinate
from modelgen.symbolic.arms.expressions.derivative import time_derivatives
from modelgen.symbolic.arms.expressions.graph import Graph, Ref, Symbol
from modelgen.symbolic.arms.row_parts import RowParts
from modelgen.symbolic.arms.sensed.sensing import ArmSensing

#: Kind, name and order of a symbol that sensors give.
Channel = Symbol
#: A sum of channels: (channel, how often it is differentiated, how often it counts).
Channels = tuple[tuple[str, int, Fraction], ...]
#: A speed, differentiated once: farther the links' rows hold angles still, and springs need positions.
MOST_DIFFERENTIATIONS = 1
NEVER = MOST_DIFFERENTIATIONS + 1
CONSTANT = "constant between reversals, and its rows are differentiated: measure positions"


@dataclass(frozen=True)
class ReadRows:
    """Rows, how often each is differentiated, what they read; the others as `ArmRows` has them."""

    rows: tuple[Balance, ...]
    differentiated: tuple[int, ...]
    reversals: tuple[tuple[str, ...], ...]
    channels: Mapping[Channel, Channels] = field(default_factory=dict)
    lost: Mapping[str, str] = field(default_factory=dict)
    lacking: str = ""

    def independent(self) -> ReadRows:
        """Return the same without rows that are sums of others, differentiated no less often."""
        often = dict(zip((row.name for row in self.rows), self.differentiated, strict=True))
        kept = [
            place
            for place, row in enumerate(self.rows)
            if not row.sum_of or any(often.get(one, NEVER) > often[row.name] for one in row.sum_of)
        ]
        return replace(
            self,
            rows=tuple(self.rows[place] for place in kept),
            differentiated=tuple(self.differentiated[place] for place in kept),
            reversals=tuple(self.reversals[place] for place in kept),
        )


def as_they_are(rows: Sequence[Balance]) -> ReadRows:
    """Return rows of which everything is measured."""
    return ReadRows(tuple(rows), (0,) * len(rows), ((),) * len(rows))


def readable_rows(
    graph: Graph, spec: ArmSpec, parts: RowParts, rows: Sequence[Balance], sensing: ArmSensing, where: str
) -> ReadRows:
    """Return the rows that can be read from sensors, each differentiated as few times as possible.

    Raises
    ------
    ModelError
        If there is none; with the sensors that would give one.
    """
    chosen: list[tuple[Balance, int]] = []
    jumping: list[tuple[str, ...]] = []
    channels: dict[Channel, Channels] = {}
    missing: dict[str, list[Channel]] = {}
    for row in rows:
        tried = row
        for times in range(MOST_DIFFERENTIATIONS + 1):
            # what jumps where a motor reverses is lost by differentiation, and must be seen
            turned = _directions(graph, row) if times else ()
            needed = _needed(graph, tried, parts, turned)
            read = {symbol: _read(sensing, symbol) for symbol in needed}
            lacking = [symbol for symbol, found in read.items() if found is None]
            if not lacking and (tried.entries or any(symbol.kind == "reading" for symbol in needed)):
                chosen.append((tried, times))
                jumping.append(turned)
                channels |= {symbol: found for symbol, found in read.items() if found is not None}
                break
            if not times:
                missing[row.name] = lacking
            tried = _differentiated(graph, tried)
    if not chosen:
        raise _none(spec, missing, where)
    kept = {column for row, _ in chosen for column in row.entries}
    reasons = {parts.columns[c]: needs for c, needs in _lost(rows, chosen, missing).items() if c not in kept}
    lost = {name: f"needs {_what(spec, needs)}" if needs else CONSTANT for name, needs in reasons.items()}
    together = [symbol for needs in reasons.values() for symbol in needs]
    said = [f"needs {_what(spec, together)}"] if together else []
    said += [CONSTANT] if CONSTANT in lost.values() else []
    often = tuple(times for _, times in chosen)
    kept_rows = tuple(row for row, _ in chosen)
    return ReadRows(kept_rows, often, tuple(jumping), channels, lost, "; ".join(said))


def _lost(
    rows: Sequence[Balance], chosen: Sequence[tuple[Balance, int]], missing: Mapping[str, Sequence[Channel]]
) -> dict[int, Sequence[Channel]]:
    """Return what the nearest row to each column lacks; nothing where it is lost by differentiation."""
    names = [row.name for row, _ in chosen]
    nearest = sorted(rows, key=lambda row: (row.name in names, -len(missing.get(row.name, ()))))
    return {
        column: () if row.name in names else missing[row.name] for row in nearest for column in row.entries
    }


def _directions(graph: Graph, row: Balance) -> tuple[str, ...]:
    """Return the names of the speeds whose directions a row holds."""
    nodes = (graph.nodes[index].symbol for index in graph.needed([*row.entries.values()]))
    return tuple(dict.fromkeys(s.name for s in nodes if s is not None and s.kind == "direction"))


def _needed(graph: Graph, row: Balance, parts: RowParts, turned: Sequence[str]) -> list[Channel]:
    """Return what a row is made of that sensors must give, angles as positions; forces always are.

    `turned` are speeds that must be read besides those whose directions the row holds.
    """
    refs = [*row.entries.values(), row.measured]
    found: dict[Channel, None] = {}
    nodes = [graph.nodes[index].symbol for index in graph.needed(refs)]
    speeds = [parts.speeds[name] for name in dict.fromkeys((*_directions(graph, row), *turned))]
    nodes += [graph.nodes[index].symbol for index in graph.needed(speeds)]
    for symbol in nodes:
        if symbol is None:
            continue
        if symbol.kind in ("cosine", "sine"):
            found[Symbol("position", symbol.name)] = None
        elif symbol.kind in ("position", "torque", "reading"):
            found[symbol] = None
    return list(found)


def _read(sensing: ArmSensing, symbol: Channel) -> Channels | None:
    if symbol.kind == "torque":
        return ((sensing.torques[symbol.name], symbol.order, Fraction(1)),)
    if symbol.kind == "reading":
        return ((symbol.name, symbol.order, Fraction(1)),)
    return sensing.channels(symbol.name, symbol.order)


def _differentiated(graph: Graph, row: Balance) -> Balance:
    columns = list(row.entries)
    *rates, measured = time_derivatives(graph, [*row.entries.values(), row.measured])
    entries: dict[int, Ref] = {c: rate for c, rate in zip(columns, rates, strict=True) if rate}
    return replace(row, entries=entries, measured=measured)


def _none(spec: ArmSpec, missing: Mapping[str, Sequence[Channel]], where: str) -> ModelError:
    """Return the error that names what the nearest row needs, and the sensors with which it can be read."""
    needed = _lowest(min(missing.values(), key=lambda symbols: (len(_lowest(symbols)), len(symbols))))
    what = f"give no row: the nearest one needs {_what(spec, needed)}"
    sensors = " and ".join(_sensor(spec, symbol) for symbol in needed)
    return ModelError.at(
        where, what, f"add {'sensors' if len(needed) > 1 else 'a sensor'}, for example {sensors}"
    )


def _what(spec: ArmSpec, symbols: Sequence[Channel]) -> str:
    """Return in words what symbols are of: the positions of links 1 and 2, the speed of motor 1."""
    motors = {motor_coordinate(joint): joint.name for joint in spec.moving if joint.elastic}
    groups: dict[tuple[int, str], list[str]] = {}
    for symbol in _lowest(symbols):
        side = "motor" if symbol.name in motors else "link"
        groups.setdefault((min(symbol.order, 1), side), []).append(motors.get(symbol.name, symbol.name))
    words = []
    for (order, side), names in groups.items():
        many = "s" if len(names) > 1 else ""
        words.append(
            f"the {'speed' if order else 'position'}{many} of {side}{many} {listed(sorted(names), most=6)}"
        )
    return " and ".join(words)


def _lowest(symbols: Sequence[Channel]) -> list[Channel]:
    """Return the least differentiated symbol of every coordinate: what gives it gives its derivatives."""
    found: dict[str, Channel] = {}
    for symbol in symbols:
        if symbol.order < found.get(symbol.name, symbol).order or symbol.name not in found:
            found[symbol.name] = symbol
    return list(found.values())


def _sensor(spec: ArmSpec, symbol: Channel) -> str:
    motors = {motor_coordinate(joint): joint.name for joint in spec.moving if joint.elastic}
    side = "motor" if symbol.name in motors else "link"
    name = motors.get(symbol.name, symbol.name)
    measures = "velocity" if symbol.order else "position"
    key = f"{'qm' if side == 'motor' else 'q'}_{name}"
    return f'{key} = {{ joint = "{name}", side = "{side}", measures = "{measures}" }}'
