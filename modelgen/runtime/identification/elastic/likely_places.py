"""Places that steps lead to: from springs of one share, and where those do not explain the rows from many.

Springs of one arm deflect by about the same share of the motion, unless one has its mode in the band of the
motion: it deflects by more than its motor moves, and from starts of one share runs to where it is rigid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.identification.elastic.settling import (
    begun_with_forces_open,
    likely_starts,
    settled,
)
from modelgen.runtime.identification.elastic.starting_springs import (
    scattered_springs,
    springs_pull,
    starting_springs,
)
from modelgen.runtime.identification.elastic.steps_about import (
    OpenRest,
    fit_about,
    left_by,
    moved,
    names_acting,
    rest_with_forces_open,
)
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import (
    FEWEST_SCATTERED,
    HELD_STEPS,
    LEFT_BY_ARMS,
    OVER_NOISE,
    SETTLING_STEPS,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import refit
from modelgen.runtime.model.deflected_kernel import DeflectedKernel


@dataclass(frozen=True, eq=False)
class StartedSprings:
    """Where steps lead from springs to start with, in rows of a job: looked for once, however often asked.

    Points are base parameters, shape (columns,), in SI.
    """

    job: Job
    kernel: DeflectedKernel

    def places(self, scattered: bool = True) -> list[FloatArray]:
        """Return where steps from springs to start with lead, what leaves least first.

        From more starts where that leaves more than noise, if they may be `scattered`: one spring alone has
        nothing to be in ratio to. Points have shape (columns,).
        """
        job, kernel, places = self.job, self.kernel, self._led
        enough = not scattered or len(kernel.giving) < FEWEST_SCATTERED
        if enough or (places and explains(job, kernel, places[0])):
            return places
        more = scattered_springs(job.model, kernel, job.records)
        others = self._steps(job, kernel, likely_starts(job, kernel, more))
        if not places or (others and _left(job, kernel, others[0]) < _left(job, kernel, places[0])):
            return [*others, *places]
        return places

    @cached_property
    def with_forces_open(self) -> OpenRest | None:
        """Where rows that leave forces open come to rest; None where nowhere."""
        starts = starting_springs(self.job.model, self.kernel, self.job.records)
        begun = begun_with_forces_open(self.job, self.kernel, starts)
        return rest_with_forces_open(self.job, self.kernel, begun)

    @cached_property
    def _led(self) -> list[FloatArray]:
        job, kernel = self.job, self.kernel
        starts = starting_springs(job.model, kernel, job.records)
        if kernel.motors_alone:
            return settled(job, kernel, starts)
        every = [*starts]
        return _stepped_from(job, kernel, every, _told_by_readings(job, kernel, every))

    @property
    def _steps(self) -> Callable[[Job, DeflectedKernel, Iterable[FloatArray]], list[FloatArray]]:
        return settled if self.kernel.motors_alone else _stepped_from


def explains(job: Job, kernel: DeflectedKernel, point: FloatArray) -> bool:
    """Return whether rows about a point, (columns,) in SI, leave about noise, or hardly anything.

    Where directions are of motors that no sensor sees, of rows that leave forces open.
    """
    model = replace(job.model, kernel=kernel.at(point, sampled=bool(kernel.speeds)))
    try:
        fit = fit_about(job, kernel, point, sampled=bool(kernel.speeds))
    except IdentifiabilityError:
        return False
    return not exceeding_noise(model, job.records, job.choice, fit, OVER_NOISE, LEFT_BY_ARMS)


def _left(job: Job, kernel: DeflectedKernel, point: FloatArray) -> float:
    """Return what rows about a point leave, see `left_by`; infinite where they tell nothing."""
    try:
        return left_by(fit_about(job, kernel, point))
    except IdentifiabilityError:
        return np.inf


def _stepped_from(
    job: Job, kernel: DeflectedKernel, starts: Iterable[FloatArray], told: FloatArray | None = None
) -> list[FloatArray]:
    """Return where a few steps lead from starts, base parameters in SI, what leaves least first.

    Readings of what springs place may have `told` the springs before any link is known: where steps from
    there explain the rows no other start is needed.
    """
    ends = [] if told is None else [_stepped(job, kernel, told, SETTLING_STEPS)]
    if not (ends and ends[0][0] is not None and explains(job, kernel, ends[0][0])):
        ends += [_stepped(job, kernel, start, SETTLING_STEPS) for start in starts]
    return [point for point, _ in sorted(ends, key=lambda one: one[1]) if point is not None]


def _told_by_readings(job: Job, kernel: DeflectedKernel, starts: Iterable[FloatArray]) -> FloatArray | None:
    """Return the first springs and drives, (columns,) in SI, that rows with no other unknowns lead to.

    A speed or an acceleration of a link that its spring places is nearly linear in 1 / K, and holds no
    inertia. None where rows are not such, or do not tell every spring.
    """
    alone = [row for row in kernel.rows if {*job.model.regressor_columns[row]} <= {*kernel.columns}]
    if not alone or len(alone) == len(kernel.rows):
        return None
    springs, dampers = (names_acting(job.model, kernel, order) for order in (0, 1))
    for point in starts:
        with suppress(IdentifiabilityError):
            for count in range(HELD_STEPS + SETTLING_STEPS):
                fit = _of_rows(fit_about(job, kernel, point), alone)
                if not springs <= {*fit.columns}:
                    return None
                if count < HELD_STEPS:
                    fit = refit(fit, [name for name in fit.columns if name not in dampers])
                point = moved(job.model, kernel, fit, point)
            if springs_pull(kernel, point):
                return point
    return None


def _of_rows(fit: Fit, rows: Sequence[int]) -> Fit:
    """Return least squares of some rows of a fit, with its weights, in the columns that they hold."""
    kept = [place for place, block in enumerate(fit.blocks) if block.row in rows]
    weights = tuple(fit.weights[place] for place in kept)
    some = replace(fit, blocks=tuple(fit.blocks[place] for place in kept), weights=weights)
    held = np.any(some.triangle[:, :-1], axis=0)
    return refit(some, [name for name, one in zip(fit.columns, held, strict=True) if one])


def _stepped(
    job: Job, kernel: DeflectedKernel, point: FloatArray, steps: int
) -> tuple[FloatArray | None, float]:
    """Return the point after so many steps, None where one fails, and what the last one left.

    The first of them leave springs and dampers as they are, the next ones dampers: what acts less is to
    follow what acts more.
    """
    left = np.inf
    springs, dampers = (names_acting(job.model, kernel, order) for order in (0, 1))
    for count in range(steps):
        try:
            fit = fit_about(job, kernel, point)
            held = springs | dampers if count < HELD_STEPS else dampers if count < 2 * HELD_STEPS else set()
            if held:
                fit = refit(fit, [name for name in fit.columns if name not in held])
        except IdentifiabilityError:
            return None, np.inf
        point = moved(job.model, kernel, fit, point)
        if not springs_pull(kernel, point):
            return None, np.inf
        left = left_by(fit)
    return point, left
