"""The estimators, values with their options: each takes a job (model, records, settings) to a fit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, ClassVar

from modelgen.errors import DataError
from modelgen.keyword_options import texts_of
from modelgen.runtime.identification.job import Job
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.total_least_squares import fit_total
from modelgen.runtime.least_squares.wls import fit_at, fit_from, fit_matched, fit_paper
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.physical_parameters import all_from_composites
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.paper_rows import observe_paper

if TYPE_CHECKING:
    from modelgen.runtime.iv.companion_simulation import Loop
    from modelgen.runtime.iv.instrumental_variables import Setting
    from modelgen.runtime.iv.physical.gauss_newton_step import Rules


def run_wls(job: Job) -> tuple[Observation, Fit]:
    """Weighted least squares on matched-filtered rows."""
    observed = job.observing(job.turns)

    def run(records: tuple[Record, ...], _: Fit | None) -> tuple[Observation, Fit]:
        observation = observed(records)
        return observation, job.with_gains(fit_matched(observation, polish=job.polished), records)

    return job.with_delays(run)


def run_iv(job: Job) -> tuple[Observation, Fit]:
    """Instrumental variables on matched-filtered rows, without the samples near a reversal."""
    from modelgen.runtime.iv.instrumental_variables import fit_iv, iv_round
    from modelgen.runtime.iv.physical.composite_iv import fit_composites_iv
    from modelgen.runtime.iv.shapes.shaped_effects import fit_in_shape

    composites = job.physical or all_from_composites(job.model)
    # steps in physical parameters add the friction that rows drop where they differentiate it
    observed = job.observing(turns=False, friction=composites)

    setting = job.setting()

    def dense(records: tuple[Record, ...]) -> Observation:
        return observed(records).dense()

    if composites:  # physical parameters are in many columns
        setting, rules = physical_setting(job)
        return fit_composites_iv(setting, dense, job.late, job.start, rules, job.begin, job.known_delays)

    waiting = []
    if job.start is None or not job.start.delays:  # else there are samples that tell a delay
        waiting = [observed(job.records)]
        # where every sample feels a reversal, a late force and a late change of direction look alike
        turning = any(block.turning and block.has_force for block in waiting[0].blocks)
        job = replace(job, late=()) if turning else job

    def run(records: tuple[Record, ...], start: Fit | None) -> tuple[Observation, Fit]:
        observation = waiting.pop() if waiting and records is job.records else observed(records)
        start = start or job.start
        if start is None and job.begin is not None:
            start = fit_from(observation, job.model.base_from_physical(job.begin))
        first = fit_matched(observation) if start is None else fit_at(observation, start)
        here = replace(setting, records=records)
        if not job.late:
            return observation, fit_iv(first, here)
        return observation, first if start is None else iv_round(first, here, first.simulated)

    if job.effects:
        near = job.start or run(job.records, None)[1]
        _, found = fit_in_shape(setting, observed, near, job.effects, job.sizes, job.sharpened)
        return found.observation, found.fit
    # turns leave gaps in the rows of arms, and stretches between them are too short to make them white
    return job.with_delays(run, None if job.model.is_arm else job.sharpened)


def physical_setting(job: Job) -> tuple[Setting, Rules]:
    """Return what steps in physical parameters simulate, and keep to."""
    from modelgen.runtime.iv.freed_effects import corrected
    from modelgen.runtime.iv.physical.gauss_newton_step import Rules

    setting, rules = job.setting(), Rules(job.robust is not None, job.bounds is not None, job.at_zero)
    if not job.effects:
        return setting, rules
    # of zeros most is known
    apart = corrected(job.records, {}, job.effects, job.all_sizes)
    sized = zip(job.effects, job.all_sizes, strict=True)
    sizes = tuple(0.0 if one.edit else size for one, size in sized)
    return replace(setting, records=apart, effects=job.effects, sizes=sizes), rules


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


@dataclass(frozen=True)
class Method(ABC):
    """An estimator with its options, which all of them have in common.

    Parameters
    ----------
    delays : mapping of str to float, "estimate" or "none", optional
        By how many s force channels are late; or whether to estimate that. By default only `IV` does.
    held : sequence of str
        Force channels that are commands behind a zero-order hold: half a sample late, averaged over one.
    rows_for_tag : mapping of str to sequence of str, or "pham2002", optional
        Rows (by name) that records of a tag may feed; records of other tags feed all rows. "pham2002" is the
        paper's pairing: differentiated rows from records tagged ``chirp``, the others from ``trapezoid``.
    robust : "huber", optional
        Samples with large residuals weigh less (`modelgen.runtime.least_squares.huber`); `WLS` and `IV`.
    bounds : "physical", optional
        Keep inertia, stiffness, damping and friction from being negative, links of arms bodies, and tell what
        that costs; `WLS` and `IV`.
    rows : str
        "force", or "power": one row of power in place of those of forces, without accelerations, for `WLS`
        (`modelgen.runtime.model.power`).
    residual_dof : str
        Degrees of freedom of the residual in eq. (11): "r-c" as printed, or "r-1", with which the published
        standard deviations of the EMPS bench come out.

    Attributes
    ----------
    name, title : str
    matched : bool
        Whether every signal goes through the same filter, so that moving the cut-off is a fair check.
    covariance_kind : str
        "hac" or "printed", what its standard deviations rest on.
    consistent : bool
        Whether noise of the sensors leaves it unbiased, so that what moves with the cut-off is model error.
    """

    delays: Mapping[str, float] | str | None = None
    held: Sequence[str] = ()
    rows_for_tag: Mapping[str, Sequence[str]] | str | None = None
    robust: str | None = None
    bounds: str | None = None
    residual_dof: str = "r-c"
    rows: str = "force"

    name: ClassVar[str] = ""
    title: ClassVar[str] = ""
    matched: ClassVar[bool] = True
    covariance_kind: ClassVar[str] = "hac"
    consistent: ClassVar[bool] = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "held", texts_of(self.held))

    @staticmethod
    @abstractmethod
    def run(job: Job) -> tuple[Observation, Fit]:
        """Return the rows of a job and their fit."""

    @staticmethod
    def finish(fit: Fit, model: Model) -> Fit:
        """Return this estimator's fit in place of a least-squares fit to some of the columns."""
        del model
        return fit


