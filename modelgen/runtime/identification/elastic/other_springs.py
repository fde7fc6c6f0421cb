"""Other springs that explain the rows as well: each spring held elsewhere, all else fitted anew.

Deviations of an estimate are those of rows that are straight lines. Slow motion hardly deflects springs: a
record tells a compliance, of which zero may be within the noise, and rows may have a second place of rest far
from the right one. So the profile of the likelihood along each stiffness is looked at in few places.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.elastic.settling import Settled, settled_with
from modelgen.runtime.identification.elastic.steps_about import columns_of, fit_about, left_by
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import (
    AS_LIKELY,
    EXCLUDED,
    FURTHEST,
    LITTLE_KNOWN,
    MULTIPLES,
    STEPS_ELSEWHERE,
)
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.deflected_kernel import DeflectedKernel


def other_springs(
    job: Job, kernel: DeflectedKernel, point: FloatArray
) -> tuple[FloatArray | None, tuple[FloatArray, ...]]:
    """Return a place that is clearly more likely than a point, or None; and by what the point is uncertain.

    Points are base parameters, shape (columns,), in SI.

    Returns
    -------
    better : array, shape (columns,), or None
    beyond : tuple of array, shape (columns,)
        In SI; of a spring whose profile is flatter than its deviation, the change to the place that says so
        most, divided by how many deviations the likelihood makes of it.
    """
    fit = fit_about(job, kernel, point)
    columns = columns_of(fit, job.model)
    left = left_by(fit, point[columns])
    deviations = dict(zip(columns, np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0)), strict=True))
    beyond = []
    for spring in sorted({column for row in kernel.giving for column in row.acting(0)}):
        deviation, widest = deviations.get(spring, 0.0), (1.0, np.zeros(0))
        if deviation < LITTLE_KNOWN * point[spring]:
            continue
        for place in _elsewhere(job, kernel, point, spring, left + 0.5 * EXCLUDED**2 / fit.count):
            lost = fit.count * (place.left - left)
            if lost < -AS_LIKELY:
                return place.point, ()
            by_likelihood = max(np.sqrt(2.0 * max(lost, 0.0)), 1.0)
            change = place.point - point
            flatter = abs(change[spring]) / deviation / by_likelihood
            if flatter > widest[0]:
                widest = (flatter, change / by_likelihood)
        if widest[1].size:
            beyond.append(widest[1])
    return None, tuple(beyond)


def _elsewhere(
    job: Job, kernel: DeflectedKernel, point: FloatArray, spring: int, most: float
) -> Iterator[Settled]:
    """Yield places with a spring softer and softer, and stiffer and stiffer, that leave no more than `most`.

    Its damper goes with it: so lags stay, within which the steps are.
    """
    of_joint = {spring, *(c for row in kernel.giving if spring in row.acting(0) for c in row.acting(1))}
    for factor in MULTIPLES:
        place: Settled | None = Settled(point, 0.0)
        while place is not None and 1.0 / FURTHEST < place.point[spring] / point[spring] < FURTHEST:
            start = place.point.copy()
            start[[*of_joint]] *= factor
            place = settled_with(job, kernel, start, {spring}, STEPS_ELSEWHERE)
            if place is None or place.left > most:
                break
            yield place
