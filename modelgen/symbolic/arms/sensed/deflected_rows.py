"""Rows where no sensor sees one end of a spring: its deflection follows from what the spring carries.

Where the link is hidden, q = q_m - (Gamma - drive) / K, or q_m - torque / K where the torque is measured.
Where the motor is, q_m = q + links / K, or q + torque / K. That row is then used up (`Estimated`), and the
others hold with the position that it gives: linear in the remaining parameters for given springs, so that all
are found together by separable least squares. What other sensors feel of such links is in rows, too
(`felt_rows`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from modelgen.errors import ModelError
from modelgen.spec.arms.arm import ArmSensor, ArmSpec, Joint
from modelgen.symbolic.arms.balances import Balance
from modelgen.symbolic.arms.drives import motor_coordinate
from modelgen.symbolic.arms.expressions.graph import Graph
from modelgen.symbolic.arms.row_parts import RowParts
from modelgen.symbolic.arms.sensed.felt_rows import felt_rows
from modelgen.symbolic.arms.sensed.readable_rows import ReadRows, readable_rows
from modelgen.symbolic.arms.sensed.sensing import ArmSensing

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
    sensing = ArmSensing(spec, sensors)
    hidden = _hidden(spec, sensing, sensors)
    unseen = {one.joint.name if one.behind else motor_coordinate(one.joint) for one in hidden}
    felt = felt_rows(graph, spec, parts, sensors, unseen)
    if not hidden:
        rows = [*rows, *(row for row, _ in felt)]
        return readable_rows(graph, spec, parts, rows, sensing, where), sensors, ()
    used = {one.row: one for one in hidden}
    every = (*sensors, *(one.sensor for one in hidden))
    said = {sensor.key for _, sensor in felt}
    others = tuple(sensor for sensor in every if sensor.key not in said)
    seen = readable_rows(
        graph, spec, parts, [*rows, *(row for row, _ in felt)], ArmSensing(spec, others), where
    )
    try:
        # what feels positions that springs give is in rows of its own, and in no other
        linear = readable_rows(graph, spec, parts, rows, ArmSensing(spec, others[: -len(hidden)]), where)
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


def _hidden(spec: ArmSpec, sensing: ArmSensing, sensors: Sequence[ArmSensor]) -> tuple[_Hidden, ...]:
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


def _free_key(key: str, sensors: Sequence[ArmSensor]) -> str:
    taken = {channel for sensor in sensors for channel in sensor.channels}
    while key in taken:
        key += "_"
    return key