@dataclass(frozen=True)
class WLS(Method):
    """Weighted least squares, every signal through the same zero-phase filter; options as for `Method`."""

    name = "wls"
    title = "weighted least squares on matched-filtered rows"
    run = staticmethod(run_wls)


@dataclass(frozen=True)
class IV(Method):
    """Instrumental variables on the rows of `WLS`; delays of forces are estimated unless they are given.

    Free of the bias that noise of the sensors gives least squares.

    Parameters
    ----------
    loop : Loop, optional
        The controller at work during the records. With a channel ``reference`` in the records the closed loop
        is simulated; otherwise the simulation follows the measured force.
    start : str or mapping of str to float, optional
        What the first simulation has: the name of a parameter set that the model carries, or physical
        parameters by name (SI). By default what least squares finds, which noise may have bent.
    """

    loop: Loop | None = None
    start: Mapping[str, float] | str | None = None

    name = "iv"
    title = "instrumental variables from a noise-free simulation"
    consistent = True
    run = staticmethod(run_iv)


@dataclass(frozen=True)
class TLS(Method):
    """Total least squares on the rows of `WLS`, for comparison; options as for `Method`."""

    name = "tls"
    title = "total least squares, for comparison"
    run = staticmethod(run_tls)

    @staticmethod
    def finish(fit: Fit, model: Model) -> Fit:
        """Return the total least-squares fit to the same rows."""
        return fit_total(fit, model)


@dataclass(frozen=True)
class Pham2002(Method):
    """The paper to the letter, for comparison; biased where its filter reaches into the dynamics."""

    name = "pham2002"
    title = "the paper to the letter, forces not filtered"
    matched = False
    covariance_kind = "printed"
    run = staticmethod(run_pham2002)


@dataclass(frozen=True)
class Auto(Method):
    """The default: `IV`, or least squares where that finds nothing; the estimate says which it was, and why.

    Delays of forces are estimated unless they are given; options as for `Method`.

    Parameters
    ----------
    loop : Loop, optional
        As for `IV`.
    """

    loop: Loop | None = None

    name = "auto"
    title = "instrumental variables, or least squares where these find nothing"
    consistent = True
    run = staticmethod(run_iv)

    @property
    def instrumental(self) -> IV:
        """The same with instruments."""
        return IV(**{one.name: getattr(self, one.name) for one in fields(self)})

    @property
    def least_squares(self) -> WLS:
        """The same by least squares."""
        options = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "loop"}
        return WLS(**options)


METHODS: Mapping[str, type[Method]] = {one.name: one for one in (Auto, WLS, IV, TLS, Pham2002)}
