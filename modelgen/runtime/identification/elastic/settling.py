"""From springs that motors alone see to where rows leave least: steps of Levenberg and Marquardt.

Gauss and Newton's steps are right near an estimate. Far from it rows bend: a step that is to leave less
leaves more, and springs run to where they are rigid. So what rows leave is computed at every point, and steps
of what positions depend on are shortened until it falls.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.elastic.steps_about import (
    columns_of,
    held_values,
    left_by,
    moved_least,
    tried,
)
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import (
    BEST_PLACES,
    FEW_STEPS,
    FIRST_DAMPING,
    FIRST_STEPS,
    HARDLY_SEEN,
    LIKELY_STARTS,
    MORE_STEPS,
    MOST_DAMPING,
    SAME_PLACE,
    SETTLED,
    STEPS_HELD,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.deflected_kernel import DeflectedKernel


class Settled(NamedTuple):
    """Base parameters, shape (columns,), in SI, and what rows leave there, see `left_by`."""

    point: FloatArray
    left: float


def settled(job: Job, kernel: DeflectedKernel, starts: Iterable[FloatArray]) -> list[FloatArray]:
    """Return where rows leave least from any of these starts on, what leaves least first.

    A few steps from each, until two come to the best place, and more from the best that are not the same; at
    first springs and dampers are held (`_begun`), then dampers: what acts less is to follow what acts more.
    Points are base parameters, shape (columns,), in SI.
    """
    springs, dampers = ({column for row in kernel.giving for column in row.acting(o)} for o in (0, 1))
    places: list[Settled] = []
    for start in starts:
        begun = _begun(job, kernel, start, springs | dampers)
        place: Settled | None = None if begun is None else Settled(begun, np.inf)
        for held in (dampers, set[int]())[0 if dampers else 1 :]:
            place = place and settled_with(job, kernel, place.point, held, STEPS_HELD if held else FEW_STEPS)
        places = sorted([*places, *([] if place is None else [place])], key=lambda one: one.left)
        if len(places) > 1 and _same_springs(kernel, *places[:2]):
            break
    best: list[Settled] = []
    for place in places:
        if len(best) < BEST_PLACES and not any(_same_springs(kernel, place, one) for one in best):
            best.append(settled_with(job, kernel, place.point, (), MORE_STEPS) or place)
    return [place.point for place in sorted(best, key=lambda one: one.left)]


def begun_with_forces_open(
    job: Job, kernel: DeflectedKernel, starts: Iterable[FloatArray]
) -> list[FloatArray]:
    """Return starts, (columns,) in SI, with the links and drives of rows that leave forces open."""
    held = {column for row in kernel.giving for order in (0, 1) for column in row.acting(order)}
    begun = (_begun(job, kernel, start, held, sampled=True) for start in starts)
    return [point for point in begun if point is not None]


def likely_starts(job: Job, kernel: DeflectedKernel, starts: Iterable[FloatArray]) -> list[FloatArray]:
    """Return those of many starts with which links and drives leave least, as that is found in few steps.

    Points are base parameters, shape (columns,), in SI.
    """
    held = {column for row in kernel.giving for order in (0, 1) for column in row.acting(order)}
    found: list[Settled] = []
    for start in starts:
        begun = _begun(job, kernel, start, held)
        fit = None if begun is None else tried(job, kernel, begun)
        if begun is not None and fit is not None:
            found.append(Settled(begun, _left_at(job, fit, begun)))
    return [one.point for one in sorted(found, key=lambda one: one.left)[:LIKELY_STARTS]]


def settled_with(
    job: Job,
    kernel: DeflectedKernel,
    point: FloatArray,
    held: Collection[int],
    steps: int,
) -> Settled | None:
    """Return where rows leave least after so many steps, some columns `held`; None where nothing holds.

    `point` are base parameters, shape (columns,), in SI.
    """
    fit = tried(job, kernel, point)
    if fit is None:
        return None
    damping, begun = 0.0, bool(np.any(point[columns_of(fit, job.model)]))
    left = _left_at(job, fit, point) if begun else np.inf
    for _ in range(steps):
        if fit.count * (left - left_by(fit, held_values(fit, job.model, point, held))) < SETTLED:
            break
        ahead = moved_least(job.model, kernel, fit, point, held, damping)
        found = tried(job, kernel, ahead)
        there = np.inf if found is None else _left_at(job, found, ahead)
        if found is not None and there < left:
            point, fit, left, damping = ahead, found, there, 0.1 * damping
        elif damping > MOST_DAMPING:
            break
        else:
            damping = 10.0 * max(damping, 0.1 * FIRST_DAMPING)
    return Settled(point, left)


def _begun(
    job: Job, kernel: DeflectedKernel, point: FloatArray, held: Collection[int], sampled: bool = False
) -> FloatArray | None:
    """Return links and drives to begin with beside such springs; None where nothing holds.

    Only deflections tell a motor's inertia from its link's. Those of springs far off made one of them several
    times too large and the other negative, beyond which a spring runs to where it is rigid. So what rows
    hardly show stays even at first. Points are base parameters, shape (columns,), in SI.
    """
    for _ in range(FIRST_STEPS):
        fit = tried(job, kernel, point, sampled)
        if fit is None:
            return None
        point = moved_least(job.model, kernel, fit, point, held, unseen=HARDLY_SEEN)
    return point


def _left_at(job: Job, fit: Fit, point: FloatArray) -> float:
    """Return what rows about a point leave there, not where they end."""
    return left_by(fit, point[columns_of(fit, job.model)])


def _same_springs(kernel: DeflectedKernel, one: Settled, other: Settled) -> bool:
    """Return whether two places have nearly the same springs."""
    columns = [column for row in kernel.giving for column in row.acting(0)]
    return bool(np.all(np.abs(np.log(one.point[columns] / other.point[columns])) < SAME_PLACE))
