"""Balances of force or torque that hold for an arm: of motors, of links, and of the springs between them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from modelgen.errors import ModelError
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.expressions.graph import ZERO, Graph, Ref, Symbol
from modelgen.symbolic.arms.row_parts import Entries, RowParts

RowKind = Literal["joint", "motor"]


@dataclass(frozen=True)
class Balance:
    """measured = sum of entries times parameters: one row.

    Attributes
    ----------
    name
        The joint's for the balance of all that its motor moves; with " spring" behind for that of its motor
        alone, with " link" for that of its link, with " deflection" for what a measured torque comes from.
    entries
        By column.
    measured
        The left side.
    sum_of
        Names of other balances that it follows from.
    """

    name: str
    entries: Entries
    measured: Ref
    sum_of: tuple[str, ...] = ()


def balances(
    graph: Graph, spec: ArmSpec, kind: RowKind, parts: RowParts, torques: Collection[str] = ()
) -> Iterator[Balance]:
    """Yield all rows: those of motors with links, motors with springs, links, measured torques, and the base.

    With a spring, Gamma = drive + spring and 0 = links - spring, so that noise of the motor's force is in one
    row only; their sum, Gamma = drive + links, is for sensors that do not give both. `torques` are joints
    whose torque between motor and link is measured: there the row of the motor ends, and others begin.
    """
    through = {
        joint.name: graph.symbol(Symbol("torque", joint.name))
        for joint in spec.moving
        if joint.name in torques
    }
    rigid = {name: {} if name in through else parts.links[name] for name in parts.drives}
    sprung = [j.name for j in spec.moving if j.elastic and j.name not in through]
    sums = [dict(zip(rigid, weights, strict=True)) for weights in _weights(spec, kind)]
    forces = _forces(graph, spec, kind)
    for name, weights, force in zip(rigid, sums, forces, strict=True):
        entries = _total(graph, weights, rigid, parts.drives)
        behind = [f"{other} link" for other in sprung if weights[other]]
        sum_of = (f"{name} spring", *behind) if behind else ()
        yield Balance(name, entries, _less(graph, force, weights, through), sum_of)
    between = {**rigid, **{name: parts.springs[name] for name in sprung}}
    for name, weights, force in zip(rigid, sums, forces, strict=True):
        if any(weights[other] for other in sprung):
            entries = _total(graph, weights, between, parts.drives)
            yield Balance(f"{name} spring", entries, _less(graph, force, weights, through))
    for name in sprung:
        yield Balance(f"{name} link", _difference(graph, parts.links[name], parts.springs[name]), ZERO)
    for name, torque in through.items():
        yield Balance(f"{name} link", parts.links[name], torque)
        if parts.springs[name]:
            yield Balance(f"{name} deflection", parts.springs[name], torque)
    for name, entries in parts.links.items():
        if name not in parts.drives:
            yield Balance(name, entries, graph.symbol(Symbol("force", name)))


def _weights(spec: ArmSpec, kind: RowKind) -> list[list[Fraction]]:
    """Return every row as a sum of rows of joints."""
    count = range(len(spec.moving))
    if kind == "motor":
        return _inverse_transposed(spec)
    _inverse_transposed(spec)  # motors must determine the joints
    return [[Fraction(j == k) for k in count] for j in count]


def _forces(graph: Graph, spec: ArmSpec, kind: RowKind) -> list[Ref]:
    """Return what motors exert on each joint, or each motor; nothing where a drive's gain is to be found."""
    motors = [ZERO if joint.gain else graph.symbol(Symbol("force", joint.name)) for joint in spec.moving]
    if kind == "motor":
        return motors
    columns = zip(*spec.transmission, strict=True)
    return [
        graph.total(graph.scale(Fraction(ratio), motor) for ratio, motor in zip(ratios, motors, strict=True))
        for ratios in columns
    ]


def _less(graph: Graph, force: Ref, weights: Mapping[str, Fraction], through: Mapping[str, Ref]) -> Ref:
    """Return a force without the torques that are measured behind the motors."""
    return graph.subtract(
        force, graph.total(graph.scale(weights[name], ref) for name, ref in through.items())
    )


def _total(graph: Graph, weights: Mapping[str, Fraction], *parts: Mapping[str, Entries]) -> Entries:
    """Return the sum of rows of joints, without zeros."""
    total: Entries = {}
    for name, weight in weights.items():
        for column, entry in (item for part in parts if weight for item in part[name].items()):
            total[column] = graph.add(total.get(column, 0), graph.scale(weight, entry))
    return {column: entry for column, entry in total.items() if entry}


def _difference(graph: Graph, left: Entries, right: Entries) -> Entries:
    found = dict(left)
    for column, entry in right.items():
        found[column] = graph.subtract(found.get(column, ZERO), entry)
    return found


def _inverse_transposed(spec: ArmSpec) -> list[list[Fraction]]:
    """Return the transposed inverse of the transmission (Gauss and Jordan, exact)."""
    size = len(spec.transmission)
    work = [
        [*map(Fraction, row), *(Fraction(i == j) for j in range(size))]
        for i, row in enumerate(spec.transmission)
    ]
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
