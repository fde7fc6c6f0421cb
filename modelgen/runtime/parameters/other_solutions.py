"""Composites are nonlinear in the physical parameters: other values of these may fit them just as well."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.composite_descent import CompositeDescent
from modelgen.runtime.parameters.composite_fit import fit_composites
from modelgen.runtime.parameters.nearest_parameters import alike
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import (
    Covariances,
    FoundParameters,
    all_from_composites,
)
from modelgen.runtime.parameters.thresholds import AS_GOOD, SPREAD, STARTS

SEED = 2002


def other_solutions(
    model: Model, base: FloatArray, covariances: Covariances, physical: Sequence[Parameter]
) -> tuple[Mapping[str, float], ...]:
    """Search from seeded random starts; return the solutions that differ from the one reported.

    Parameters
    ----------
    model : Model
    base : array, shape (columns,)
        Base parameters in SI, NaN where not identified (then nothing is searched).
    covariances : Covariances
    physical : sequence of Parameter
        The solution reported.

    Returns
    -------
    tuple of mappings
        Inertias, stiffnesses and the like positive, misfit as good as the reported one's.
    """
    if not all_from_composites(model) or not np.all(np.isfinite(base)):
        return ()
    reported = {entry.name: entry.value for entry in physical}
    if list(reported) != list(model.parameters):
        return ()
    limit = fit_composites(model, base, covariances.noise, reported).misfit + AS_GOOD
    rng, descent = np.random.default_rng(SEED), CompositeDescent(model, base)
    found: list[Mapping[str, float]] = []
    for _ in range(STARTS):
        start, _ = descent.nearest(_near(reported, rng))
        solved = fit_composites(model, base, covariances.noise, start)
        values = {name: solved.values[name] for name in reported}
        new = not any(alike(values, other) for other in [reported, *found])
        if new and solved.misfit <= limit and _possible(model, values):
            found.append(values)
    return tuple(found)


def holding(found: FoundParameters, others: Sequence[Mapping[str, float]], percent: float) -> FoundParameters:
    """Return physical parameters whose intervals hold other values that fit as well.

    Those that differ by more than so many percent of the value get a reason in the place of an interval.
    """
    if not others:
        return found
    kept, apart = [], {}
    for entry in found.parameters:
        values = [other[entry.name] for other in others]
        move = float(np.hypot.reduce([value - entry.value for value in values]))
        if move > 0.01 * percent * abs(entry.value):
            which = " or ".join(f"{value:.6g}" for value in (entry.value, *values))
            apart[entry.name] = f"may be {which}: no sensor tells apart what these values belong to"
        else:
            std, drift = (float(np.hypot(one, move)) for one in (entry.std, entry.drift_std))
            kept.append(replace(entry, std=std, drift_std=drift))
    return replace(found, parameters=tuple(kept), unanswered={**found.unanswered, **apart})


def solution_notes(others: Sequence[Mapping[str, float]]) -> tuple[str, ...]:
    """Return one sentence per further solution."""
    return tuple(
        "other values fit as well: " + ", ".join(f"{name} {value:.6g}" for name, value in values.items())
        for values in others
    )


def _near(values: Mapping[str, float], rng: np.random.Generator) -> FloatArray:
    """Return a start in the logarithms of `CompositeDescent`, around the values reported."""
    magnitude = np.log(np.maximum(np.abs(np.array(list(values.values()))), 1e-30))
    return np.asarray(magnitude + rng.normal(0.0, SPREAD, len(values)))


def _possible(model: Model, values: Mapping[str, float]) -> bool:
    return all(value > 0.0 or model.roles[name].role == "offset" for name, value in values.items())
