"""What the estimate of one sensor set says of the physical parameters: numbers, covariances, slopes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.composite_fit import fit_composites
from modelgen.runtime.parameters.physical_parameters import Covariances, all_from_composites
from modelgen.runtime.results.estimate import Estimate

Evaluate = Callable[[Mapping[str, float]], FloatArray]


@dataclass(frozen=True, eq=False)
class SensorSetPart:
    """Values that one estimate gives, each a function of the physical parameters.

    Attributes
    ----------
    names : tuple of str
    values : array, shape (names,)
    covariances : Covariances
        Of them, shape (names, names) each.
    evaluate, slope : callable
        What they are at physical parameters, shape (names,), and their slopes, shape (names, parameters).
    """

    names: tuple[str, ...]
    values: FloatArray
    covariances: Covariances
    evaluate: Evaluate
    slope: Evaluate


def part_of(model: Model, estimate: Estimate) -> SensorSetPart:
    """Return the values that an estimate of a model gives.

    Base parameters are linear in the physical ones. Where they are composites that the fit was made of, more
    of them than there are parameters, the physical parameters themselves stand for them.
    """
    found = estimate.physical
    covariances = estimate.covariances
    if all_from_composites(model) and all(name in found for name in model.parameters):
        solved = fit_composites(model, estimate.base, covariances.noise, found)
        G = np.array([solved.gradients[name] for name in model.parameters])
        every = np.eye(len(model.parameters))
        return SensorSetPart(
            model.parameters,
            np.array([found[name] for name in model.parameters]),
            Covariances(*(G @ matrix @ G.T for matrix in _matrices(covariances))),
            lambda values: np.array([values[name] for name in model.parameters]),
            lambda _: every,
        )
    rows = np.flatnonzero(np.isfinite(estimate.base))
    return SensorSetPart(
        tuple(model.base_parameters[k] for k in rows),
        estimate.base[rows],
        covariances,
        lambda values: model.base_from_physical(values)[rows],
        lambda values: model.base_jacobian(values)[rows],
    )


def stacked(model: Model, parts: Mapping[str, SensorSetPart], nonlinear: bool) -> Model:
    """Return the chain of a model with the numbers of all parts for base parameters, each by its set.

    `nonlinear`: whether some of them are composites.
    """
    every = list(parts.values())
    return replace(
        model,
        composites={"joined": "joined"} if nonlinear else {},
        module=SimpleNamespace(
            base_from_physical=lambda values: np.concatenate([part.evaluate(values) for part in every]),
            base_jacobian=lambda values: np.concatenate([part.slope(values) for part in every]),
            state_space=model.module.state_space,
        ),
        base_parameters=tuple(f"{title}: {name}" for title, part in parts.items() for name in part.names),
    )


def independent(parts: Sequence[SensorSetPart]) -> Covariances:
    """Return the covariances of the numbers of all parts, which come from different records."""
    count = sum(len(part.names) for part in parts)
    total = [np.zeros((count, count)) for _ in range(4)]
    start = 0
    for part in parts:
        place = slice(start, start + len(part.names))
        for whole, own in zip(total, _matrices(part.covariances), strict=True):
            whole[place, place] = own
        start = place.stop
    return Covariances(*total)


def _matrices(found: Covariances) -> tuple[FloatArray, ...]:
    return found.total, found.noise, found.drift, found.printed
