"""The estimators by name: each takes a job (model, records, settings) to rows and their fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.delays import delay_rates, fit_with_delays
from modelgen.runtime.least_squares.total_least_squares import fit_total
from modelgen.runtime.least_squares.wls import Fit, fit_matched, fit_paper
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.physical_parameters import all_from_composites
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation, observe, rows_by_tag
from modelgen.runtime.rows.paper_rows import observe_paper
from modelgen.runtime.rows.standstill_speeds import Survey

if TYPE_CHECKING:
    from modelgen.runtime.iv.companion_simulation import Loop

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Job:
    """What is to be estimated from what; see `modelgen.identify` for the options.

    `late` names the force channels whose delay is estimated as well. `start` is a fit at other settings,
    close to the one wanted; it saves rounds. `robust`, `bounds` and `at_zero` are for physical parameters
    fitted to composites; other fits are treated afterwards, see `robust_and_bounded`. `surveys` are those of
    an observation of the records with the same filter for directions, or nothing.
    """

    model: Model
    records: tuple[Record, ...]
    choice: FilterChoice
    drop: int = 0
    rows_for_tag: Mapping[str, Sequence[str]] | None = None
    loop: Loop | None = None
    late: tuple[str, ...] = ()
    start: Fit | None = None
    robust: str | None = None
    bounds: str | None = None
    at_zero: tuple[str, ...] = ()
    surveys: tuple[Survey, ...] = ()

    def observed(self, records: tuple[Record, ...], turns: bool = True) -> Observation:
        """Return the rows of records that these stand for, delays compensated, say."""
        rows = observe(self.model, records, self.choice, self.drop, turns, self.surveys)
        return self.only_rows_for_tag(rows)

    def only_rows_for_tag(self, observation: Observation) -> Observation:
        """Return the rows that the records' tags may feed."""
        if self.rows_for_tag is None:
            return observation
        return rows_by_tag(observation, self.records, self.rows_for_tag)

    def rates(self, fit: Fit, records: tuple[Record, ...], channel: str) -> tuple[FloatArray, ...]:
        """Return how the mismatch of a fit's rows changes with the delay of a force channel."""
        return delay_rates(fit, self.model, records, self.choice, self.drop, channel)


@dataclass(frozen=True)
class Method:
    """An estimator.

    `matched`: every signal goes through the same filter, so that moving the cut-off is a fair check.
    `covariance_kind`: "hac" or "printed", what its standard deviations rest on.
    `consistent`: noise of the sensors does not bias it, so that what moves with the cut-off is model error.
    `finish`: what turns a least-squares fit to some of the columns into this method's, None for nothing.
    """

    title: str
    run: Callable[[Job], tuple[Observation, Fit]]
    matched: bool
    covariance_kind: str
    consistent: bool = False
    finish: Callable[[Fit, Model], Fit] | None = None


def run_wls(job: Job) -> tuple[Observation, Fit]:
    """Weighted least squares on matched-filtered rows."""

    def run(records: tuple[Record, ...], _: Fit | None) -> tuple[Observation, Fit]:
        observation = job.observed(records)
        return observation, fit_matched(observation)

    return fit_with_delays(job.records, job.late, run, job.rates) if job.late else run(job.records, None)


def run_iv(job: Job) -> tuple[Observation, Fit]:
    """Instrumental variables on matched-filtered rows, started from their least-squares fit."""
    # its simulation is loaded by those who use it only
    from modelgen.runtime.iv.composite_iv import fit_composites_iv
    from modelgen.runtime.iv.gauss_newton_step import Rules
    from modelgen.runtime.iv.instrumental_variables import Setting, fit_iv, iv_round, starting_at

    def calm(records: tuple[Record, ...]) -> Observation:
        return job.observed(records, turns=False).dense()

    if all_from_composites(job.model):
        setting = Setting(job.model, job.records, job.choice, job.drop, job.loop)
        rules = Rules(job.robust is not None, job.bounds is not None, job.at_zero)
        return fit_composites_iv(setting, calm, job.late, job.start, rules)

    def run(records: tuple[Record, ...], start: Fit | None) -> tuple[Observation, Fit]:
        observation = calm(records)
        setting = Setting(job.model, records, job.choice, job.drop, job.loop)
        first = fit_matched(observation)
        if not job.late:
            return observation, fit_iv(starting_at(first, job.start or first), setting)
        return observation, first if start is None else iv_round(starting_at(first, start), setting)

    return fit_with_delays(job.records, job.late, run, job.rates) if job.late else run(job.records, None)


def run_pham2002(job: Job) -> tuple[Observation, Fit]:
    """The paper's procedure to the letter."""
    observation = observe_paper(job.model, job.records, job.choice, job.drop)
    observation = job.only_rows_for_tag(observation)
    return observation, fit_paper(observation)


def run_tls(job: Job) -> tuple[Observation, Fit]:
    """Total least squares on matched-filtered rows, weighted as least squares weighs them."""
    if job.late:
        raise DataError.at("delays", "are not estimated with method tls", "give them, or use wls or iv")
    observation, fit = run_wls(job)
    return observation, fit_total(fit, job.model)


METHODS: Mapping[str, Method] = {
    "wls": Method("weighted least squares on matched-filtered rows", run_wls, True, "hac"),
    "iv": Method("instrumental variables from a noise-free simulation", run_iv, True, "hac", True),
    "tls": Method("total least squares, for comparison", run_tls, True, "hac", finish=fit_total),
    "pham2002": Method("the paper to the letter, forces not filtered", run_pham2002, False, "printed"),
}
