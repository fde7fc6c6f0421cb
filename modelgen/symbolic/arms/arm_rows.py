"""The rows of an arm: force or torque of every joint, or every motor, linear in the parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from modelgen.errors import ModelError
from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec
from modelgen.symbolic.arms.drives import drive_columns, drives, gain_column, speed_node
from modelgen.symbolic.arms.expressions.graph import ZERO, Graph, Ref, Symbol
from modelgen.symbolic.arms.kinematics import BASE_ROWS, link_motions
from modelgen.symbolic.arms.link_wrenches import along_axis, parameter_wrenches

RowKind = Literal["joint", "motor"]
#: The regressor grows with the product of both: a minute for the derivation of the largest.
LARGEST_ARM, MOST_JOINTS = 50, 300
#: Parameters of a link from the one that is kept to the ones that are regrouped first.
KEPT_FIRST = ("Ixx", "Ixy", "Ixz", "Iyz", "Izz", "mx", "my", "Iyy", "mz", "m")


@dataclass(frozen=True)
class ArmRows:
    """Rows of an arm: measured = sum of entries times parameters.

    Attributes
    ----------
    spec, graph
        The arm, and where all references are.
    kind
        Rows of joints, or of motors.
    names
        Of the rows: joints in their order, behind them those of `BASE_ROWS` if asked for.
    columns
        Parameters in the order in which they are kept: base to tip, of a link as `KEPT_FIRST` has them,
        behind them its drive.
    owners
        The joint whose link or drive each column is of.
    entries
        Nonzero entries of the regressor by (row, column).
    measured
        The left side: sums of the forces or torques of the motors, and the wrench of the base. What a drive
        with a gain to be found measures is a column, of the gain.
    speeds
        Speeds whose directions the entries hold, by name.
    """

    spec: ArmSpec
    graph: Graph
    kind: RowKind
    names: tuple[str, ...]
    columns: tuple[str, ...]
    owners: tuple[str, ...]
    entries: Mapping[tuple[int, int], Ref]
    measured: tuple[Ref, ...]
    speeds: Mapping[str, Ref]

    @property
    def has_base(self) -> bool:
        """Whether the base's wrench is measured."""
        return len(self.names) > len(self.spec.moving)

    @property
    def has_scale(self) -> bool:
        """Whether a force, torque or known parameter says how large the parameters are.

        Where every drive has a gain that is to be found, zeros alone stand on the left: only
        ratios can be found: twice all parameters, gains among them, do as well.
        """
        known = {column for column, name in enumerate(self.columns) if self.spec.known.get(name)}
        return any(self.measured) or any(column in known for _, column in self.entries)


