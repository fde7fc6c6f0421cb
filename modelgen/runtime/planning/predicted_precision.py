"""The precision that a planned experiment promises, of every physical parameter.

That of the default of `identify` is what it states (`default_precision`). Of other methods covariance and
bias of the base parameters follow in closed form (`information`). The step to the physical ones is the
estimator's own: where base parameters are composites it is nonlinear and weighted by the estimate's
covariance, which is taken from a few noisy records, and so is what the estimator would refuse.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import sqrt
from typing import TypeAlias

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.diagnostics.thresholds import LOST_SHARE
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.thresholds import LARGEST_PERCENT, WITHOUT_NUMBER_PERCENT
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import (
    Covariances,
    FoundParameters,
    all_from_composites,
    physical_parameters,
)
from modelgen.runtime.planning.closed_form_information import Information, information
from modelgen.runtime.planning.default_precision import default_estimate, default_precision
from modelgen.runtime.planning.planned_experiment import Experiment
from modelgen.runtime.planning.precision import Precision, Predicted
from modelgen.runtime.planning.thresholds import (
    FACTOR_ERROR,
    FEW_COPIES,
    FIRST_COPIES,
    OPEN_SHARE,
    UNPRUNED,
    WEIGHING,
)
from modelgen.runtime.results.estimate import Estimate

# ... and no correction for that.
AS_IS = (1.0, 0.0)

# Parameters as estimated with each copy's own weights, and with the average ones, shape (copies,) both.
Pairs: TypeAlias = dict[str, tuple[FloatArray, FloatArray]]
# All physical parameters (SI) that are known to fit an estimate's composites, by its identity.
Fitted: TypeAlias = dict[int, Mapping[str, float]]


def predict(planned: Experiment) -> Predicted:
    """Return what the experiment promises.

    Raises
    ------
    IdentifiabilityError
        When the experiment does not determine all base parameters.
    """
    if planned.method == "auto":
        return default_precision(planned)
    noise = {key: instrument.std for key, instrument in planned.instruments.items()}
    found = information(
        planned.model,
        planned.parameters,
        planned.records(None),
        noise,
        planned.choice,
        planned.weights,
        instruments=planned.method == "iv",
    )
    estimates, fitted = _first_copies(planned), Fitted()
    pairs = _own_and_averaged(planned.model, estimates, fitted)
    if len(estimates) >= FIRST_COPIES:
        estimates, pairs = _copied(planned, estimates, pairs, fitted)
    return _physical(planned, found, estimates, pairs)


def _first_copies(planned: Experiment) -> list[Estimate]:
    """Return the estimates from the noisy copies that every experiment takes."""
    if not all_from_composites(planned.model):
        return [estimate_once(planned, 0)]
    estimates = [estimate_once(planned, seed) for seed in range(FEW_COPIES)]
    if len(_open(planned.model, estimates)) > OPEN_SHARE * len(planned.model.parameters):
        # such an experiment is not to be chosen, however well the weights of what is left are known
        return estimates
    return estimates + [estimate_once(planned, seed) for seed in range(FEW_COPIES, FIRST_COPIES)]


def _copied(
    planned: Experiment, estimates: list[Estimate], pairs: Pairs, fitted: Fitted
) -> tuple[list[Estimate], Pairs]:
    """Return the estimates from as many noisy copies as it takes, and each parameter as in `pairs`."""
    copies = FIRST_COPIES
    while copies < WEIGHING and _factor_error(pairs, len(estimates)) > FACTOR_ERROR:
        for seed in range(copies, 2 * copies):
            # a copy without an estimate gives no weights
            with suppress(IdentifiabilityError):
                estimates.append(estimate_once(planned, seed))
        copies *= 2
        pairs = _own_and_averaged(planned.model, estimates, fitted)
    return estimates, pairs


def _open(model: Model, estimates: Sequence[Estimate]) -> list[str]:
    """Return the physical parameters that half of the estimates give no number, or more of them."""
    given = {name: sum(name in one.physical for one in estimates) for name in model.parameters}
    return [name for name, count in given.items() if 2 * count <= len(estimates)]


def estimate_once(planned: Experiment, seed: int) -> Estimate:
    """Return the estimate from one noisy copy of the experiment, with the planned filter but by default."""
    if planned.method == "auto":
        return default_estimate(planned, seed)
    choice, model = planned.choice, planned.model
    # drift moves no value, but decides which parameters follow from composites; other checks only advise
    composites = all_from_composites(model)
    checks = CheckOptions(tests=composites, prune_percent=UNPRUNED, other_solutions=False)
    return identify(
        model,
        planned.records(seed),
        METHODS[planned.method](delays="none"),
        Filters(choice.cutoff_hz, choice.filter_order, choice.decimation[0], choice.direction_cutoff_hz),
        checks,
    )


def _physical(
    planned: Experiment, found: Information, estimates: Sequence[Estimate], pairs: Pairs
) -> Predicted:
    """Take the estimator's step from base to physical parameters, weighted as estimates are on average."""
    model = planned.model
    true = {**model.known, **planned.parameters}
    first = estimates[0]
    weight = _average_weight(estimates)
    given = np.isfinite(first.base)
    expected = found.values + found.bias
    spread = found.covariance[np.ix_(given, given)]
    # weighted by what estimates take for noise; the deviations to be carried on are the predicted ones
    covariances = Covariances(spread, weight, spread, spread)
    nuisance = dict(zip(found.columns, expected.tolist(), strict=True))
    base = np.where(given, expected, np.nan)
    solved = physical_parameters(model, base, covariances, first.not_identifiable, nuisance).parameters
    refused = {
        name: next((e.not_identifiable[name] for e in estimates if name in e.not_identifiable), "is refused")
        for name in _open(model, estimates)
    }
    own = {name: _effect(*both) for name, both in pairs.items()}
    precisions = tuple(
        Precision(
            entry.name, true[entry.name], *_percent(entry, true[entry.name], own.get(entry.name, AS_IS))
        )
        for entry in solved
        if entry.name not in refused
    )
    drowned = _drowned(model, precisions)
    left = tuple(one for one in precisions if one.name not in drowned)
    return Predicted(found.condition_number, left, {**refused, **drowned}, found)


