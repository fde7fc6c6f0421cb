"""What a spring changes of the friction that one body is told to have.

Instruments turn and rest where a simulation of the one body does. A spring behind it changes for how long it
sticks, which nothing that is recorded of one body tells.
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.one_body.thresholds import AS_SPRINGS_STICK
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.mechanical_parts import BENDING
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import parameters_of


def sticking_drift(fit: Fit, model: Model) -> FloatArray:
    """Return the mean square by which springs move frictions of a chain as one body, (c, c) in SI; else 0."""
    columns = len(fit.columns)
    if not parameters_of(model, BENDING):
        return np.zeros((columns, columns))
    rubbing = np.isin(fit.columns, parameters_of(model, "viscous", "coulomb"))
    return np.asarray((AS_SPRINGS_STICK**2 - 1.0) * np.diag(rubbing * np.diag(hac_covariance(fit))))
