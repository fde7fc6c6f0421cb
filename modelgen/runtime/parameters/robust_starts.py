"""Physical parameters that come close to most composites, whatever becomes of a few that noise has bent.

Least squares of relative errors give way in all parameters to explain one composite that is many times too
large; a fit to that start may then end at bodies of no size, or of any. With Cauchy's loss, which grows as
the logarithm of an error, such a composite counts hardly at all.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.composite_descent import CompositeDescent
from modelgen.runtime.parameters.nearest_parameters import alike
from modelgen.runtime.parameters.thresholds import (
    LEAST_SHARE,
    NEAREST_STARTS,
    OPTIMISM,
    ROBUST_SHARE,
    SPREAD,
)

SEED = 2002


def robust_starts(model: Model, base: FloatArray, std: FloatArray) -> tuple[Mapping[str, float], ...]:
    """Return sets of all physical parameters (SI) to start a weighted fit from.

    Parameters
    ----------
    model : Model
        With composites.
    base, std : array, shape (columns,)
        All its base parameters, and their standard deviations, zero where there is none.
    """
    rng = np.random.default_rng(SEED)
    # one is bent and the others are good, or all are as good as they say, but for a factor
    relative = std / np.where(base == 0.0, 1.0, np.abs(base))
    shares = (np.full(base.shape, ROBUST_SHARE), np.maximum(LEAST_SHARE, OPTIMISM * relative))
    descent, found = CompositeDescent(model, base), list[dict[str, float]]()
    # a trial far off may leave the range of numbers: its loss is not finite, and the step is shortened
    with np.errstate(all="ignore"):
        for share in shares:
            for _ in range(NEAREST_STARTS):
                start = rng.normal(0.0, SPREAD, len(model.parameters))
                one = descent.values(descent.descended(share, start))
                finite = np.isfinite([*one.values()]).all()
                if finite and not any(alike(one, other) for other in found):
                    found.append(one)
    return tuple(found)
