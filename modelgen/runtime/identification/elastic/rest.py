"""Rest: where steps of rows that hold given positions came to rest, and what that leaves uncertain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.elastic.steps_about import columns_of, held_values, weighted
from modelgen.runtime.identification.thresholds import DISAGREEMENT
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
    `held` over every sample in the records that it is of.
    """

    point: FloatArray
    along: FloatArray
    ratio: float
    beyond: tuple[FloatArray, ...] = ()
    late: tuple[tuple[str, float, float], ...] = ()
    held: tuple[str, ...] = ()

    def drift(self, fit: Fit, model: Model) -> FloatArray:
        """Return what noise moves the estimate by through the point, as a mean square in SI, (c, c).

        A fit holds the point as it is. As that moves with the estimate by `ratio` along the direction, what
        noise moves a step by is 1 / (1 - ratio) times as much when steps have come to rest.
        """
        columns = columns_of(fit, model)
        ratio, along = self.ratio, self.along[columns]
        others = sum((np.outer(one[columns], one[columns]) for one in self.beyond), _still_to_go(fit, model))
        pull = fit.triangle[: len(along), : len(along)].T @ weighted(fit, self.along, model)
        length = float(along @ pull)
        if not ratio or not length:
            return others
        share = float(pull @ hac_covariance(fit) @ pull) / length**2
        return others + ((1.0 - ratio) ** -2 - 1.0) * share * np.outer(along, along)


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
