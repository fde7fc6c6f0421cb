"""The variables of the template of an arm's module: plain strings and tuples, nothing symbolic."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from modelgen.errors import RenderError, listed
from modelgen.render.arms.kernel_names import LEGEND, kernel_names
from modelgen.render.arms.straight_line import Operation, Output, StraightLine, straight_line
from modelgen.render.printer import literal, weighted_sum
from modelgen.symbolic.arms.base_parameters import ArmBaseModel
from modelgen.symbolic.arms.expressions.graph import Ref, Symbol

ARM_CONTRACT_VERSION = 2
#: samples of a block: its buffers stay in the processor's cache
BLOCK = 1024
SAFE_FILE_NAME = re.compile(r"[A-Za-z0-9_.-]{1,100}\Z")
ORDERS = ("q", "d1_q", "d2_q")


@dataclass(frozen=True)
class Kernel:
    """One function of straight lines: (comment, lines) of each section."""

    signals: tuple[str, ...]  # names in the kernel
    sections: tuple[tuple[str, tuple[str, ...]], ...]
    buffers: int
    outputs: int


@dataclass(frozen=True)
class ArmView:
    """Everything the template prints: constants as (name, source) pairs, functions as lines of source."""

    name: str
    source: str
    sha256: str
    rows: tuple[str, ...]
    base: tuple[str, ...]
    absent: tuple[str, ...]
    legend: tuple[str, ...]
    constants: tuple[tuple[str, str], ...]
    block: int
    row_count: int
    column_count: int
    entries: Kernel
    measurement: Kernel
    base_lines: tuple[str, ...]


def arm_view(model: ArmBaseModel) -> ArmView:
    """Print every number and expression of an arm's model as source.

    Raises
    ------
    RenderError
        If a named length has no value, or no row has a measured side.
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
    local = tuple(names[rows.graph.symbol(symbol)] for symbol in signals)
    return ArmView(
        name=spec.name,
        source=spec.source if SAFE_FILE_NAME.match(spec.source) else f"{spec.name}.toml",
        sha256=spec.sha256,
        rows=rows.names,
        base=tuple(b.name for b in model.base),
        absent=tuple(f"{name}: {reason}" for name, reason in model.absent.items()),
        legend=LEGEND,
        constants=_constants(model, signals, [(r, k) for k, r, _ in kept]),
        block=BLOCK,
        row_count=len(rows.names),
        column_count=len(model.base),
        entries=_kernel(local, entries, len(kept)),
        measurement=_kernel(local, left, len(rows.names)),
        base_lines=tuple(_base_source(b.factors(lengths)) for b in model.base),
    )


def _base_source(factors: Mapping[str, float]) -> str:
    return weighted_sum((Fraction(factor), f'p["{name}"]') for name, factor in factors.items())


def _kernel(signals: tuple[str, ...], line: StraightLine, outputs: int) -> Kernel:
    sections: dict[str, list[str]] = {}
    for operation in line.operations:
        sections.setdefault(operation.section, []).append(_source(operation))
    named = tuple((section, tuple(lines)) for section, lines in sections.items())
    return Kernel(signals, named, line.buffers, outputs)


def _source(operation: Operation) -> str:
    operands = [repr(float(x)) if isinstance(x, float) else x for x in operation.operands]
    return f"{operation.name} = np.{operation.function}({', '.join([*operands, operation.target])})"


def _left_side(model: ArmBaseModel) -> list[Ref]:
    """Return what is measured less what known parameters contribute, a row each."""
    rows, graph = model.rows, model.rows.graph
    found = list(rows.measured)
    for (row, column), entry in rows.entries.items():
        value = rows.spec.known.get(rows.columns[column])
        if value is not None:
            found[row] = graph.subtract(found[row], graph.scale(Fraction(str(value)), entry))
    return found


def _ordered(model: ArmBaseModel, symbols: set[Symbol]) -> list[Symbol]:
    """Return the signals in the order of the joints: coordinates, speeds, accelerations, forces."""
    names = [joint.name for joint in model.rows.spec.moving]
    order = [Symbol("position", name, k) for name in names for k in (0, 1, 2)]
    order += [Symbol("force", name) for name in model.rows.names]
    return [symbol for symbol in order if symbol in symbols]


def signal_key(symbol: Symbol) -> str:
    """Return the key of a signal: ``d1_q_elbow``, ``tau_elbow``, ``base_fx``."""
    if symbol.kind == "position":
        return f"{ORDERS[symbol.order]}_{symbol.name}"
    return symbol.name if symbol.name.startswith("base_") else f"tau_{symbol.name}"


def _constants(
    model: ArmBaseModel, signals: Sequence[Symbol], entries: Sequence[tuple[int, int]]
) -> tuple[tuple[str, str], ...]:
    rows, spec = model.rows, model.rows.spec
    values: dict[str, object] = {
        "CONTRACT_VERSION": ARM_CONTRACT_VERSION,
        "ARM": spec.name,
        "TITLE": spec.title,
        "SPEC_SHA256": spec.sha256,
        "JOINTS": tuple(
            {"name": joint.name, "kind": joint.kind, "parent": joint.parent} for joint in spec.joints
        ),
        "TRANSMISSION": spec.transmission,
        "LENGTHS": dict(spec.lengths),
        "PARAMETERS": tuple(name for name in rows.columns if name not in spec.known),
        "KNOWN": dict(spec.known),
        "BASE_PARAMETERS": tuple(b.name for b in model.base),
        "IDENTIFIABLE": model.identifiable,
        "ABSENT": dict(model.absent),
        "PARAMETER_SETS": {name: dict(table) for name, table in spec.parameter_sets.items()},
        "SIGNALS": tuple(signal_key(symbol) for symbol in signals),
        "ROW_KIND": rows.kind,
        "ROWS": rows.names,
        "ENTRIES": tuple(entries),
    }
    return tuple((name, literal(value)) for name, value in values.items())
