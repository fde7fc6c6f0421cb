"""Rows of what sensors measure of links and motors: reading = motion.

Where a spring places a link, what a gyro, an accelerometer or the speed or acceleration of a joint says of it
is a row that holds no parameter but those that give the position. Where the mounting of a gyro or an
accelerometer is to be found, its direction cosines and lever are columns, and any link has such rows. They
are linear in them, with the noise of the sensor on the left.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from modelgen.spec.arms.arm import INERTIAL, ArmSensor, ArmSpec
from modelgen.spec.arms.parameters import mounting_parameters
from modelgen.symbolic.arms.balances import Balance
from modelgen.symbolic.arms.expressions.graph import Graph, Ref, Symbol
from modelgen.symbolic.arms.kinematics import LinkMotion, felt, link_motions
from modelgen.symbolic.arms.row_parts import RowParts
from modelgen.symbolic.arms.sensed.sensing import ORDERS, reading_of

#: Ends the name of the row of a joint's speed or acceleration, behind the key of its sensor.
MOTION = " motion"


def felt_rows(
    graph: Graph,
    spec: ArmSpec,
    parts: RowParts,
    sensors: Sequence[ArmSensor],
    unseen: Collection[str],
) -> list[tuple[Balance, ArmSensor]]:
    """Return the rows of sensors, with the sensor of each.

    Parameters
    ----------
    graph, spec, parts
        The arm.
    sensors
        Those of the set.
    unseen
        Coordinates that springs place.
    """
    motions = link_motions(graph, spec)
    found = []
    for sensor in sensors:
        rows: list[Balance] = []
        if ORDERS.get(sensor.measures):
            rows = _moved(graph, spec, sensor)
        elif sensor.estimated:
            rows = _placed(graph, parts, motions[sensor.joint], sensor)
        elif sensor.measures in INERTIAL:
            rows = _felt(graph, motions[sensor.joint], sensor)
        found += [(row, sensor) for row in rows if sensor.estimated or _holds(graph, row.measured, unseen)]
    return found


def _felt(graph: Graph, motion: LinkMotion, sensor: ArmSensor) -> list[Balance]:
    """Return reading less motion = 0 of the axes of a sensor whose mounting is known."""
    axes = zip(sensor.channels, felt(graph, motion, sensor), strict=True)
    return [
        Balance(_name(sensor, channel), {}, graph.subtract(_reading(graph, channel), along))
        for channel, along in axes
    ]


def _placed(graph: Graph, parts: RowParts, motion: LinkMotion, sensor: ArmSensor) -> list[Balance]:
    """Return reading = direction cosines and lever times motion of the link."""
    moved: tuple[Ref, ...] = motion.speed.angular
    if sensor.measures == "accelerometer":
        moved = (*motion.acceleration.linear, *(entry for row in motion.gradient for entry in row))
    columns = [parts.columns.index(one.name) for one in mounting_parameters(sensor)]
    found = []
    for place, channel in enumerate(sensor.channels):
        own = columns[place * len(moved) : (place + 1) * len(moved)]
        entries = {column: ref for column, ref in zip(own, moved, strict=True) if ref}
        found.append(Balance(_name(sensor, channel), entries, _reading(graph, channel)))
    return found


def _moved(graph: Graph, spec: ArmSpec, sensor: ArmSensor) -> list[Balance]:
    """Return reading less speed or acceleration = 0 of a sensor on one side of a spring, or between both."""
    moved = graph.total(
        graph.scale(factor, graph.symbol(Symbol("position", name, ORDERS[sensor.measures])))
        for name, factor in reading_of(spec, sensor).coordinates.items()
    )
    return [Balance(sensor.key + MOTION, {}, graph.subtract(_reading(graph, sensor.key), moved))]


def _name(sensor: ArmSensor, channel: str) -> str:
    return f"{sensor.key} {channel[-1]}"


def _reading(graph: Graph, channel: str) -> Ref:
    return graph.symbol(Symbol("reading", channel))


def _holds(graph: Graph, ref: Ref, coordinates: Collection[str]) -> bool:
    """Return whether a coordinate, or its cosine or sine, is in what a reference is made of."""
    symbols = (graph.nodes[index].symbol for index in graph.needed([ref]))
    return any(one is not None and one.kind != "reading" and one.name in coordinates for one in symbols)
