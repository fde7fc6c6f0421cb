"""Rest: where steps of rows that hold given positions came to rest, and what that leaves uncertain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.identification.elastic.starting_springs import springs_pull
from modelgen.runtime.identification.elastic.steps_about import (
    columns_of,
    fit_about,
    held_values,
    moved,
    size_of,
    springs_hold,
    weighted,
)
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import (
    DISAGREEMENT,
    LARGEST_PERCENT,
    LEAST_COMPLIANCE,
    LIKELY_WITHIN,
    LONGEST_SERIES,
    MOST_STEPS,
    ONE_WAY,
    POINT_TOLERANCE,
    ROUNDING,
    SAME_RATIO,
    WITHIN_NOISE,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model


class Drifting(Protocol):
    """What an estimate rests on, and moves by as that is uncertain."""

    @property
    def late(self) -> tuple[tuple[str, float, float], ...]:
        """Channels that were late, by how many s, and the deviations of that."""

    @property
    def held(self) -> tuple[str, ...]:
        """Commands that drives hold over every sample, which no one had said."""

    def drift(self, fit: Fit, model: Model) -> FloatArray:
        """Return what noise moves the estimate by through it, as a mean square in SI, shape (c, c)."""


@dataclass(frozen=True, eq=False)
class Rest:
    """Where steps came to rest: a point, and by which ratio they shrank along a direction.

    The ratio is 0 where they did not shrink slowly; `point` and `along`, in SI, are (base parameters,), and
    so is each of `beyond`, by what the point is uncertain as springs elsewhere are as likely. Drives hold
    `held` over every sample in the records that it is of. Where not every spring is `told` other cut-offs may
    tell it.
    """

    point: FloatArray
    along: FloatArray
    ratio: float
    beyond: tuple[FloatArray, ...] = ()
    late: tuple[tuple[str, float, float], ...] = ()
    held: tuple[str, ...] = ()
    told: bool = True

    def drift(self, fit: Fit, model: Model) -> FloatArray:
        """Return what noise moves the estimate by through the point, as a mean square in SI, (c, c).

        A fit holds the point as it is. As that moves with the estimate by `ratio` along the direction, what
        noise moves a step by is 1 / (1 - ratio) times as much when steps have come to rest.
        """
        columns = columns_of(fit, model)
        ratio, along = self.ratio, self.along[columns]
        others = _still_to_go(fit, model) + _beside_untold_springs(fit, model)
        others = sum((np.outer(one[columns], one[columns]) for one in self.beyond), others)
        pull = fit.triangle[: len(along), : len(along)].T @ weighted(fit, self.along, model)
        length = float(along @ pull)
        if not ratio or not length:
            return others
        share = float(pull @ hac_covariance(fit) @ pull) / length**2
        return others + ((1.0 - ratio) ** -2 - 1.0) * share * np.outer(along, along)


def rested(job: Job, kernel: DeflectedKernel, point: FloatArray) -> Rest | None:
    """Return where steps from a point, (columns,) in SI, come to rest, None where they do not.

    Nor where a spring pushes, or is more of a damper: the series that says what noise does ends early. Steps
    one way that shrink slowly, by the same ratio twice, are taken as the sum of their series (Aitken, 1927),
    and all that is left to go has come to rest. Other steps within the noise that become no smaller, as
    reversals come and go with the point, are halved.
    """
    share, last, seen, slow = 1.0, np.inf, 0.0, Rest(point, np.zeros(len(point)), 0.0)
    before: tuple[FloatArray, FloatArray] | None = None
    for _ in range(MOST_STEPS):
        try:
            fit = fit_about(job, kernel, point)
        except IdentifiabilityError:
            return None
        change = moved(job.model, kernel, fit, point) - point
        left = abs(float(fit.triangle[-1, -1]))
        rounding = ROUNDING * size_of(fit, point + change, job.model)
        size, series, ratio = size_of(fit, change, job.model), 1.0, 0.0
        if before is not None and share == 1.0:
            along = point - before[0]
            ratio = _slow_ratio(fit, job.model, (along, change, change - before[1]))
            if ratio and abs(ratio - seen) < SAME_RATIO:
                series, slow = min(1.0 / (1.0 - ratio), LONGEST_SERIES), Rest(point, along, ratio)
            seen = ratio if series == 1.0 else 0.0
        if not ratio and 0.5 * last < size < WITHIN_NOISE * left:
            share *= 0.5
        before, last = (point, change), size
        point = point + share * series * change
        if not springs_pull(kernel, point):
            return None
        if share * size / (1.0 - slow.ratio) <= max(POINT_TOLERANCE * left, rounding):
            return replace(slow, point=point) if springs_hold(job, kernel, point) else None
    return None


def _slow_ratio(fit: Fit, model: Model, steps: tuple[FloatArray, FloatArray, FloatArray]) -> float:
    """Return by which ratio steps shrink that go one way slowly, 0 where they do not.

    `steps` are the one taken last, the next, and how much that differs from the full step before.
    """
    along, change, bent = (weighted(fit, one, model) for one in steps)
    length = float(along @ along)
    sizes = float(np.linalg.norm(along) * np.linalg.norm(change))
    if not sizes or abs(float(along @ change)) < ONE_WAY * sizes:
        return 0.0
    ratio = 1.0 + float(along @ bent) / length
    return ratio if 0.5 < ratio < 1.0 else 0.0


def _still_to_go(fit: Fit, model: Model) -> FloatArray:
    """Return what least squares are away from the point that their rows are about, squared, (c, c) in SI.

    Only where noise does not explain it: steps ended there without a rest.
    """
    kernel, columns = model.kernel, columns_of(fit, model)
    if not isinstance(kernel, DeflectedKernel):
        return np.zeros((len(columns),) * 2)
    away = held_values(fit, model, kernel.point) - kernel.point[columns]
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
    return np.outer(away, away) * bool(np.any(np.abs(away) > DISAGREEMENT * spread))


def _beside_untold_springs(fit: Fit, model: Model) -> FloatArray:
    """Return what parameters may be off besides as they follow springs that are not told, (c, c) in SI.

    Rows tell compliances: what goes with a stiffness that is known to a third is as far off on one side of
    its interval as that is, a rotor in front of the spring and the link behind it by 5 deviations.
    """
    kernel, columns = model.kernel, columns_of(fit, model)
    found = np.zeros((len(columns),) * 2)
    if not isinstance(kernel, DeflectedKernel):
        return found
    covariance = hac_covariance(fit)
    for column in {column for row in kernel.giving for column in row.acting(0)}.intersection(columns):
        place = columns.index(column)
        spread = float(np.sqrt(covariance[place, place]))
        share = spread / abs(float(fit.solution.x[place]))
        if share > 0.01 * LARGEST_PERCENT:
            further = 1.0 / max(1.0 - LIKELY_WITHIN * share, LEAST_COMPLIANCE)
            along = covariance[place] / spread
            found += (further**2 - 1.0) * np.outer(along, along)
    return found
