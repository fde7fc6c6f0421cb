"""Rows where no sensor sees one end of a spring: its deflection follows from what the spring carries.

Where the link is hidden, q = q_m - (Gamma - drive) / K, or q_m - torque / K where the torque is measured.
Where the motor is, q_m = q + links / K, or q + torque / K. That row is then used up (`Estimated`), and the
others hold with the position that it gives: linear in the remaining parameters for given springs, so that all
are found together by separable least squares. What gyros and accelerometers on such links read is one row an
axis, reading = motion of the link: it holds no parameter but those that give the position.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from modelgen.errors import ModelError
from modelgen.spec.arms.arm import INERTIAL, ArmSensor, ArmSpec, Joint
from modelgen.symbolic.arms.balances import Balance
from modelgen.symbolic.arms.drives import motor_coordinate
from modelgen.symbolic.arms.expressions.graph import Graph, Symbol
from modelgen.symbolic.arms.kinematics import felt, link_motions
from modelgen.symbolic.arms.readable_rows import ReadRows, readable_rows
from modelgen.symbolic.arms.row_parts import RowParts
from modelgen.symbolic.arms.sensing import Sensing

#: Behind the name of a joint: the row that its link's, or its motor's, position is made of.
DEFLECTED, DRIVEN = " deflected", " driven"


class Estimated(NamedTuple):
    """A channel that no sensor has, the position of a link or a deflection, and the row that gives it."""

    channel: str
    row: str


class _Hidden(NamedTuple):
    """A joint of which one end of the spring is not seen, the row that says where, its name, and a sensor."""

    joint: Joint
    row: str
    given: str
    sensor: ArmSensor

    @property
    def behind(self) -> bool:
        """Whether it is the link's end."""
        return self.sensor.side == "link"


def sensed_rows(
    graph: Graph,
    spec: ArmSpec,
    parts: RowParts,
    rows: Sequence[Balance],
    sensors: tuple[ArmSensor, ...],
    where: str,
) -> tuple[ReadRows, tuple[ArmSensor, ...], tuple[Estimated, ...]]:
    """Return the rows that sensors give: linear ones, and those of links or motors that no sensor sees.

    Returns
    -------
    ReadRows
    tuple of ArmSensor
        The sensors, behind them those that would read what is estimated.
    tuple of Estimated

    Raises
    ------
    ModelError
        If there is no row; with the sensors that would give one.
    """
    sensing = Sensing(spec, sensors)
    hidden = _hidden(spec, sensing, sensors)
    if not hidden:
        return readable_rows(graph, spec, parts, rows, sensing, where), sensors, ()
    used = {one.row: one for one in hidden}
    every = (*sensors, *(one.sensor for one in hidden))
    further = _felt(graph, spec, sensing, sensors, {one.joint.name for one in hidden if one.behind})
    seen = readable_rows(graph, spec, parts, [*rows, *further], Sensing(spec, every), where)
    try:
        linear = readable_rows(graph, spec, parts, rows, sensing, where)
    except ModelError:
        linear = ReadRows((), (), ())
    names = {row.name for row in linear.rows}
    kept = list(zip(linear.rows, linear.differentiated, linear.reversals, strict=True))
    springs = {c for one in hidden for c in parts.springs[one.joint.name]}
    giving = []
    for row, times, turned in zip(seen.rows, seen.differentiated, seen.reversals, strict=True):
        if row.name in used and not times:
            giving.append((replace(row, name=used[row.name].given), 0, ()))
        # a row of motors with such springs repeats the one with what these carry
        elif row.name not in names and not times and springs.isdisjoint(row.entries):
            kept.append((row, 0, turned))
    if len(kept) == len(linear.rows) or len(giving) < len(used):
        return readable_rows(graph, spec, parts, rows, sensing, where), sensors, ()
    chosen, often, reversals = zip(*kept, *giving, strict=True)
    estimated = tuple(Estimated(one.sensor.key, one.given) for one in hidden)
    channels = {**seen.channels, **linear.channels}
    return ReadRows(chosen, often, reversals, channels, seen.lost, seen.lacking), every, estimated


def _hidden(spec: ArmSpec, sensing: Sensing, sensors: Sequence[ArmSensor]) -> tuple[_Hidden, ...]:
    """Return the joints whose links no sensor sees; if there is none, those whose motors none sees."""
    soft = [joint for joint in spec.moving if joint.elastic and joint.stiffness3 is None]
    sides = {
        joint.name: tuple(
            sensing.channels(name, 0) is not None for name in (motor_coordinate(joint), joint.name)
        )
        for joint in soft
    }
    behind = [joint for joint in soft if sides[joint.name] == (True, False)]
    ahead = [joint for joint in soft if sides[joint.name] == (False, True)]
    found = []
    for joint in behind or ahead:
        measured = joint.name in sensing.torques
        if behind:
            row, given = f"{joint.name} {'deflection' if measured else 'spring'}", joint.name + DEFLECTED
            sensor = ArmSensor(_free_key(f"q_{joint.name}", sensors), joint.name, "link", "position")
        else:
            given = joint.name + DRIVEN
            row = f"{joint.name} {'deflection' if measured else 'link'}"
            key = _free_key(f"deflection_{joint.name}", sensors)
            sensor = ArmSensor(key, joint.name, "deflection", "position")
        found.append(_Hidden(joint, row, given, sensor))
    return tuple(found)


def _felt(
    graph: Graph, spec: ArmSpec, sensing: Sensing, sensors: Sequence[ArmSensor], hidden: Collection[str]
) -> Iterator[Balance]:
    """Yield reading less motion = 0 of axes of sensors on links that move with hidden joints.

    Gyros whose differences are speeds of joints say those, and nothing else.
    """
    read = {key for joint in spec.moving for key, *_ in sensing.channels(joint.name, 1) or ()}
    motions = link_motions(graph, spec)
    for sensor in sensors:
        if sensor.measures not in INERTIAL or not read.isdisjoint(sensor.channels):
            continue
        for channel, motion in zip(sensor.channels, felt(graph, motions[sensor.joint], sensor), strict=True):
            nodes = (graph.nodes[index].symbol for index in graph.needed([motion]))
            if any(symbol is not None and symbol.name in hidden for symbol in nodes):
                reading = graph.symbol(Symbol("reading", channel))
                name = f"{sensor.key} {channel[-1]}"
                yield Balance(name, {}, graph.subtract(reading, motion))


def _free_key(key: str, sensors: Sequence[ArmSensor]) -> str:
    taken = {channel for sensor in sensors for channel in sensor.channels}
    while key in taken:
        key += "_"
    return key
