"""How far the estimate drifts when settings that should not matter are changed: part of an honest interval.

With a right model and clean sensors the matched filter cancels, and neither the cut-off nor the weight of
the load rows changes anything. Noise in the columns biases least squares and dynamics that the model lacks
bend it; no residual shows either, but the estimate drifts with those settings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Generic, Protocol, TypeVar

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import counted
from modelgen.runtime.diagnostics.thresholds import (
    CUTOFF_FACTORS,
    DIRECTION_FACTOR,
    LOAD_ROW_FACTORS,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.thresholds import HIGHEST_CUTOFF
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.orthogonal_solution import LeastSquares
from modelgen.runtime.least_squares.thresholds import LOAD_ROW_SHARE
from modelgen.runtime.least_squares.wls import solve_matched
from modelgen.runtime.rows.observation import Observation

Found = TypeVar("Found")  # a fit, of whatever kind
Solution = TypeVar("Solution", bound="SolvedColumns")


class SolvedColumns(Protocol):
    """A solution and its columns: a fit, or what is found without keeping rows."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""

    @property
    def solution(self) -> LeastSquares:
        """In their order."""


class Attempts(Generic[Solution]):
    """Fits at other settings; remembers those that say nothing of this one, with the reason.

    Parameters
    ----------
    again : callable
        Observes and fits with other settings.
    choice : FilterChoice
        The settings in use.
    columns : sequence of str
        Those of the fit that others are compared with.
    """

    def __init__(
        self, again: Callable[[FilterChoice], Solution], choice: FilterChoice, columns: Sequence[str]
    ) -> None:
        self._again, self._choice, self._columns = again, choice, tuple(columns)
        self._failed: dict[str, str] = {}

    def __call__(self, other: FilterChoice) -> Solution:
        """Return the fit with other settings; raises what it raises."""
        setting = f"at {other.cutoff_hz:.4g} Hz"
        if other.direction_cutoff_hz != self._choice.direction_cutoff_hz:
            setting = f"with directions below {other.direction_cutoff_hz:.4g} Hz"
        try:
            found = self._again(other)
        except (DataError, IdentifiabilityError) as error:
            problem = error.problems[0]
            self._failed[setting] = f"{problem.where} {problem.what}"
            raise
        only = [name for name in self._columns if name not in found.columns]
        more = [name for name in found.columns if name not in self._columns]
        if only or more:
            self._failed[setting] = f"no column for {', '.join(only)}" if only else f"{', '.join(more)}, too"
        return found

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence on the settings that could not be compared, or nothing."""
        if not self._failed:
            return ()
        listed = ", ".join(f"{setting} ({why})" for setting, why in self._failed.items())
        return (f"the intervals do not hold what other settings would move: nothing to compare {listed}",)


def cutoff_drift(
    fit: Fit, choice: FilterChoice, lowest_fs: float, again: Callable[[FilterChoice], SolvedColumns]
) -> FloatArray:
    """Return the mean square of X's drift (SI) with the cut-off, (c, c); parameters as `other_cutoffs`."""
    others = other_cutoffs(choice, lowest_fs, lambda setting: _found(again(setting)))
    return _mean_square(fit, [other for _, other in others])


def other_cutoffs(
    choice: FilterChoice,
    lowest_fs: float,
    again: Callable[[FilterChoice], Found],
    factors: Sequence[float] = CUTOFF_FACTORS,
) -> list[tuple[FilterChoice, Found]]:
    """Return the fits at other cut-offs, multiples of the present one, where the records allow them.

    Parameters
    ----------
    choice : FilterChoice
        The settings in use; decimation and directions stay.
    lowest_fs : float
        Lowest sampling frequency of the records in Hz: no cut-off above 0.4 of it is tried.
    again : callable
        Observes and fits with other settings.
    """
    others = []
    for factor in counted(factors, "other cut-offs"):
        cutoff_hz = min(factor * choice.cutoff_hz, HIGHEST_CUTOFF * lowest_fs)
        if factor > 1.0 and cutoff_hz <= choice.cutoff_hz:
            continue
        try:
            other = replace(choice, cutoff_hz=cutoff_hz)
            others.append((other, again(other)))
        except (DataError, IdentifiabilityError):
            continue  # a lower cut-off reaches farther: the record may be too short for it
    return others


def direction_drift(
    fit: Fit, choice: FilterChoice, lowest_fs: float, again: Callable[[FilterChoice], SolvedColumns]
) -> FloatArray:
    """Return the square of X's drift (SI) with the cut-off of directions, (c, c); parameters as above."""
    others = other_direction(choice, lowest_fs, lambda setting: _found(again(setting)))
    return _mean_square(fit, [other for _, other in others])


def other_direction(
    choice: FilterChoice, lowest_fs: float, again: Callable[[FilterChoice], Found]
) -> list[tuple[FilterChoice, Found]]:
    """Return the fit at a higher cut-off of directions, where the records allow it; parameters as above."""
    higher_hz = min(DIRECTION_FACTOR * choice.direction_cutoff_hz, HIGHEST_CUTOFF * lowest_fs)
    if higher_hz <= choice.direction_cutoff_hz:
        return []
    try:
        other = replace(choice, direction_cutoff_hz=higher_hz)
        return [(other, again(other))]
    except (DataError, IdentifiabilityError):
        return []  # nearer to the noise, a body may seem to reverse all the time


def load_row_drift(fit: Fit, observation: Observation) -> FloatArray:
    """Return the mean square of X's drift (SI) with the weight of the rows without a force, shape (c, c)."""
    if all(block.has_force for block in fit.blocks):
        return _mean_square(fit, ())
    rows, names = observation.blocks, observation.columns
    shares = [factor * LOAD_ROW_SHARE for factor in LOAD_ROW_FACTORS]
    return _mean_square(fit, [_found(solve_matched(rows, names, share)) for share in shares])


def _found(fit: SolvedColumns) -> tuple[tuple[str, ...], FloatArray]:
    """Return columns and solution, shape (c,), of a fit, whose rows need not stay in memory."""
    return fit.columns, fit.solution.x


def _mean_square(fit: Fit, others: Sequence[tuple[tuple[str, ...], FloatArray]]) -> FloatArray:
    """Return the mean outer product of the differences of X; solutions in other columns do not count."""
    moves = [x - fit.solution.x for columns, x in others if columns == fit.columns]
    total = np.zeros((len(fit.columns), len(fit.columns)))
    for move in moves:
        total += np.outer(move, move) / len(moves)
    return total
