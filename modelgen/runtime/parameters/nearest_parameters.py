"""Physical parameters that come close to base parameters which noise has made contradict each other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.composite_descent import CompositeDescent
from modelgen.runtime.parameters.thresholds import (
    DIFFERENT,
    EXACT,
    NEAREST,
    NEAREST_SPREADS,
    NEAREST_STARTS,
    SAME_MISFIT,
)

SEED = 2002


def nearest_parameters(model: Model, base: FloatArray) -> tuple[Mapping[str, float], ...]:
    """Return sets of all physical parameters (SI) to start a weighted fit from, nearest first.

    `base` holds all base parameters, shape (columns,), of a model with composites. The sets are local
    optima of the relative errors, found from seeded starts until the nearest of them was found twice; there
    may be none.
    """
    rng = np.random.default_rng(SEED)
    descent = CompositeDescent(model, base)
    found: list[tuple[float, Mapping[str, float]]] = []
    for attempt in range(NEAREST_STARTS):
        # not from one value for all: that may be where a denominator is zero
        spread = NEAREST_SPREADS[min(attempt, 1)]
        values, misfit = descent.nearest(rng.normal(0.0, spread, len(model.parameters)))
        if not np.isfinite([misfit, *values.values()]).all():
            continue
        least = min((one[0] for one in found), default=np.inf)
        if not any(alike(values, other) for _, other in found):
            found.append((misfit, values))
        if misfit < EXACT or abs(misfit - least) < SAME_MISFIT * least:
            break
    nearest = sorted(found, key=lambda one: one[0])[:NEAREST]
    return tuple(values for _, values in nearest)


def alike(values: Mapping[str, float], other: Mapping[str, float]) -> bool:
    """Return whether two sets of parameters are the same solution."""
    return all(abs(value - other[name]) <= DIFFERENT * abs(other[name]) for name, value in values.items())
