"""What every language prints of an arm's model: two straight lines of operations, where their values go."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from modelgen.errors import RenderError, listed
from modelgen.render.arms.sensor_readings import from_sensors
from modelgen.render.arms.straight_line import KernelOutput, StraightLine, straight_line
from modelgen.symbolic.arms.base_parameters import ArmBaseModel
from modelgen.symbolic.arms.expressions.graph import Ref, Symbol


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
        If a named length has no value, or joints are elastic and no sensor set says what is measured.
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
    if spec.elastic and not rows.sensor_set:
        remedy = f"choose one of the sensor sets {listed(spec.sensor_sets)}"
        raise RenderError.at(
            spec.source, "has elastic joints, of which motors and links are measured apart", remedy
        )
    place = {column: k for k, column in enumerate(model.columns)}
    kept = sorted((place[c], r, ref) for (r, c), ref in rows.entries.items() if c in place)
    number = {joint.name: n for n, joint in enumerate(spec.joints, start=1)}
    read = from_sensors(rows, [*(ref for *_, ref in kept), *_left_side(model)])
    sections = [f"joint {number[rows.owners[model.columns[k]]]}" for k, *_ in kept]
    outputs = [KernelOutput(ref, section) for ref, section in zip(read.refs, sections, strict=False)]
    measured = [KernelOutput(ref, "measured") for ref in read.refs[len(kept) :]]
    entries, left = (
        straight_line(rows.graph, refs, read.names, lengths, read.speeds, read.angles)
        for refs in (outputs, measured)
    )
    used = {*entries.inputs, *left.inputs}
    signals = tuple(symbol for symbol in read.signals if symbol in used)
    local = {symbol: read.names[rows.graph.symbol(symbol)] for symbol in signals}
    return ArmLines(model, lengths, signals, local, tuple((r, k) for k, r, _ in kept), entries, left)


def signal_key(symbol: Symbol) -> str:
    """Return the key of a signal: ``d1_q_elbow``, ``tau_elbow``, ``base_fx``, ``load_disc``, a sensor's."""
    front = f"d{symbol.order}_" if symbol.order else ""
    if symbol.kind == "position":
        return f"{front}q_{symbol.name}"
    if symbol.kind == "reading" or symbol.name.startswith("base_"):
        return front + symbol.name
    return f"{front}load_{symbol.name}" if symbol.kind == "load" else f"{front}tau_{symbol.name}"


def _left_side(model: ArmBaseModel) -> list[Ref]:
    """Return what is measured less what known parameters contribute, a row each."""
    rows, graph = model.rows, model.rows.graph
    found = list(rows.measured)
    for (row, column), entry in rows.entries.items():
        value = rows.spec.known.get(rows.columns[column])
        if value is not None:
            found[row] = graph.subtract(found[row], graph.scale(Fraction(str(value)), entry))
    return found