def _drowned(model: Model, precisions: Sequence[Precision]) -> dict[str, str]:
    """Return the parameters that noise leaves no number for, by the limits of an estimate, with the reason.

    Beyond these the linear theory of the prediction ends, too.
    """
    largest = LARGEST_PERCENT if model.composites else WITHOUT_NUMBER_PERCENT
    reasons = {}
    for one in precisions:
        if not one.std <= largest:
            reasons[one.name] = (
                f"not to be had at this noise: its predicted deviation is {one.std:.2g} % of its value, "
                f"above {largest:g} %"
            )
        elif abs(one.bias) > 100.0 * LOST_SHARE:
            reasons[one.name] = (
                f"not to be had at this noise: its predicted bias by noise is {one.bias:.2g} % of its value, "
                f"above {100.0 * LOST_SHARE:g} %; method iv has none"
            )
    return reasons


def _alike(estimates: Sequence[Estimate]) -> list[Estimate]:
    """Return the estimates that hold the same base parameters as the first."""
    return [one for one in estimates if len(one.params) == len(estimates[0].params)]


def _average_weight(estimates: Sequence[Estimate]) -> FloatArray:
    """Return the covariance that composites are weighted with on average."""
    alike = _alike(estimates)
    return np.asarray(np.mean([one.cov_params("noise") for one in alike], axis=0))


def _own_and_averaged(model: Model, estimates: Sequence[Estimate], fitted: Fitted) -> Pairs:
    """Return every parameter as estimated, by each one's own weights, and by the average ones instead.

    An estimate is weighted by its own noise, which is correlated with its error. What that changes follows
    from the same estimates with average weights: the two are nearly equal. `fitted` holds solutions with
    other weights, and takes these.
    """
    alike = _alike(estimates)
    if len(alike) < 2:
        return {}
    weight = _average_weight(estimates)
    average = Covariances(weight, weight, weight, weight)
    pairs: dict[str, list[tuple[float, float]]] = {}
    for one in alike:
        known = fitted.get(id(one)) or _own_solution(model, one)
        again = _physical_again(model, one, average, known)
        if again.solution is not None:
            fitted[id(one)] = again.solution.values
        for entry in again.parameters:
            if entry.name in one.physical:
                pairs.setdefault(entry.name, []).append((one.physical[entry.name], entry.value))
    return {name: (np.array(values)[:, 0], np.array(values)[:, 1]) for name, values in pairs.items()}


def _own_solution(model: Model, one: Estimate) -> Mapping[str, float] | None:
    """Return all physical parameters (SI) that an estimate's own weights lead to, if any."""
    if {*model.parameters} <= {*one.physical}:
        return one.physical
    total, noise = one.cov_params(), one.cov_params("noise")
    found = _physical_again(model, one, Covariances(total, noise, total - noise, noise))
    return None if found.solution is None else found.solution.values


def _physical_again(
    model: Model, one: Estimate, weights: Covariances, known: Mapping[str, float] | None = None
) -> FoundParameters:
    """Return the physical parameters of an estimate with other weights."""
    found = one.parameters
    return physical_parameters(
        model, found.base, weights, found.not_identifiable, found.nuisance, known=known
    )


def _effect(own: FloatArray, averaged: FloatArray) -> tuple[float, float]:
    """Return what own weights do to a parameter: the factor of its deviation, and its shift."""
    if own.size < 2 or averaged.std() == 0.0:
        return AS_IS
    return float(own.std() / averaged.std()), float((own - averaged).mean())


def _factor_error(pairs: Pairs, count: int) -> float:
    """Return the largest relative standard error of such a factor, of parameters that most estimates give.

    The ratio of deviations of n pairs that correlate by r is known to sqrt((1 - r^2) / n).
    """
    errors = [0.0]
    for own, averaged in pairs.values():
        if 2 * own.size > count and min(own.std(), averaged.std()) > 0.0:
            r = float(np.corrcoef(own, averaged)[0, 1])
            errors.append(sqrt(max(0.0, 1.0 - r * r) / own.size))
    return max(errors)


def _percent(entry: Parameter, true: float, own: tuple[float, float]) -> tuple[float, float]:
    """Return standard deviation and bias in % of the true magnitude."""
    size = abs(true) or np.nan
    share, shift = own
    return 100.0 * share * entry.printed_std / size, 100.0 * (entry.value + shift - true) / size
