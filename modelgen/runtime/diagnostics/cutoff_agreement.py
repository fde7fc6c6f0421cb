"""Does the estimate agree with itself at other cut-offs? Where it does not, the model lacks something.

Instrumental variables are consistent at any cut-off, of signals or of directions, as long as the model is
right. A difference between two cut-offs is then noise, and its standard deviation follows from both fits'
influence series (a test of the kind of Hausman 1978). What is more than noise is model error: it widens the
intervals by what the estimate moves.

What was fitted in physical parameters is compared in them: composites move together, and a covariance in
which some of them rest while others move would let the step back to physical parameters see through the move.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.diagnostics.settings_drift import other_cutoffs, other_direction
from modelgen.runtime.diagnostics.thresholds import FARTHER_FACTORS, SIGNIFICANT_MOVE, SMALLEST_SHARE
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import influence_parts, long_run_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.bandwidth import PART, Series


@dataclass(frozen=True, eq=False)
class FitCoordinates:
    """What a fit is compared in: parameters p near which its columns are X + slope (p' - p).

    `values` are p in SI, shape (n,); `slope` has the shape (columns, n).
    """

    names: tuple[str, ...]
    values: FloatArray
    slope: FloatArray

    @cached_property
    def inverse(self) -> FloatArray:
        """From a small move of the columns to that of the parameters, shape (n, columns)."""
        return np.asarray(np.linalg.pinv(self.slope))

    def in_columns(self, covariance: FloatArray) -> FloatArray:
        """Return a covariance of the parameters as that of the columns, shape (columns, columns)."""
        return np.asarray(self.slope @ covariance @ self.slope.T)


def own_columns(fit: Fit) -> FitCoordinates:
    """Return the columns of a fit as they are."""
    return FitCoordinates(fit.columns, fit.solution.x, np.eye(len(fit.columns)))


def coordinates_of(fit: Fit, model: Model, at_zero: Collection[str] = ()) -> FitCoordinates:
    """Return the physical parameters of a fit that was made in them, else its columns.

    `at_zero` are physical parameters that bounds hold at zero.
    """
    values = fit.physical(model.parameters)
    if values is None:
        return own_columns(fit)
    values = {name: 0.0 if name in at_zero else value for name, value in values.items()}
    slope = model.base_jacobian(values)[[model.base_parameters.index(name) for name in fit.columns]]
    return FitCoordinates(model.parameters, np.array(list(values.values())), slope)


@dataclass(frozen=True, eq=False)
class Disagreement:
    """How the estimate moves at one other cut-off, in the order of its coordinates.

    `move` is X there minus X here, `std` the standard deviation that noise would give it, `value` X here.
    `cutoff_hz` is that of the directions of motion where `directions` is true.
    """

    cutoff_hz: float
    move: FloatArray
    std: FloatArray
    value: FloatArray
    directions: bool = False

    @property
    def significant(self) -> BoolArray:
        """Which columns move by more than noise explains, shape (c,)."""
        least = np.maximum(SIGNIFICANT_MOVE * self.std, SMALLEST_SHARE * np.abs(self.value))
        return np.asarray(np.abs(self.move) > least)

    @property
    def setting(self) -> str:
        """What was changed, in words."""
        return f"{'with directions below' if self.directions else 'at'} {self.cutoff_hz:.4g} Hz"


def all_disagreements(
    fit: Fit,
    choice: FilterChoice,
    lowest_fs: float,
    again: Callable[[FilterChoice], Fit],
    directions: bool,
    coordinates: FitCoordinates | None = None,
) -> tuple[Disagreement, ...]:
    """Fit at other cut-offs and compare.

    Parameters
    ----------
    fit : Fit
    choice : FilterChoice
        The settings it was made with.
    lowest_fs : float
        Lowest sampling frequency of the records in Hz.
    again : callable
        Observes and fits with other settings.
    directions : bool
        Whether the model has any: their cut-off is then changed as well.
    coordinates : FitCoordinates, optional
        What to compare in, by default the fit's columns.
    """
    seen = coordinates or own_columns(fit)

    def compared(setting: FilterChoice) -> Disagreement | None:
        # at once: rows of one other setting at a time are in memory
        return disagreement(fit, choice, setting, again(setting), seen)

    found = other_cutoffs(choice, lowest_fs, compared)
    if any(one is not None and np.any(one.significant) for _, one in found):
        found += other_cutoffs(choice, lowest_fs, compared, FARTHER_FACTORS)
    if directions:
        found += other_direction(choice, lowest_fs, compared)
    return tuple(one for _, one in found if one is not None)


def disagreement(
    fit: Fit, choice: FilterChoice, setting: FilterChoice, other: Fit, coordinates: FitCoordinates
) -> Disagreement | None:
    """Compare a fit with that at another cut-off, of signals or directions; None if it has other columns."""
    if other.columns != fit.columns:
        return None
    directions = setting.direction_cutoff_hz != choice.direction_cutoff_hz
    back = coordinates.inverse
    covariance = back @ _difference(fit, other, choice.decimation) @ back.T
    return Disagreement(
        setting.direction_cutoff_hz if directions else setting.cutoff_hz,
        back @ (other.solution.x - fit.solution.x),
        np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        coordinates.values,
        directions,
    )


def significant_drift(found: Sequence[Disagreement], size: int) -> FloatArray:
    """Return the mean square of the moves that noise does not explain, in SI, shape (size, size).

    The mean over cut-offs of signals and that over cut-offs of directions add up.
    """
    total = np.zeros((size, size))
    for one in found:
        move = np.where(one.significant, one.move, 0.0)
        total += np.outer(move, move) / sum(other.directions == one.directions for other in found)
    return total


def disagreement_notes(
    found: Sequence[Disagreement], columns: Sequence[str], identified: Sequence[str]
) -> tuple[str, ...]:
    """Return one sentence that names what moves, or nothing."""
    largest: dict[str, tuple[float, str]] = {}
    for one in found:
        for name, value, move, significant in zip(columns, one.value, one.move, one.significant, strict=True):
            if significant and name in identified and value:
                share = 100.0 * abs(float(move / value))
                if share > largest.get(name, (0.0, ""))[0]:
                    largest[name] = share, one.setting
    if not largest:
        return ()
    listed = ", ".join(f"{name} {share:.2g} % {setting}" for name, (share, setting) in largest.items())
    lacking = "dynamics or friction near reversals" if "directions" in listed else "dynamics"
    return (
        f"model error: other cut-offs move the estimate by more than noise explains ({listed}); the model "
        f"lacks {lacking}, or a channel is late; the intervals include it",
    )


def _difference(fit: Fit, other: Fit, decimation: Sequence[int]) -> FloatArray:
    """Return the covariance of the difference of two fits to the same records, shape (c, c)."""
    series: list[Series] = []
    ours, theirs = _grids(fit), _grids(other)
    # at a lower cut-off a record may have no sample left
    those = dict(zip(theirs, influence_parts(other), strict=True))
    for record, mine in zip(ours, influence_parts(fit), strict=True):
        if record not in those:
            series.append(mine)  # a covariance has no sign
            continue
        (start, count), (begin, there) = ours[record], theirs[record]
        # both grids on one: the nearest point of it, half a step off at most
        shift = round((begin - start) / decimation[record])
        first = min(0, shift)
        length = max(count, there + shift) - first
        sides = (
            partial(_aligned, mine, -first, length),
            partial(_aligned, those[record], shift - first, length),
        )
        series.append(partial(_subtracted, *sides))
    return long_run_covariance(series, grown=False)


def _grids(fit: Fit) -> dict[int, tuple[int, int]]:
    """Return where the grid of each record of a fit begins, and its length."""
    return {block.record: (block.start, block.grid) for block in fit.blocks}


def _subtracted(one: Series, other: Series) -> Iterator[FloatArray]:
    return (b - a for a, b in zip(one(), other(), strict=True))


def _aligned(series: Series, lead: int, length: int) -> Iterator[FloatArray]:
    """Yield a series of so many instants in even parts, behind a lead of zeros and with zeros after it."""
    parts = series()
    part = next(parts)
    held, step = np.concatenate([np.zeros((lead, part.shape[1])), part]), max(1, PART // part.shape[1])
    for first in range(0, length, step):
        count = min(step, length - first)
        while len(held) < count:
            missing = np.zeros((count - len(held), held.shape[1]))
            held = np.concatenate([held, next(parts, missing)])
        yield held[:count]
        held = held[count:]
