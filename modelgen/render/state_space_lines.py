"""The matrices of the state space as lines of source."""

from __future__ import annotations

from collections.abc import Iterable

from modelgen.render.printer import weighted_sum
from modelgen.symbolic.equations.state_space import Entry, StateSpace


def state_space_lines(space: StateSpace) -> Iterable[str]:
    """Return the assignments that fill A, B, C, D, E and F, arrays of zeros, from parameters `p`."""
    count = len(space.bodies)
    for index in range(count):
        yield f"A[{index}, {count + index}] = 1.0"
    for entry in space.a:
        yield from _entry_lines("A", entry)
    for name, entries in (("B", space.b), ("E", space.e)):
        for entry in entries:
            yield from _entry_lines(name, entry)
    for row, output in enumerate(space.outputs):
        for place, factor in output.combination:
            if output.order < 2:
                yield f"C[{row}, {place + count * output.order}] = {float(factor)!r}"
                continue
            for out, source in (("C", "A"), ("D", "B"), ("F", "E")):
                yield f"{out}[{row}, :] += {float(factor)!r} * {source}[{count + place}, :]"


def _entry_lines(matrix: str, entry: Entry) -> Iterable[str]:
    total = weighted_sum((c, "1.0" if name is None else f'p["{name}"]') for c, name in entry.form)
    total = f"({total})" if len(entry.form) > 1 else total
    line = f'{matrix}[{entry.row}, {entry.column}] += {total} / p["{entry.inertia}"]'
    if entry.direction is None:
        yield line
    else:
        body, sense = entry.direction
        relation = ">" if sense > 0 else "<"
        yield f'if d["{body}"] {relation} 0:'
        yield f"    {line}"