def arm_rows(spec: ArmSpec, kind: RowKind = "joint", base_rows: bool = False) -> ArmRows:
    """Derive the rows of an arm.

    A fixed joint has a link like any other, which moves with its parent; its parameters are regrouped into
    the parent's when base parameters are found.

    Parameters
    ----------
    spec : ArmSpec
        The arm.
    kind : {"joint", "motor"}
        Torques of joints, transmission^T @ torques of motors; or torques of motors.
    base_rows : bool
        Whether the force and torque that the base exerts on the arm are measured too.

    Raises
    ------
    ModelError
        If no joint moves, or motors do not determine the joints.
    """
    moving = spec.moving
    if not moving:
        raise ModelError.at(
            spec.source,
            "no joint moves, so there is nothing to identify",
            "add a revolute or prismatic joint",
        )
    if len(moving) > LARGEST_ARM or len(spec.joints) > MOST_JOINTS:
        raise ModelError.at(
            spec.source,
            f"{len(moving):,} of {len(spec.joints):,} joints move; rows are derived for at most "
            f"{LARGEST_ARM} of {MOST_JOINTS}",
            "leave out what is measured apart, or lump links that are fixed to each other",
        )
    graph = Graph()
    columns: list[str] = []
    owners: list[str] = []
    rows: list[dict[int, Ref]] = [{} for _ in moving]
    base: list[dict[int, Ref]] = [{} for _ in BASE_ROWS] if base_rows else []
    place = {joint.name: row for joint, row in zip(moving, rows, strict=True)}
    place.update(zip(BASE_ROWS, base, strict=False))
    motions = link_motions(graph, spec, base_rows)
    of_joint = {drive.speed_name: drive for drive in drives(spec)}
    for joint in spec.joints:
        if joint.link:
            wrenches = parameter_wrenches(graph, motions[joint.name])
            for parameter in KEPT_FIRST:
                number = LINK_PARAMETERS.index(parameter)
                for axis, twist in motions[joint.name].axes.items():
                    entry = along_axis(graph, twist, wrenches[number])
                    if entry:
                        place[axis][len(columns)] = entry
                columns.append(joint.link[number])
        for drive in (d for d in of_joint.values() if d.joint.name == joint.name):
            for name, factor in drive_columns(graph, drive):
                for moved, ratio in drive.lever:
                    place[moved][len(columns)] = graph.scale(ratio, factor)
                columns.append(name)
        if joint.gain is not None:
            for moved, entry in gain_column(graph, spec, joint).items():
                place[moved][len(columns)] = entry
            columns.append(joint.gain)
        owners += [joint.name] * (len(columns) - len(owners))
    forces, turned = _left_side(graph, spec, kind)
    rows = [_combined(graph, rows, weights) for weights in turned]
    return ArmRows(
        spec,
        graph,
        kind,
        (*(joint.name for joint in moving), *(BASE_ROWS if base_rows else ())),
        tuple(columns),
        tuple(owners),
        {(r, c): entry for r, row in enumerate([*rows, *base]) for c, entry in sorted(row.items())},
        (*forces, *(graph.symbol(Symbol("force", name)) for name in BASE_ROWS if base_rows)),
        {name: speed_node(graph, drive) for name, drive in of_joint.items()},
    )


def _left_side(graph: Graph, spec: ArmSpec, kind: RowKind) -> tuple[list[Ref], list[list[Fraction]]]:
    """Return the left side of every row, and every row as a sum of rows of joints."""
    motors = [ZERO if joint.gain else graph.symbol(Symbol("force", joint.name)) for joint in spec.moving]
    transmission = [[Fraction(ratio) for ratio in row] for row in spec.transmission]
    turned = _inverse_transposed(spec, transmission)
    if kind == "motor":
        return motors, turned
    count = range(len(motors))
    sums = [graph.total(graph.scale(transmission[k][j], motors[k]) for k in count) for j in count]
    return sums, [[Fraction(j == k) for k in count] for j in count]


def _combined(graph: Graph, rows: list[dict[int, Ref]], weights: list[Fraction]) -> dict[int, Ref]:
    """Return the sum of weights times rows, without zeros."""
    combined: dict[int, Ref] = {}
    for row, weight in zip(rows, weights, strict=True):
        if weight:
            for column, entry in row.items():
                combined[column] = graph.add(combined.get(column, 0), graph.scale(weight, entry))
    return {column: entry for column, entry in combined.items() if entry}


def _inverse_transposed(spec: ArmSpec, matrix: list[list[Fraction]]) -> list[list[Fraction]]:
    """Return the transposed inverse of a square matrix (Gauss and Jordan, exact)."""
    size = len(matrix)
    work = [[*row, *(Fraction(i == j) for j in range(size))] for i, row in enumerate(matrix)]
    for column in range(size):
        pivot = next((r for r in range(column, size) if work[r][column]), None)
        if pivot is None:
            raise ModelError.at(
                f"{spec.source}: transmission",
                "motors do not determine the joints: its rows depend on each other",
                "let every motor move a joint of its own",
            )
        work[column], work[pivot] = work[pivot], work[column]
        work[column] = [value / work[column][column] for value in work[column]]
        for r in range(size):
            if r != column and work[r][column]:
                factor = work[r][column]
                work[r] = [a - factor * b for a, b in zip(work[r], work[column], strict=True)]
    return [[work[j][size + i] for j in range(size)] for i in range(size)]
