"""identify: model and records -> Estimate; the one page that names every step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from numbers import Integral
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from modelgen.errors import DataError, Problem
from modelgen.magnitudes import REMEDY, SMALLEST
from modelgen.runtime.diagnostics.cutoff_agreement import (
    all_disagreements,
    coordinates_of,
    disagreement_notes,
    significant_drift,
)
from modelgen.runtime.diagnostics.friction_asymmetry import asymmetries, asymmetry_notes
from modelgen.runtime.diagnostics.hold_out import split
from modelgen.runtime.diagnostics.periods import periods_of
from modelgen.runtime.diagnostics.settings_drift import cutoff_drift, direction_drift, load_row_drift
from modelgen.runtime.diagnostics.suspicious_samples import suspicions, told_on_failure
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.identification.assemble_estimate import Solved, judge
from modelgen.runtime.identification.methods import METHODS, Job
from modelgen.runtime.identification.robust_and_bounded import check_treatment, treat, unweighted
from modelgen.runtime.identification.run_checks import (
    Extras,
    all_refused,
    bias_of,
    examine,
    judge_held_out,
    late_refusals,
    more_than_noise,
    periods_found,
    refusals,
    scanned,
)
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.known_delays import aligned
from modelgen.runtime.least_squares.wls import Fit
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.parameters.bounds import bound_reasons
from modelgen.runtime.records.channels import Channels
from modelgen.runtime.records.directions import direction_problems, wanted_directions, with_directions
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.records.same_data import refuse_same_data
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.rows_by_tag import PAPER, rows_for_tags

if TYPE_CHECKING:
    from modelgen.runtime.iv.companion_simulation import Loop

Progress = Callable[[str], None]

RESIDUAL_DOFS = ("r-c", "r-1")


def identify(
    model: Model | ModuleType,
    records: Record | Channels | Sequence[Record | Channels],
    method: str = "wls",
    cutoff_hz: float | None = None,
    filter_order: int | None = None,
    decimation: int | None = None,
    direction_cutoff_hz: float | None = None,
    drop: int | None = None,
    prune_percent: float = 10.0,
    residual_dof: str = "r-c",
    drift_check: bool = True,
    rows_for_tag: Mapping[str, Sequence[str]] | str | None = None,
    directions: Mapping[str, str] | None = None,
    delays: Mapping[str, float] | str | None = None,
    held: Sequence[str] = (),
    loop: Loop | None = None,
    period_s: float | Mapping[str, float] | str | None = None,
    keep: Sequence[str] = (),
    hold_out: Sequence[str] | str | float | None = None,
    scan_cutoffs: Sequence[float] | str | None = None,
    robust: str | None = None,
    bounds: str | None = None,
    progress: Progress | None = None,
) -> Estimate:
    """Identify the parameters of a model from measured records.

    Parameters
    ----------
    model : Model or module
        See `modelgen.load_model`; a generated module that was imported does as well.
    records : Record, Channels, or sequence of them
        With the channels of the model's sensors and actuators, in SI; in memory, or read in stretches from
        files of any length (`modelgen.runtime.files`).
    method : str
        "wls": every signal through the same zero-phase filter, weighted least squares. "iv": instrumental
        variables on the same rows, free of the bias that noise of the sensors gives least squares, with the
        delays of forces estimated. "pham2002": the paper to the letter, for comparison; biased where its
        filter reaches into the dynamics. "tls": total least squares on the rows of "wls", for comparison too.
    cutoff_hz, filter_order, decimation, direction_cutoff_hz : optional
        Taken as given; otherwise chosen from the records, see `modelgen.runtime.filter_choice`.
        Frequencies in Hz.
    drop : int, optional
        Samples left out at the beginning of every record; with "wls" at least the filter's reach.
    prune_percent : float
        Relative standard deviation in % from which parameters are removed in the list beside the estimate.
    residual_dof : str
        Degrees of freedom of the residual in eq. (11): "r-c" as printed, or "r-1", with which the published
        standard deviations of the EMPS bench come out.
    drift_check : bool
        With "wls", fit again at 0.7 and 1.4 times the cut-off, with twice the cut-off of directions, and with
        half and twice the weight of rows without a force; add to the covariance how far the estimate drifts,
        and how far noise of the sensors pulls it: no residual shows what noise in the columns and missing
        dynamics do. With "iv" only what noise does not explain counts: it is model error.
    rows_for_tag : mapping of str to sequence of str, or "pham2002", optional
        Rows (by name) that records of a tag may feed; records of other tags feed all rows. "pham2002" is the
        paper's pairing: differentiated rows from records tagged ``chirp``, the others from ``trapezoid``.
    directions : mapping of str to str, optional
        Where the direction of a body comes from that has no position or velocity sensor: ``sign_BODY`` -> a
        channel that moves with it, see `modelgen.runtime.records.directions`.
    delays : mapping of str to float, "estimate" or "none", optional
        By how many s force channels are late; or whether to estimate that. By default "iv" estimates it.
    held : sequence of str
        Force channels that are commands behind a zero-order hold: half a sample late, averaged over one.
    loop : Loop, optional
        The controller at work during the records. With a channel ``reference`` in the records, "iv" simulates
        the closed loop; otherwise it follows the measured force.
    period_s : float, mapping of str to float or "none", optional
        Period of the excitation in s, of all records or by name; found in the forces if not given. Where all
        records are periodic, the spread over periods gives a third covariance.
    keep : sequence of str
        Base parameters that pruning spares, and that get a number in spite of a doubt; see `Checks`.
    hold_out : str, sequence of str or float, optional
        Records (by name), or the share at the end of every record, that the estimate must explain unseen.
    scan_cutoffs : sequence of float or "auto", optional
        Cut-offs in Hz to estimate with as well; "auto" tries some cut-offs and orders around the chosen ones.
    robust : "huber", optional
        Samples with large residuals weigh less (`modelgen.runtime.least_squares.huber`); with "wls" and "iv".
    bounds : "physical", optional
        Keep inertia, stiffness, damping and friction from being negative, and tell what that costs.
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
    say = progress or _silent
    given = as_records(records)
    model = model if isinstance(model, Model) else model_from_module(model)
    _check(model, given, method, drop, prune_percent, residual_dof, directions or {}, rows_for_tag)
    check_treatment(method, robust, bounds)
    chosen = METHODS[method]
    periods = periods_of(model, given, period_s)
    given, unseen = split(given, hold_out, periods)
    say("choosing filters")
    doubts = suspicions(model, given)
    with told_on_failure(doubts):
        choice = choose_filter(
            model,
            given,
            cutoff_hz=cutoff_hz,
            filter_order=filter_order,
            decimation=decimation,
            direction_cutoff_hz=direction_cutoff_hz,
            matched=chosen.matched,
        )
    given = with_directions(model, given, directions or {}, choice.direction_cutoff_hz)
    given, late = aligned(model, given, delays, held, chosen.consistent)
    unseen = with_directions(model, unseen, directions or {}, choice.direction_cutoff_hz)
    unseen = aligned(model, unseen, delays, held, chosen.consistent)[0]
    rows = rows_for_tags(model, rows_for_tag)
    job = Job(model, given, choice, drop or 0, rows, loop, late, robust=robust, bounds=bounds)
    say("filtering and solving")
    with told_on_failure(doubts):
        observation, plain = chosen.run(job)
        refused, advice = refusals(model, given, choice, plain, keep)
        if all(name in refused for name in plain.columns):
            raise all_refused(refused)
    advice = (*doubts, *advice)
    fit, treatment, cost = treat(plain, model, robust, bounds)
    job = treatment.job(job)
    at_bounds = bound_reasons(cost, fit) if cost else {}
    as_measured = unweighted(fit, plain)
    drift = np.zeros((len(fit.columns), len(fit.columns)))
    lowest_fs = min(record.fs for record in given)
    found_late = {channel: delay for channel, delay, _ in fit.delays}
    moved = tuple(advanced(record, found_late) for record in given)

    def again(other: FilterChoice) -> Fit:
        # speeds at standstill belong to the filter for directions
        same = other.direction_cutoff_hz == choice.direction_cutoff_hz
        surveys = observation.surveys if same else ()
        setting = replace(job, records=moved, late=(), choice=other, start=plain, surveys=surveys)
        return treatment(chosen.run(setting)[1])

    if drift_check and chosen.matched:
        say("changing cut-off and weights")
        if chosen.consistent:
            seen = coordinates_of(fit, model, treatment.at_zero)
            found = all_disagreements(fit, choice, lowest_fs, again, bool(model.direction_keys), seen)
            drift += seen.in_columns(significant_drift(found, len(seen.names)))
            told = [name for name in seen.names if name not in refused]
            notes = disagreement_notes(found, seen.names, told)
            fit = replace(fit, notes=fit.notes + notes)
        else:
            kept = np.ix_(*2 * ([plain.columns.index(name) for name in fit.columns],))
            drift += cutoff_drift(fit, choice, lowest_fs, again)
            if model.direction_keys:
                drift += direction_drift(fit, choice, lowest_fs, again)
            if chosen.finish is None:
                drift += load_row_drift(plain, observation)[kept]
    extras = Extras(
        periods_found(fit, given, choice, periods),
        judge_held_out(
            job, method, as_measured, refused, [advanced(one, found_late) for one in unseen], treatment
        ),
        scanned(fit, choice, given, scan_cutoffs, again, {**refused, **at_bounds}, say),
        cost,
        bias_of(chosen, job, as_measured) if drift_check else None,
    )
    drift += more_than_noise(fit, extras)
    refused = late_refusals(fit, refused, drift, keep, extras.bias)
    say("judging the fit")
    if chosen.matched:
        asymmetric = asymmetries(plain, model, given, choice, drop or 0, refused)
        fit = replace(fit, notes=fit.notes + asymmetry_notes(asymmetric))
    fixed = dict.fromkeys(at_bounds, 0.0)
    solved = Solved(job, method, observation, fit, {**refused, **at_bounds}, drift, fixed, tuple(keep))
    estimate = judge(solved, residual_dof, prune_percent)
    return replace(
        estimate,
        checks=examine(estimate, job, as_measured, drift, refused, periods, extras, advice, keep),
    )


