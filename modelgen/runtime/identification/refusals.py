"""Which columns of a fit get no number, with the reason: before other settings were tried, and after."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError, Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.motion_checks import (
    friction_and_offset,
    one_way_columns,
    one_way_friction,
    resting_bodies,
)
from modelgen.runtime.diagnostics.noise_bias import lost_in_noise
from modelgen.runtime.diagnostics.parameter_checks import null_columns
from modelgen.runtime.diagnostics.row_noise import drowned_friction
from modelgen.runtime.diagnostics.unforced_rows import zero_columns
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.elastic.untold_springs import untold_springs
from modelgen.runtime.identification.thresholds import WITHOUT_NUMBER_PERCENT
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.dependence import dependences
from modelgen.runtime.parameters.grouped_reasons import grouped_reasons, reasons_of_parameters
from modelgen.runtime.parameters.parameter import may_be_zero
from modelgen.runtime.parameters.thresholds import HIGHEST_INDEX, LARGEST_INDEX
from modelgen.runtime.parameters.unanswered_columns import (
    columns_that_vanish,
    friction_without_steady_motion,
    not_identifiable,
)
from modelgen.runtime.records.record import Record, missing_name


def refusals(
    model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit, keep: Sequence[str]
) -> tuple[dict[str, str], tuple[Advice, ...]]:
    """Return the columns that get no number, with the reason, and advice on those kept in spite of one.

    `keep` overrules what is a judgement (friction without steady motion, encoder zeros, near dependence);
    nothing overrules a column that is zero or exactly dependent.

    Raises
    ------
    DataError
        For a name to keep that is no base parameter.
    """
    unknown = [name for name in keep if name not in model.base_parameters]
    if unknown:
        raise DataError(*(missing_name("keep", "parameter", name, model.base_parameters) for name in unknown))
    reasons = unanswered(model, records, choice, fit) | one_way_columns(model, fit.absent)
    reasons |= (
        dependent_columns(fit, reasons, model=model)
        | zero_columns(fit, model, recorded=(records, choice))
        | resting_bodies(model, records)
    )
    if fit.projected:  # noise, which biases least squares, may be what such a row leaves there
        reasons |= null_columns(fit, model, records, choice)
    reasons |= friction_and_offset(model, one_way_friction(model, fit), fit.columns)
    lost = {*fit.absent, *_undetermined(fit)}
    insisted = [name for name in keep if name in reasons and name not in lost]
    advice = tuple(
        Advice("kept on request", name, f"has a number although {reasons[name]}", "do not rely on it")
        for name in insisted
    )
    refused = {name: reasons[name] for name in model.base_parameters if name in reasons}
    return {name: reason for name, reason in refused.items() if name not in insisted}, advice


def unanswered(model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit) -> dict[str, str]:
    """Return the columns that the records cannot answer, with the reason; in the order of the columns."""
    reasons = columns_that_vanish(model, friction_without_steady_motion(model, records, choice))
    if reasons:
        reasons = drowned_friction(model, records, choice, fit, reasons)
    reasons |= not_identifiable(model, records, choice, fit)
    return {name: reasons[name] for name in model.base_parameters if name in reasons}


def late_refusals(
    fit: Fit,
    refused: Mapping[str, str],
    drift: FloatArray,
    keep: Sequence[str],
    bias: tuple[FloatArray, FloatArray] | None = None,
    model: Model | None = None,
) -> dict[str, str]:
    """Return what is refused once drift and bias are known: not all that is left of a chain, though.

    A link of an arm whose spring is lost moves with its motor, which takes over its inertia with a small
    interval; of a chain trapezoids tell friction all the same, and its interval holds what is not known.
    `drift` is the mean square by which settings move the estimate, shape (c, c), `bias` the bias by
    noise and what of it is left in the estimate, shape (c,) each; all in the order of the columns of the fit
    and in their units.

    Raises
    ------
    IdentifiabilityError
        When noise leaves nothing of an arm.
    """
    lost = lost_in_noise(fit, *bias) if bias is not None else {}
    arm = model if model is not None and model.is_arm else None
    if arm is not None:
        lost = untold_springs(fit, arm, drift, refused) | zero_columns(fit, arm, drift, lost) | lost
    told = {name: why for name, why in lost.items() if name not in refused and name not in keep}
    lost = {**refused, **told}
    if arm is not None and told and all(name in lost for name in fit.columns):
        raise all_refused(lost, arm)
    found = dependent_columns(fit, lost, drift, model)
    late = {name: reason for name, reason in found.items() if name not in lost and name not in keep}
    left = [name for name in fit.columns if name not in lost and name not in late]
    if left:
        return {**lost, **late}
    return dict(refused) if arm is None else lost


def all_refused(refused: Mapping[str, str], model: Model) -> IdentifiabilityError:
    """Return the error that says that no parameter gets a number, with every reason."""
    return IdentifiabilityError(*refused_problems(refused, model))


def refused_problems(refused: Mapping[str, str], model: Model) -> tuple[Problem, ...]:
    """Return a problem for every reason for which base parameters are refused, by the spec's parameters."""
    told = [name for name in model.parameters if name not in model.absent]
    reasons = dict(refused)
    if not model.is_arm:
        reasons = reasons_of_parameters(refused, model.composites, told)
    remedy = "record another motion, or sense more"
    return tuple(Problem(one.who, one.why, remedy) for one in grouped_reasons(reasons))


def dependent_columns(
    fit: Fit,
    otherwise: Container[str] = (),
    drift: FloatArray | float = 0.0,
    model: Model | None = None,
) -> dict[str, str]:
    """Return the columns without a number because they move with others, exactly or nearly.

    Near dependence counts where it leaves a parameter with a standard deviation above its value, `drift`
    (SI, (c, c)) included; columns that are refused `otherwise` are no news then. What may well be zero
    keeps its number: of offsets that are zero only those that chance has put far from it would be left.
    `model` says which parameters composites are made of.
    """
    lost = _undetermined(fit)
    if not lost and fit.solution.condition_number < LARGEST_INDEX:
        return {}
    covariance = hac_covariance(fit) + drift
    roles = model.roles if model else {}
    zeros = {name for name, role in roles.items() if may_be_zero(name, role.role)}
    found: dict[str, str] = {}
    # what rounding leaves of an index may be below that of equal columns: the closest group counts
    for least in (HIGHEST_INDEX, LARGEST_INDEX) if lost else ():
        for group in dependences(fit, covariance, least):
            why = group.inseparable("W is short of rank", model)
            found = dict.fromkeys((name for name in group.columns if name in lost), why) | found
    for group in dependences(fit, covariance):
        why = group.inseparable(group.index_said, model)
        for name in group.columns:
            index = fit.columns.index(name)
            spread = 100.0 * float(np.sqrt(max(covariance[index, index], 0.0)))
            uncertain = spread > WITHOUT_NUMBER_PERCENT * abs(float(fit.solution.x[index]))
            uncertain = uncertain and name not in zeros
            if uncertain and name not in otherwise and name not in lost:
                found[name] = why
    return found


def _undetermined(fit: Fit) -> list[str]:
    return [name for name, lost in zip(fit.columns, fit.solution.undetermined, strict=True) if lost]
