"""The chain that a fit has found, from everything that it says: refused columns, too.

What has no number of its own may leave modes and responses well known, or makes their intervals as wide as
they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.find_modes import find_modes
from modelgen.runtime.modes.modes import Modes
from modelgen.runtime.modes.uncertain_chain import (
    UncertainChain,
    chain_around,
    uncertain_chain,
)
from modelgen.runtime.numerics.decorrelation import square_root
from modelgen.runtime.parameters.physical_parameters import NO_CHAIN, Covariances, FoundParameters

Again = Callable[[Mapping[str, float]], UncertainChain]


def chain_of_fit(
    model: Model,
    fit: Fit,
    total: FloatArray,
    covariances: Covariances,
    base: FloatArray,
    found: FoundParameters,
    fixed: Mapping[str, float],
) -> tuple[UncertainChain, Again] | None:
    """Return the chain and what gives it near other values; None for arms, and for composites of no chain.

    Parameters
    ----------
    model : Model
    fit : Fit
    total : array, shape (c, c)
        Covariance of the columns of the fit, in SI, drift included.
    covariances : Covariances
        Of the identified base parameters.
    base : array, shape (columns,)
        Base parameters of the model in SI, NaN where not identified.
    found : FoundParameters
        The physical parameters that follow.
    fixed : mapping of str to float
        Columns that were not fitted, as they are at a bound.
    """
    if model.is_arm:
        return None
    if model.composites:
        if found.solution is None:
            return None
        gradients = np.array([found.solution.gradients[name] for name in model.parameters])
        root = found.factor * gradients @ square_root(covariances.total)
        chain = chain_around(model, base, found.solution.values, root)
        return chain, partial(uncertain_chain, model, base, covariances.total)
    lost = dict(zip(fit.columns, fit.solution.undetermined.tolist(), strict=True))
    answered = [name for name in model.base_parameters if not lost.get(name, True)]
    place = [fit.columns.index(name) for name in answered]
    every = np.full(len(model.base_parameters), np.nan)
    rows = [model.base_parameters.index(name) for name in answered]
    every[rows] = fit.solution.x[place]
    covariance = np.zeros((len(every), len(every)))
    covariance[np.ix_(rows, rows)] = total[np.ix_(place, place)]
    for name, value in fixed.items():
        if name in model.base_parameters:
            every[model.base_parameters.index(name)] = value
    kept = np.flatnonzero(np.isfinite(every))
    again = partial(uncertain_chain, model, every, covariance[np.ix_(kept, kept)])
    return again({entry.name: entry.value for entry in found.parameters}), again


def modes_of_fit(model: Model, known: tuple[UncertainChain, Again] | None) -> Modes:
    """Return the modes with their intervals of what `chain_of_fit` gives."""
    if model.is_arm:  # its frequencies change with its posture
        return Modes()
    if known is None:
        return Modes(notes=(f"No modes: {NO_CHAIN}.",))
    try:
        return find_modes(model, *known)
    except (ArithmeticError, np.linalg.LinAlgError) as error:  # the parameters stand without them
        return Modes(notes=(f"No modes: their numbers fail ({error}).",))