def as_records(records: Record | Channels | Sequence[Record | Channels]) -> tuple[Record, ...]:
    """Return records as a tuple; what is no record, but can be read in stretches, becomes one.

    Raises
    ------
    DataError
        When there is none, or something is neither.
    """
    several = tuple(records) if isinstance(records, Sequence) else (records,)
    if not several:
        raise DataError.at("records", "there are none", "give at least one Record")
    # a mapping of signals, say, has no read()
    strange = [one for one in several if not isinstance(one, Record) and not hasattr(one, "read")]
    if strange:
        problems = [Problem("records", f"hold a {type(one).__name__}", "give Records") for one in strange]
        raise DataError(*problems)
    return tuple(one if isinstance(one, Record) else Record.over(one) for one in several)


def _check(
    model: Model,
    records: Sequence[Record],
    method: str,
    drop: int | None,
    percent: float,
    residual_dof: str,
    directions: Mapping[str, str],
    rows_for_tag: object,
) -> None:
    """Raise one DataError for everything that is wrong with the options and the records' channels."""
    problems = []
    if method not in METHODS:
        problems.append(Problem("method", f"is {method!r}", f"choose one of {', '.join(METHODS)}"))
    if residual_dof not in RESIDUAL_DOFS:
        remedy = f"choose one of {', '.join(RESIDUAL_DOFS)}"
        problems.append(Problem("residual_dof", f"is {residual_dof!r}", remedy))
    if drop is not None and (isinstance(drop, bool) or not isinstance(drop, Integral) or drop < 0):
        problems.append(Problem("drop", f"is {drop!r}", "give a number of samples, 0 or more"))
    if isinstance(rows_for_tag, str) and rows_for_tag != PAPER:
        problems.append(Problem("rows_for_tag", f"is {rows_for_tag!r}", f'give a mapping, or "{PAPER}"'))
    if not percent > 0.0:
        problems.append(Problem("prune_percent", f"is {percent!r}", "give a percentage above 0"))
    problems += direction_problems(model, records, directions)
    measured = [key for key in model.channels if key not in wanted_directions(model)]
    for record in records:
        missing = [key for key in measured if key not in record.signals]
        problems += [missing_name(record.name, "channel", key, record.signals) for key in missing]
        # products of such samples would be lost: no answer, or one of rounding
        peaks = {k: record.facts.extent(k).peak for k in model.channels if k in record.signals}
        problems += [
            Problem(f"{record.name}: channel {key}", f"is {peak:g}: none reaches {SMALLEST:g}", REMEDY)
            for key, peak in peaks.items()
            if 0.0 < peak < SMALLEST
        ]
    if problems:
        raise DataError(*problems)
    refuse_same_data(records, measured)


def _silent(_: str) -> None:
    """Say nothing."""
