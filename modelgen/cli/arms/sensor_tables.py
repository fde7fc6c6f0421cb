"""What `modelgen show` says of an arm's sensor sets, side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from rich.text import Text

from modelgen.cli.tables import Description, table
from modelgen.errors import ModelError, listed
from modelgen.spec.arms.arm import ArmSensor, ArmSpec
from modelgen.symbolic.arms.arm_rows import ArmRows
from modelgen.symbolic.arms.arm_sensor_sets import arm_overview, with_usual_sets
from modelgen.symbolic.arms.sensed.sensing import follows

#: names of lost parameters in the table; --json has all
MOST_NAMES = 6


def describe_sensor_sets(arm: ArmSpec, chosen: str | None) -> list[Description]:
    """Return the sensor sets of an arm, those that robots have usually ("all"), or one, as plain values."""
    if chosen == "all" and "all" not in arm.sensor_sets:
        arm, chosen = with_usual_sets(arm), None
    names = list(arm.sensor_sets) if chosen is None else [chosen]
    try:
        overview = arm_overview(arm, names) if names else ()
    except ModelError:  # an arm without rows; the base parameters say why
        return []
    return [
        {
            "name": summary.name,
            "sensors": [_sensor(sensor) for sensor in arm.sensor_sets[summary.name]],
            "rows": _rows(summary.model.rows) if summary.model else [],
            "estimated": [one.channel for one in summary.model.rows.estimated] if summary.model else [],
            **(_unread(summary.model.rows) if summary.model else {"unread": [], "unread_in_vain": []}),
            "base_parameters": [base.name for base in summary.model.base] if summary.model else [],
            "lost": list(summary.lost),
            "reason": summary.model.rows.lacking if summary.model else summary.reason,
        }
        for summary in overview
    ]


def sensor_set_tables(described: Sequence[Description]) -> Iterator[Any]:
    """Lay out what `describe_sensor_sets` says; nothing for an arm without sensor sets."""
    if not described:
        return
    yield Text("")
    yield table(
        "Sensor sets (rows; of them differentiated; links whose positions the springs give)",
        ("sensor set", ">rows", ">differentiated", ">by springs", ">base parameters", "lost", "because"),
        [
            (
                one["name"],
                str(len(one["rows"])) if one["rows"] else "-",
                str(sum(row["differentiated"] > 0 for row in one["rows"])) if one["rows"] else "-",
                str(len(one["estimated"])) if one["rows"] else "-",
                str(len(one["base_parameters"])) if one["rows"] else "-",
                listed([_short(name) for name in one["lost"]], most=MOST_NAMES) if one["lost"] else "nothing",
                one["reason"] or "-",
            )
            for one in described
        ],
    )
    reasons = {
        "unread": "what they measure follows from other sensors",
        "unread_in_vain": "the rows that hold what they measure need more than this set measures",
    }
    for one in described:
        for kind, reason in reasons.items():
            if one[kind]:
                yield Text(f"{one['name']}: no row reads {', '.join(one[kind])}: {reason}")


def _rows(rows: ArmRows) -> list[Description]:
    """Return the rows that are fitted; others are used up for the positions of links."""
    used = {one.row for one in rows.estimated}
    found = zip(rows.names, rows.differentiated, strict=True)
    return [{"name": name, "differentiated": times} for name, times in found if name not in used]


def _unread(rows: ArmRows) -> Description:
    """Return the sensors of which nothing is in the rows: those that others replace, and the rest."""
    read = {key for channels in rows.channels.values() for key, *_ in channels}
    measured = rows.sensors[: len(rows.sensors) - len(rows.estimated)]
    unread = [sensor for sensor in measured if read.isdisjoint(sensor.channels)]
    replaced = [sensor.key for sensor in unread if follows(rows.spec, measured, sensor)]
    return {
        "unread": replaced,
        "unread_in_vain": [sensor.key for sensor in unread if sensor.key not in replaced],
    }


def _short(name: str) -> str:
    """Return a sum by its first term."""
    first, _, rest = name.partition(" ")
    return f"{first} + ..." if rest else first


def _sensor(sensor: ArmSensor) -> Description:
    return {
        "key": sensor.key,
        "joint": sensor.joint,
        "side": sensor.side,
        "measures": sensor.measures,
        "channels": list(sensor.channels),
    }
