"""Bodies without a sensor that hang on another one alike: with their values exchanged the motion is the same.

Two branches of one tree, say, that only the motor's encoder tells of. What differs is at most the friction
that the spec names on one of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from modelgen.runtime.model.chain_matrices import chain_matrices
from modelgen.runtime.model.model import Model


def exchanges(model: Model) -> tuple[Mapping[str, str], ...]:
    """Return for each pair of such bodies which parameter takes the value of which, by name."""
    matrices = chain_matrices(model)
    seen = {sensor.body for sensor in model.sensors}
    seen |= {body for sensor in model.sensors for body in sensor.deflection or ()}
    seen |= {actuator.body for actuator in model.actuators}
    free = [place for place, body in enumerate(matrices.bodies) if body not in seen]
    found = []
    for one, other in combinations(free, 2):
        order = np.arange(len(matrices.bodies))
        order[[one, other]] = other, one
        names = {matrices.inertias[one]: matrices.inertias[other]}
        names[matrices.inertias[other]] = matrices.inertias[one]
        complete = names.keys() <= set(model.parameters)
        for kind, needed in ((matrices.stiffness, True), (matrices.damping, False)):
            for name, matrix in kind.items():
                if not np.any(matrix[[one, other]]) or name not in model.parameters:
                    continue
                turned = matrix[np.ix_(order, order)]
                for key, value in kind.items():
                    if np.allclose(value, turned, rtol=1e-9, atol=0.0):
                        names[name] = key
                complete &= name in names or not needed
        if complete:
            found.append(names)
    return tuple(found)
