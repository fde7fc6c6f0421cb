"""Are two regressors equal? Algebra on rows that are linear in parameter times signal.

A row 0 = y - D x is a vector over the pairs (parameter, signal), with rational coefficients; "signal" is a
derivative of a body's coordinate or of a force, however a sensor reads it. Two regressors are equal if their
rows are, equal up to a combination if their rows span the same space, and different otherwise; then it may
still be that a row of one is a derivative of a row of the other, which is reported separately.

All of it is exact, unless a coefficient is no small fraction (the 2 pi / lead of a screw): numbers are equal
then that differ by no more than `TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from modelgen.symbolic.exact_dependencies import exact_dependencies

EQUAL, COMBINATION, DIFFERENT = "equal", "equal up to a combination", "different"
MOST_DERIVATIVES = 6
TOLERANCE = (
    1e-8  # of rows and columns of unit size; doubles that have been solved for keep nine digits or more
)
BALANCING_ROUNDS = 10


@dataclass(frozen=True, order=True)
class FormalSignal:
    """A signal, independent of the sensor that reads it.

    `kind` is "q" (coordinate), "force", "one", or a feature with everything it depends on; `name` is the
    body, or a feature's text; `order` counts the derivatives.
    """

    kind: str
    name: str
    order: int


# (parameter or "" for the left-hand side, signal) -> coefficient
FormalRow = Mapping[tuple[str, FormalSignal], Fraction]


@dataclass(frozen=True)
class FormalRegressor:
    """The named rows of one model; `rounded` where some coefficient is a double and no small fraction."""

    title: str
    names: tuple[str, ...]
    rows: tuple[FormalRow, ...]
    rounded: bool = False


@dataclass(frozen=True)
class Relation:
    """How `second` stands to `first`; `lines` holds for each row where it is found in the other."""

    first: str
    second: str
    verdict: str
    lines: tuple[str, ...]


def compare(first: FormalRegressor, second: FormalRegressor) -> Relation:
    """Return how two regressors relate."""
    rounded = first.rounded or second.rounded
    verdict = DIFFERENT
    if _same_rows(first.rows, second.rows, rounded):
        verdict = EQUAL
    elif _spans(first.rows, second.rows, rounded) and _spans(second.rows, first.rows, rounded):
        verdict = COMBINATION
    lines = []
    if verdict != EQUAL:
        lines = [*_lines(first, second, rounded), *_lines(second, first, rounded)]
    return Relation(first.title, second.title, verdict, tuple(lines))


def differentiated(row: FormalRow) -> FormalRow | None:
    """Return a row's derivative, between reversals; None where a nonlinear feature does not allow it."""
    moved: dict[tuple[str, FormalSignal], Fraction] = {}
    for (parameter, signal), coefficient in row.items():
        if signal.kind in ("one", "sign"):
            continue  # constant between reversals
        if signal.kind not in ("q", "force"):
            return None
        moved[parameter, FormalSignal(signal.kind, signal.name, signal.order + 1)] = coefficient
    return moved


def rank(rows: Sequence[FormalRow], rounded: bool = False) -> int:
    """Return the number of independent rows, by elimination over the rationals or by singular values."""
    return _rank_of_doubles(rows) if rounded else len(rows) - len(exact_dependencies(rows))


def _rank_of_doubles(rows: Sequence[FormalRow]) -> int:
    """Return the rank to a tolerance, with rows and columns brought to unit size: gears spread them."""
    places = {place: index for index, place in enumerate(sorted({key for row in rows for key in row}))}
    matrix = np.zeros((len(rows), len(places)))
    for index, row in enumerate(rows):
        for place, value in row.items():
            matrix[index, places[place]] = float(value)
    matrix = matrix[np.any(matrix != 0.0, axis=1)]
    if not matrix.size:
        return 0
    for _ in range(BALANCING_ROUNDS):
        for axis in (0, 1):
            matrix /= np.sqrt(np.abs(matrix).max(axis=axis, keepdims=True))
    matrix /= np.linalg.norm(matrix, axis=1, keepdims=True)
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(sizes > TOLERANCE * sizes[0]))


def _same_rows(first: Sequence[FormalRow], second: Sequence[FormalRow], rounded: bool) -> bool:
    """Return whether the rows are the same in any order."""
    left = list(second)
    for row in first:
        found = next((index for index, other in enumerate(left) if _same(row, other, rounded)), None)
        if found is None:
            return False
        del left[found]
    return not left


def _same(row: FormalRow, other: FormalRow, rounded: bool) -> bool:
    if not rounded:
        return dict(row) == dict(other)
    return row.keys() == other.keys() and all(
        abs(row[key] - other[key]) <= TOLERANCE * abs(row[key]) for key in row
    )


def _spans(basis: Sequence[FormalRow], rows: Sequence[FormalRow], rounded: bool) -> bool:
    return rank([*basis, *rows], rounded) == rank(basis, rounded)


def _lines(of: FormalRegressor, among: FormalRegressor, rounded: bool) -> list[str]:
    lines = []
    for name, row in zip(of.names, of.rows, strict=True):
        lines.append(f"{of.title}, row {name}: {_found(row, among, rounded)} {among.title}")
    return lines


def _found(row: FormalRow, among: FormalRegressor, rounded: bool) -> str:
    for name, other in zip(among.names, among.rows, strict=True):
        if _same(row, other, rounded):
            return f"row {name} of"
    if _spans(among.rows, [row], rounded):
        return "a combination of rows of"
    for name, other in zip(among.names, among.rows, strict=True):
        times = _derivative_of(row, other, rounded)
        if times:
            return f"{_times(times)} derivative of row {name} of"
        times = _derivative_of(other, row, rounded)
        if times:
            return f"row {name} is its {_times(times)} derivative in"
    return "not in"


def _derivative_of(row: FormalRow, other: FormalRow, rounded: bool) -> int:
    """Return how often `other` must be differentiated to give a multiple of `row`; 0 if it never does."""
    moved: FormalRow | None = other
    for times in range(1, MOST_DERIVATIVES + 1):
        moved = differentiated(moved) if moved is not None else None
        if not moved:
            return 0
        if rank([row, moved], rounded) == 1:
            return times
    return 0


def _times(times: int) -> str:
    return {1: "first", 2: "second", 3: "third"}.get(times, f"{times}th")
