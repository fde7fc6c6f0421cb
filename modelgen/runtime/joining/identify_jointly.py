"""Records of different sensors for one chain: an estimate each sensor set, joined to one.

Parameters that several sets see are combined by generalised least squares of what each estimate knows,
weighted by its covariance, drift included (Aitken 1935); sums of parameters that one set sees are solved by
what another one knows. Whether the sets agree is a chi square of what is left; where they do not, it is said
and the intervals are wider by its root per degree of freedom (Birge 1932). What all sets together leave open
is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError, ModelgenError, Problem
from modelgen.progress import step
from modelgen.runtime.identification.assemble_estimate import certain
from modelgen.runtime.identification.identify import identify_whole
from modelgen.runtime.identification.methods import Method
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.joining.joint_estimate import Agreement, Joined, JointEstimate, assembled
from modelgen.runtime.joining.sensor_set_part import independent, part_of, stacked
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.composite_fit import PhysicalSolution, fit_composites
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.records.directions import wanted_directions
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate

Sets = Sequence[tuple[Model, Sequence[Record]]]


def identify_jointly(
    sets: Sets,
    method: str | Method = "auto",
    filters: Filters | None = None,
    checks: CheckOptions | None = None,
) -> JointEstimate:
    """Identify one chain from records of different sensors.

    Parameters
    ----------
    sets : sequence of (Model, sequence of Record)
        Generated modules of one chain, one a sensor set, each with the records of these sensors.
    method, filters, checks
        As for `modelgen.identify`, the same for all sets; directions and records that are named belong to the
        sets that have them.

    Returns
    -------
    JointEstimate
        `estimate` is the answer, `parts` those of the single sets. A set whose records alone answer nothing
        has no part in it, and is named.

    Raises
    ------
    DataError
        When the modules are not of one chain, or an option or a record is wrong.
    IdentifiabilityError
        When no set alone answers anything.

    Examples
    --------
    >>> joint = modelgen.identify_jointly([(low, [run1]), (high, [run2])])  # doctest: +SKIP
    >>> print(joint.estimate)  # doctest: +SKIP
    """
    models = _one_chain([model for model, _ in sets])
    found: dict[str, Estimate] = {}
    failed: dict[str, IdentifiabilityError] = {}
    for title, (model, records) in zip(models, sets, strict=True):
        step(f"identifying from sensors {title}")
        own = _own_options(model, records, filters or Filters(), checks or CheckOptions())
        try:
            found[title] = identify_whole(model, records, method, *own)
        except IdentifiabilityError as error:
            failed[title] = error
        except ModelgenError as error:
            raise type(error)(
                *(Problem(f"sensors {title}: {one.where}", one.what, one.remedy) for one in error.problems)
            ) from error
    if not found:
        raise IdentifiabilityError(
            *(
                Problem(f"sensors {title}: {one.where}", one.what, one.remedy)
                for title, error in failed.items()
                for one in error.problems
            )
        )
    return join({title: models[title] for title in found}, found, failed)


def join(
    models: Mapping[str, Model],
    estimates: Mapping[str, Estimate],
    failed: Mapping[str, IdentifiabilityError] | None = None,
) -> JointEstimate:
    """Join estimates of one chain, each by the title of its sensor set; `failed` sets are named too.

    The estimates must be of different records: their errors count as independent.
    """
    step("joining the sensor sets")
    parts = {title: part_of(models[title], one) for title, one in estimates.items()}
    nonlinear = any(model.composites for model in models.values())
    chain = stacked(next(iter(models.values())), parts, nonlinear)
    covariances = independent(list(parts.values()))
    base = np.concatenate([part.values for part in parts.values()])
    solution = _solved(chain, base, covariances, _start(chain, list(estimates.values())))
    agreement = Agreement.of(solution, covariances.total)
    factor = agreement.factor if agreement is not None else 1.0
    parameters = tuple(
        _parameter(chain, name, solution, covariances, factor)
        for name in chain.parameters
        if name in solution.determined
    )
    parameters, doubtful = certain(parameters, nonlinear)
    joined = Joined(models, parts, estimates, chain, solution, covariances, agreement, parameters, doubtful)
    why = {title: str(error.problems[0].what) for title, error in (failed or {}).items()}
    return JointEstimate(assembled(joined, why), dict(estimates), why, agreement)


def _solved(
    chain: Model, base: FloatArray, covariances: Covariances, start: Mapping[str, float]
) -> PhysicalSolution:
    """Return the fit of the physical parameters to all numbers, scaled by where a first one ended."""
    try:
        first = fit_composites(chain, base, covariances.total, start)
        return fit_composites(chain, base, covariances.total, first.values)
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        what, remedy = "have no parameters in common", "look at each sensor set alone"
        raise IdentifiabilityError.at("the sensor sets", what, remedy) from error


def _start(chain: Model, estimates: Sequence[Estimate]) -> dict[str, float]:
    given = {name: value for values in chain.parameter_sets.values() for name, value in values.items()}
    told = {
        name: value
        for one in estimates
        for values in (one.parameters.nuisance, one.params, one.physical)
        for name, value in values.items()
    }
    return {name: told.get(name) or given.get(name) or 1.0 for name in chain.parameters}


def _parameter(
    chain: Model, name: str, solution: PhysicalSolution, covariances: Covariances, factor: float
) -> Parameter:
    total, noise, drift, printed = covariances.standard_deviations(solution.gradients[name])
    drift = float(np.sqrt(drift**2 + (factor**2 - 1.0) * total**2))
    spreads = (factor * total, noise, drift, printed)
    return Parameter(name, chain.units.get(name, ""), solution.values[name], *spreads)


def _one_chain(models: Sequence[Model]) -> dict[str, Model]:
    """Return the models by the names of their sensor sets.

    Raises
    ------
    DataError
    """
    if not models:
        raise DataError.at("sets", "there are none", "give pairs of a model and its records")
    first, found = models[0], dict[str, Model]()
    for model in models:
        same = (model.chain, model.parameters, dict(model.known)) == (
            first.chain,
            first.parameters,
            dict(first.known),
        )
        if not same:
            what = f"is of another chain than {first.chain}, sensors {first.sensor_set}"
            remedy = "give modules of one spec, with the same values known"
            raise DataError.at(f"{model.chain}, sensors {model.sensor_set}", what, remedy)
        if model.sensor_set in found:
            remedy = "give all records of these sensors with one model"
            raise DataError.at(f"sensors {model.sensor_set}", "are given twice", remedy)
        found[model.sensor_set] = model
    return found


def _own_options(
    model: Model, records: Sequence[Record], filters: Filters, checks: CheckOptions
) -> tuple[Filters, CheckOptions]:
    """Return the options as far as they are of this model and these records."""
    names = [record.name for record in records]
    wanted = wanted_directions(model)
    directions = {key: source for key, source in filters.directions.items() if key in wanted}
    keep = tuple(name for name in checks.keep if name in model.base_parameters)
    held, period = checks.hold_out, checks.period_s
    if held is not None and not isinstance(held, (str, float, int)):
        held = [name for name in held if name in names] or None
    elif isinstance(held, str):
        held = held if held in names else None
    if isinstance(period, Mapping):
        period = {name: value for name, value in period.items() if name in names} or None
    return replace(filters, directions=directions), replace(checks, keep=keep, hold_out=held, period_s=period)
