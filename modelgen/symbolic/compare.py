"""Are two regressors equal? Exact algebra on rows that are linear in parameter times signal.

A row 0 = y - D x is a vector over the pairs (parameter, signal), with rational coefficients; "signal" is a
derivative of a body's coordinate or of a force, however a sensor reads it. Two regressors are equal if their
rows are, equal up to a combination if their rows span the same space, and different otherwise; then it may
still be that a row of one is a derivative of a row of the other, which is reported separately.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

EQUAL, COMBINATION, DIFFERENT = "equal", "equal up to a combination", "different"
MOST_DERIVATIVES = 6


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
    """The named rows of one model."""

    title: str
    names: tuple[str, ...]
    rows: tuple[FormalRow, ...]


@dataclass(frozen=True)
class Relation:
    """How `second` stands to `first`; `lines` holds for each row where it is found in the other."""

    first: str
    second: str
    verdict: str
    lines: tuple[str, ...]


def compare(first: FormalRegressor, second: FormalRegressor) -> Relation:
    """Return how two regressors relate."""
    verdict = DIFFERENT
    if sorted(map(_sorted_items, first.rows)) == sorted(map(_sorted_items, second.rows)):
        verdict = EQUAL
    elif _spans(first.rows, second.rows) and _spans(second.rows, first.rows):
        verdict = COMBINATION
    lines = [*_lines(first, second), *_lines(second, first)] if verdict != EQUAL else []
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


def rank(rows: Sequence[FormalRow]) -> int:
    """Return the number of independent rows, by elimination over the rationals."""
    return len(_echelon(rows))


def _spans(basis: Sequence[FormalRow], rows: Sequence[FormalRow]) -> bool:
    return rank([*basis, *rows]) == rank(basis)


def _lines(of: FormalRegressor, among: FormalRegressor) -> list[str]:
    lines = []
    for name, row in zip(of.names, of.rows, strict=True):
        lines.append(f"{of.title}, row {name}: {_found(row, among)} {among.title}")
    return lines


def _found(row: FormalRow, among: FormalRegressor) -> str:
    for name, other in zip(among.names, among.rows, strict=True):
        if dict(row) == dict(other):
            return f"row {name} of"
    if _spans(among.rows, [row]):
        return "a combination of rows of"
    for name, other in zip(among.names, among.rows, strict=True):
        times = _derivative_of(row, other)
        if times:
            return f"{_times(times)} derivative of row {name} of"
        times = _derivative_of(other, row)
        if times:
            return f"row {name} is its {_times(times)} derivative in"
    return "not in"


def _derivative_of(row: FormalRow, other: FormalRow) -> int:
    """Return how often `other` must be differentiated to give a multiple of `row`; 0 if it never does."""
    moved: FormalRow | None = other
    for times in range(1, MOST_DERIVATIVES + 1):
        moved = differentiated(moved) if moved is not None else None
        if not moved:
            return 0
        if rank([row, moved]) == 1:
            return times
    return 0


def _times(times: int) -> str:
    return {1: "first", 2: "second", 3: "third"}.get(times, f"{times}th")


def _echelon(rows: Sequence[FormalRow]) -> list[dict[tuple[str, FormalSignal], Fraction]]:
    """Return independent rows, each with a leading entry that the later ones do not have."""
    kept: list[tuple[tuple[str, FormalSignal], dict[tuple[str, FormalSignal], Fraction]]] = []
    for row in rows:
        rest = dict(row)
        for lead, pivot in kept:
            if lead in rest:
                factor = rest[lead] / pivot[lead]
                for key, value in pivot.items():
                    rest[key] = rest.get(key, Fraction(0)) - factor * value
                    if rest[key] == 0:
                        del rest[key]
        if rest:
            kept.append((min(rest), rest))
    return [row for _, row in kept]


def _sorted_items(row: FormalRow) -> list[tuple[tuple[str, FormalSignal], Fraction]]:
    return sorted(row.items())
