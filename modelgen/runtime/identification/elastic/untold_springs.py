"""Springs that rows which bend with them tell too little to state an interval."""

from __future__ import annotations

from collections.abc import Container

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.thresholds import LARGEST_PERCENT
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model

FASTER = "move faster, towards the modes of the arm, or sense the other side of the spring, too"


def untold_springs(
    fit: Fit, model: Model, drift: FloatArray | float = 0.0, refused: Container[str] = ()
) -> dict[str, str]:
    """Return the stiffnesses that place what no sensor sees and have no interval, with the reason.

    Rows tell a compliance: of a stiffness that is known to a fifth, one side of its interval is already half
    again as long as the other, and soon a rigid spring is within it. What its damper does is known
    no better then, nor where a stiffness is `refused` already. `drift`, in SI, shape (c, c), is what moves
    the estimate besides, squared.
    """
    kernel = model.kernel
    if not isinstance(kernel, DeflectedKernel):
        return {}
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit) + drift), 0.0))
    percent = {
        name: 100.0 * std / max(abs(value), float(np.finfo(float).tiny))
        for name, std, value in zip(fit.columns, spread.tolist(), fit.solution.x.tolist(), strict=True)
    }
    names, found = model.base_parameters, dict[str, str]()
    for row in kernel.giving:
        for name in (names[column] for column in row.acting(0)):
            off = percent.get(name, 0.0)
            if off > LARGEST_PERCENT:
                said = f"standard deviation is {off:.3g} % of its value, too much for rows that bend with it"
                found[name] = f"its {said} ({LARGEST_PERCENT:g} % at most): {FASTER}"
            if off > LARGEST_PERCENT or name in refused:
                beside = [names[column] for column in row.acting(1) if names[column] in percent]
                found |= dict.fromkeys(beside, f"is not told where {name} is not: {FASTER}")
    return found
