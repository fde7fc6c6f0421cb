"""Rows where no sensor sees a link: its position follows from the motor's and what the spring carries.

q = q_m - (Gamma - drive) / K, or q_m - torque / K where the torque is measured. That row is then used up
(`Estimated`), and the row of the links holds with the position that it gives: linear in the links' parameters
for given drives and springs, so that all are found together by separable least squares.
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
from modelgen.symbolic.arms.readable_rows import ReadRows, readable_rows
from modelgen.symbolic.arms.row_parts import RowParts
from modelgen.symbolic.arms.sensing import Sensing

#: Behind the name of a joint: the row that its link's position is made of.
DEFLECTED = " deflected"


class Estimated(NamedTuple):
    """A channel that no sensor has: the position of a link, and the row that gives it."""

    channel: str
    row: str


def sensed_rows(
    graph: Graph,
    spec: ArmSpec,
    parts: RowParts,
    rows: Sequence[Balance],
    sensors: tuple[ArmSensor, ...],
    where: str,
) -> tuple[ReadRows, tuple[ArmSensor, ...], tuple[Estimated, ...]]:
    """Return the rows that sensors give, linear ones and those of links that no sensor sees.

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
    unseen = [joint for joint in spec.moving if _is_behind(sensing, joint)]
    if not unseen:
        return readable_rows(graph, spec, parts, rows, sensing, where), sensors, ()
    used = {f"{j.name} {'deflection' if j.name in sensing.torques else 'spring'}": j.name for j in unseen}
    added = _virtual(unseen, sensors)
    every = (*sensors, *added.values())
    seen = readable_rows(graph, spec, parts, rows, Sensing(spec, every), where)
    try:
        linear = readable_rows(graph, spec, parts, rows, sensing, where)
    except ModelError:
        linear = ReadRows((), (), ())
    names = {row.name for row in linear.rows}
    kept = list(zip(linear.rows, linear.differentiated, linear.reversals, strict=True))
    giving = []
    for row, times, turned in zip(seen.rows, seen.differentiated, seen.reversals, strict=True):
        if row.name in used and not times:
            giving.append((replace(row, name=used[row.name] + DEFLECTED), 0, ()))
        elif row.name not in names and not times:
            kept.append((row, 0, turned))
    if len(kept) == len(linear.rows) or len(giving) < len(used):
        return readable_rows(graph, spec, parts, rows, sensing, where), sensors, ()
    chosen, often, reversals = zip(*kept, *giving, strict=True)
    estimated = tuple(Estimated(added[name].key, name + DEFLECTED) for name in used.values())
    channels = {**seen.channels, **linear.channels}
    return ReadRows(chosen, often, reversals, channels, seen.lost, seen.lacking), every, estimated


def _is_behind(sensing: Sensing, joint: Joint) -> bool:
    """Return whether a spring hides the position of a link whose motor is seen; a cubic one is not solved."""
    return (
        joint.elastic
        and joint.stiffness3 is None
        and sensing.channels(joint.name, 0) is None
        and sensing.channels(motor_coordinate(joint), 0) is not None
    )


def _virtual(joints: Sequence[Joint], sensors: Sequence[ArmSensor]) -> dict[str, ArmSensor]:
    taken = {channel for sensor in sensors for channel in sensor.channels}
    found = {}
    for joint in joints:
        key = f"q_{joint.name}"
        while key in taken:
            key += "_"
        found[joint.name] = ArmSensor(key, joint.name, "link", "position")
    return found
