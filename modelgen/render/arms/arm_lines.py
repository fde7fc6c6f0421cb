"""What every language prints of an arm's model: two straight lines of operations, where their values go."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from modelgen.errors import RenderError, listed
from modelgen.render.arms.kernel_names import kernel_names
from modelgen.render.arms.straight_line import Output, StraightLine, straight_line
from modelgen.symbolic.arms.base_parameters import ArmBaseModel
from modelgen.symbolic.arms.expressions.graph import Ref, Symbol

ORDERS = ("q", "d1_q", "d2_q")


@dataclass(frozen=True)
class ArmLines:
    """Operations that compute an arm's rows.

    Attributes
    ----------
    model
        What they are of.
    lengths
        Value of every named length [m].
    signals
        What both read, in the order of the joints.
    local
        How each signal is called in the operations.
    places
        (row, column) of every nonzero entry of the regressor, in the order of the outputs of `entries`.
    entries, measurement
        Operations of the entries, a section a joint; and of the left side, an output a row.
    """

    model: ArmBaseModel
    lengths: Mapping[str, float]
    signals: tuple[Symbol, ...]
    local: Mapping[Symbol, str]
    places: tuple[tuple[int, int], ...]
    entries: StraightLine
    measurement: StraightLine


def arm_lines(model: ArmBaseModel) -> ArmLines:
    """Order the operations of an arm's model.

    Raises
    ------
    RenderError
        If a named length has no value.
    """
    rows, spec = model.rows, model.rows.spec
    lengths = {name: value for name, value in spec.lengths.items() if value is not None}
    missing = [name for name in spec.lengths if name not in lengths]
    if missing:
        raise RenderError.at(
            f"{spec.source}: lengths",
            f"{listed(missing)} {'has' if len(missing) == 1 else 'have'} no value, which a module needs",
            "give every named length its value [m]",
        )
    place = {column: k for k, column in enumerate(model.columns)}
    kept = sorted((place[c], r, ref) for (r, c), ref in rows.entries.items() if c in place)
    number = {joint.name: n for n, joint in enumerate(spec.joints, start=1)}
    names = kernel_names(rows)
    outputs = [Output(ref, f"joint {number[rows.owners[model.columns[k]]]}") for k, _, ref in kept]
    entries = straight_line(rows.graph, outputs, names, lengths, rows.speeds)
    measured = [Output(ref, "measured") for ref in _left_side(model)]
    left = straight_line(rows.graph, measured, names, lengths, rows.speeds)
    signals = _ordered(model, {*entries.inputs, *left.inputs})
    local = {symbol: names[rows.graph.symbol(symbol)] for symbol in signals}
    return ArmLines(model, lengths, signals, local, tuple((r, k) for k, r, _ in kept), entries, left)


def signal_key(symbol: Symbol) -> str:
    """Return the key of a signal: ``d1_q_elbow``, ``tau_elbow``, ``base_fx``."""
    if symbol.kind == "position":
        return f"{ORDERS[symbol.order]}_{symbol.name}"
    return symbol.name if symbol.name.startswith("base_") else f"tau_{symbol.name}"


def _left_side(model: ArmBaseModel) -> list[Ref]:
    """Return what is measured less what known parameters contribute, a row each."""
    rows, graph = model.rows, model.rows.graph
    found = list(rows.measured)
    for (row, column), entry in rows.entries.items():
        value = rows.spec.known.get(rows.columns[column])
        if value is not None:
            found[row] = graph.subtract(found[row], graph.scale(Fraction(str(value)), entry))
    return found


def _ordered(model: ArmBaseModel, symbols: set[Symbol]) -> tuple[Symbol, ...]:
    """Return the signals in the order of the joints: coordinates, speeds, accelerations, forces."""
    names = [joint.name for joint in model.rows.spec.moving]
    order = [Symbol("position", name, k) for name in names for k in (0, 1, 2)]
    order += [Symbol("force", name) for name in model.rows.names]
    return tuple(symbol for symbol in order if symbol in symbols)
