"""Held-out records or periods: whether the estimate explains what it has not seen, and agrees with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Real

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, ModelgenError, Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.thresholds import SIGNIFICANT_MOVE, SMALLEST_SHARE
from modelgen.runtime.filter_choice.thresholds import FEWEST_SAMPLES
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.rows.observation import Observation


@dataclass(frozen=True)
class HeldOutRow:
    """One row on one held-out record: its relative error with the estimate, and that where it was fitted.

    For a row without a force relative to its largest term. `fitted_error` is None where the row was not
    fitted.
    """

    record: str
    row: str
    samples: int
    relative_error: float
    fitted_error: float | None


@dataclass(frozen=True)
class Move:
    """How a parameter differs on the held-out part, and the standard deviation that noise gives that."""

    name: str
    move: float
    std: float
    share: float

    @property
    def significant(self) -> bool:
        """Whether it is more than noise."""
        return abs(self.move) > SIGNIFICANT_MOVE * self.std and abs(self.share) > SMALLEST_SHARE


@dataclass(frozen=True)
class HeldOut:
    """What the held-out records say: of each row, and of each parameter if they can answer it."""

    records: tuple[str, ...]
    rows: tuple[HeldOutRow, ...]
    moves: tuple[Move, ...]

    def drift(self, columns: Sequence[str]) -> FloatArray:
        """Return the variance between the two parts that noise does not explain, in SI, shape (c, c)."""
        by_name = {one.name: one.move if one.significant else 0.0 for one in self.moves}
        move = np.array([by_name.get(name, 0.0) for name in columns])
        # of two values the variance is half the square of their difference
        return 0.5 * np.outer(move, move)


def held_apart(
    records: Sequence[Record], hold_out: Sequence[str] | str | float | None, period_s: Mapping[str, float]
) -> tuple[tuple[Record, ...], tuple[Record, ...]]:
    """Return the records to identify from and those held out.

    Parameters
    ----------
    hold_out : str, sequence of str, float or None
        Names of records, or the share at the end of every record, rounded to whole periods where it has any.

    Raises
    ------
    DataError
        When a name is no record's, every record is held out, or a share is not between 0 and 1.
    """
    if hold_out is None:
        return tuple(records), ()
    if isinstance(hold_out, Real) and not isinstance(hold_out, bool):
        share = float(hold_out)
        if not 0.0 < share < 1.0:
            raise DataError.at("hold_out", f"is {hold_out!r}", "give a share between 0 and 1, or names")
        pairs = [_cut(record, share, period_s.get(record.name)) for record in records]
        return tuple(kept for kept, _ in pairs), tuple(held for _, held in pairs)
    names = (hold_out,) if isinstance(hold_out, str) else tuple(hold_out)  # type: ignore[arg-type]
    known = [record.name for record in records]
    problems = [missing_name("hold_out", "record", name, known) for name in names if name not in known]
    if not problems and all(name in names for name in known):
        problems.append(Problem("hold_out", "leaves no record to identify from", "hold out fewer"))
    DataError.raise_any(problems)
    return (
        tuple(record for record in records if record.name not in names),
        tuple(record for record in records if record.name in names),
    )


@contextmanager
def little_left(hold_out: Sequence[str] | str | float | None) -> Iterator[None]:
    """Add to an error within that most of every record is held out, where that may be its reason."""
    try:
        yield
    except ModelgenError as error:
        if not isinstance(hold_out, Real) or float(hold_out) < 0.5:
            raise
        what = f"leaves {100.0 * (1.0 - float(hold_out)):.3g} % of every record to identify from"
        less = Problem("hold_out", what, "hold out less (--hold-out 0.3)")
        raise type(error)(less, *error.problems) from None


def held_out(fit: Fit, refused: Mapping[str, str], observation: Observation, own: Fit | None) -> HeldOut:
    """Judge a fit on rows it has not seen.

    Parameters
    ----------
    fit : Fit
    refused : mapping of str to str
        Columns of the fit that are no estimates.
    observation : Observation
        The held-out rows.
    own : Fit or None
        The fit to these rows alone, if they can answer for themselves.
    """
    fitted: dict[str, tuple[float, float]] = {}
    for index, block in enumerate(fit.blocks):
        before = fitted.get(block.row_name, (0.0, 0.0))
        size = block.size(fit.solution.x)
        fitted[block.row_name] = before[0] + fit.residual_norms[index] ** 2, before[1] + size**2
    columns = [observation.columns.index(name) for name in fit.columns]
    rows = []
    for block in observation.blocks:
        if not block.count:
            continue
        seen = block.chosen(columns)
        size = seen.size(fit.solution.x)
        left = seen.summary.residual_norm(fit.solution.x)
        error, power = fitted.get(block.row_name, (0.0, 0.0))
        rows.append(
            HeldOutRow(
                block.record_name,
                block.row_name,
                block.count,
                left / size if size > 0.0 else 0.0,
                float(np.sqrt(error / power)) if power > 0.0 else None,
            )
        )
    names = tuple(dict.fromkeys(block.record_name for block in observation.blocks))
    return HeldOut(names, tuple(rows), _moves(fit, refused, own))


def hold_out_advice(found: HeldOut) -> tuple[Advice, ...]:
    """Return the warning that the held-out part says otherwise, where it does by more than noise."""
    moved = [one for one in found.moves if one.significant]
    if not moved:
        return ()
    listed = ", ".join(f"{one.name} {100.0 * one.share:+.2g} %" for one in moved)
    return (
        Advice(
            "held-out records disagree",
            ", ".join(found.records),
            f"would move the estimate by more than noise explains ({listed})",
            "the model lacks something that differs between them; the intervals include it",
        ),
    )


def _moves(fit: Fit, refused: Mapping[str, str], own: Fit | None) -> tuple[Move, ...]:
    if own is None or own.columns != fit.columns:
        return ()
    variance = np.diag(hac_covariance(fit)) + np.diag(hac_covariance(own))
    move = own.solution.x - fit.solution.x
    return tuple(
        Move(name, float(move[k]), float(np.sqrt(max(variance[k], 0.0))), float(move[k] / value))
        for k, (name, value) in enumerate(zip(fit.columns, fit.solution.x, strict=True))
        if name not in refused and value and not own.solution.undetermined[k]
    )


def _cut(record: Record, share: float, period_s: float | None) -> tuple[Record, Record]:
    """Return the first part of a record and the share at its end."""
    at = round((1.0 - share) * record.n)
    if period_s is not None:
        period = period_s * record.fs
        whole = max(round(at / period), 1)
        at = round(whole * period) if round(whole * period) < record.n else at
    least = min(at, record.n - at)
    if least < FEWEST_SAMPLES:
        what = f"{share:g} leaves {least} of its {record.n} samples to "
        what += "identify from" if at == least else "test with"
        low = np.ceil(1e3 * FEWEST_SAMPLES / record.n) / 1e3
        between = f"give a share from {low:.3g} to {1.0 - low:.3g} (--hold-out 0.3)"
        remedy = between if low < 0.5 else "give a longer record, or hold out none"
        raise DataError.at(f"{record.name}: hold_out", what, remedy)
    return record.part(0, at, record.name), record.part(at, record.n, f"{record.name} (held out)")
