"""What rows of an arm are made of: columns of links, drives and springs, by the joint that each acts on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSensor, ArmSpec
from modelgen.spec.arms.parameters import mounting_parameters
from modelgen.symbolic.arms.drives import (
    drive_columns,
    drives,
    gain_column,
    motor_coordinate,
    speed_node,
    spring_columns,
)
from modelgen.symbolic.arms.expressions.graph import ONE, Graph, Ref, Symbol
from modelgen.symbolic.arms.kinematics import BASE_ROWS, LinkMotion, link_motions
from modelgen.symbolic.arms.link_wrenches import along_axis, parameter_wrenches

#: Parameters of a link from the one that is kept to the ones that are regrouped first.
KEPT_FIRST = ("Ixx", "Ixy", "Ixz", "Iyz", "Izz", "mx", "my", "Iyy", "mz", "m")

#: Nonzero entries of a row, by the column.
Entries = dict[int, Ref]


@dataclass(frozen=True)
class RowParts:
    """Columns, and how often each counts in the torque of links, drives and springs.

    Attributes
    ----------
    columns, owners
        As `ArmRows` has them.
    links
        What the links need of every joint and, if asked for, of the base, by the name of the row.
    drives
        What the drives need on the motors' side of every joint that moves.
    springs
        What the spring of an elastic joint hands to its link; empty for others.
    speeds
        Speeds whose directions the entries hold, by name.
    """

    columns: tuple[str, ...]
    owners: tuple[str, ...]
    links: Mapping[str, Entries]
    drives: Mapping[str, Entries]
    springs: Mapping[str, Entries]
    speeds: Mapping[str, Ref]


def row_parts(graph: Graph, spec: ArmSpec, base_rows: bool, sensors: Sequence[ArmSensor] = ()) -> RowParts:
    """Return the columns of an arm and their entries; behind them those of sensors' mountings, without."""
    columns: list[str] = []
    owners: list[str] = []
    moving = [joint.name for joint in spec.moving]
    links: dict[str, Entries] = {name: {} for name in (*moving, *(BASE_ROWS if base_rows else ()))}
    driven: dict[str, Entries] = {name: {} for name in moving}
    springs: dict[str, Entries] = {name: {} for name in moving}
    behind = {motor_coordinate(joint): driven[joint.name] for joint in spec.moving}
    motions = link_motions(graph, spec, base_rows)
    of_joint = {drive.speed_name: drive for drive in drives(spec)}
    for joint in spec.joints:
        if joint.link:
            _add_body(graph, motions[joint.name], joint.link, columns, links)
        for drive in (d for d in of_joint.values() if d.joint.name == joint.name):
            for name, factor in drive_columns(graph, drive):
                for moved, ratio in drive.lever:
                    behind[moved][len(columns)] = graph.scale(ratio, factor)
                columns.append(name)
        for name, factor in spring_columns(graph, joint) if joint.elastic else ():
            springs[joint.name][len(columns)] = factor
            columns.append(name)
        if joint.gain is not None:
            for moved, entry in gain_column(graph, spec, joint).items():
                behind[moved][len(columns)] = entry
            columns.append(joint.gain)
        owners += [joint.name] * (len(columns) - len(owners))
    for payload in spec.payloads:
        load = graph.symbol(Symbol("load", payload.name))
        _add_body(graph, motions[payload.joint], payload.link, columns, links, load)
        owners += [payload.joint] * (len(columns) - len(owners))
    for sensor in sensors:
        columns += [one.name for one in mounting_parameters(sensor)]
        owners += [sensor.joint] * (len(columns) - len(owners))
    speeds = {name: speed_node(graph, drive) for name, drive in of_joint.items()}
    return RowParts(tuple(columns), tuple(owners), links, driven, springs, speeds)


def _add_body(
    graph: Graph,
    motion: LinkMotion,
    names: Sequence[str],
    columns: list[str],
    links: Mapping[str, Entries],
    load: Ref = ONE,
) -> None:
    """Add the columns of a body's ten parameters: what they need of every joint, times its load."""
    wrenches = parameter_wrenches(graph, motion)
    for parameter in KEPT_FIRST:
        number = LINK_PARAMETERS.index(parameter)
        for axis, twist in motion.axes.items():
            entry = graph.multiply(load, along_axis(graph, twist, wrenches[number]))
            if entry:
                links[axis][len(columns)] = entry
        columns.append(names[number])
