"""identify: model and records -> Estimate; the one page that names every step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from types import ModuleType

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.keyword_options import refuse_other
from modelgen.progress import heard, step
from modelgen.runtime.diagnostics.friction_asymmetry import asymmetry_notes
from modelgen.runtime.identification.assemble_estimate import Solved, judge
from modelgen.runtime.identification.given_positions import about_the_estimate
from modelgen.runtime.identification.methods import Method
from modelgen.runtime.identification.one_body.found_as_one_body import found_as_one_body
from modelgen.runtime.identification.one_body.sticking import sticking_drift
from modelgen.runtime.identification.options import (
    CheckOptions,
    Filters,
    chosen_method,
    with_short_forms,
)
from modelgen.runtime.identification.run_checks import checked, compared, more_than_noise, refused_late
from modelgen.runtime.identification.solution import fitted, settings_drift
from modelgen.runtime.identification.task import Task, prepared
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Channels
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.arms.arm_coordinates import follows


def identify(
    model: Model | ModuleType,
    records: Record | Channels | Sequence[Record | Channels],
    method: str | Method = "auto",
    filters: Filters | None = None,
    checks: CheckOptions | None = None,
    cutoff_hz: float | None = None,
    decimation: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Estimate:
    """Identify the parameters of a model from measured records.

    Parameters
    ----------
    model : Model or module
        See `modelgen.load_model`; a generated module that was imported does as well.
    records : Record, Channels, or sequence of them
        With the channels of the model's sensors and actuators, in SI; in memory, or read in stretches from
        files of any length (`modelgen.runtime.files`).
    method : str or Method
        `Auto`, `WLS`, `IV`, `TLS` or `Pham2002` with their options, or the name of one: "auto", "wls", "iv",
        "tls", "pham2002".
    filters : Filters, optional
        What is not given is chosen from the records.
    checks : CheckOptions, optional
        What is checked and compared besides the fit.
    cutoff_hz, decimation : optional
        Short forms of those in `filters`; the cut-off in Hz.
    progress : callable, optional
        Called with a few words before each step.

    Returns
    -------
    Estimate

    Raises
    ------
    DataError
        When an option is out of range, a channel is missing, or a record is too short.
    IdentifiabilityError
        When the records answer none of the parameters.
    """
    chosen, filtering = chosen_method(method), with_short_forms(filters, cutoff_hz, decimation)
    refuse_other("checks", checks, CheckOptions)
    if progress is None:
        return _identified(model, records, chosen, filtering, checks or CheckOptions())
    with heard(progress):
        return _identified(model, records, chosen, filtering, checks or CheckOptions())


def identify_whole(
    model: Model,
    records: Sequence[Record],
    method: str | Method = "auto",
    filters: Filters | None = None,
    checks: CheckOptions | None = None,
) -> Estimate:
    """Return the estimate of a model itself, for those who go on with its base parameters; see `identify`.

    What `identify` tells of a chain as one body has others.
    """
    return _estimated(
        prepared(model, records, chosen_method(method), filters or Filters(), checks or CheckOptions())
    )


def _identified(
    model: Model | ModuleType,
    records: Record | Channels | Sequence[Record | Channels],
    method: Method,
    filters: Filters,
    checks: CheckOptions,
) -> Estimate:
    """Return the estimate, that of the chain as one body where its records show no spring."""
    task = prepared(model, records, method, filters, checks)

    def of_body(body: Model, its_filters: Filters) -> Estimate:
        return _estimated(prepared(body, records, method, its_filters, checks))

    try:
        found = _estimated(task)
    except (DataError, IdentifiabilityError):
        instead = found_as_one_body(task, None, of_body)
        if instead is None:
            raise
        return instead
    return found_as_one_body(task, found, of_body) or found


def _estimated(task: Task) -> Estimate:
    """Return the estimate of a task: every step of an identification by its name."""
    task, rest = about_the_estimate(task)
    if task.model.is_arm:  # others need not load it
        from modelgen.runtime.identification.explanation.wider_directions import with_turns_between_samples

        task = with_turns_between_samples(task)
        if not follows(task.model):
            from modelgen.runtime.identification.elastic.aligned_channels import with_aligned_channels

            task, rest = with_aligned_channels(task, rest)
    task, solution = fitted(task)
    chosen, again, fit, drift = task.method, partial(solution.at, task), solution.fit, solution.drift
    if rest is not None:
        drift, fit = drift + rest.drift(fit, task.model), replace(fit, delays=(*fit.delays, *rest.late))
    others = compared(task, solution, again)
    if task.checks.drift_check and chosen.matched:
        step("changing cut-off and weights")
        moved, notes = settings_drift(task, solution, again)
        drift = drift + moved
        fit = replace(fit, notes=fit.notes + notes)
    drift = drift + sticking_drift(fit, task.model)
    extras = others()
    drift = drift + more_than_noise(fit, extras)
    refused = refused_late(task, solution, fit, drift, extras)
    step("judging the fit")
    fit = replace(fit, notes=fit.notes + asymmetry_notes(extras.asymmetric, task.model, refused))
    keep, no_number = tuple(task.checks.keep), {**refused, **solution.at_bounds}
    fixed = dict.fromkeys(solution.at_bounds, 0.0)
    solved = Solved(solution.job, chosen, solution.observation, fit, no_number, drift, fixed, keep)
    estimate = judge(solved, chosen.residual_dof, task.checks)
    estimate = replace(estimate, contents=task.contents)
    for record in (*task.records, *task.unseen):
        record.facts.forget_filtered()
    return replace(estimate, checks=checked(estimate, task, solution, drift, refused, extras))
