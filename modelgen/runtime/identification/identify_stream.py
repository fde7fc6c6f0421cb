"""identify_stream: model and records of any length -> parameters, in constant memory.

The rows are those of `modelgen.identify` with method "wls", and so are weights, covariances, drift and
physical parameters. Filters are chosen from stretches of a long record. What needs the residual itself (its
tests, the guards that look at whole records, other methods) is left to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, IdentifiabilityError, Problem
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, decimation_for, least_order
from modelgen.runtime.filter_choice.stretches import choose_from_stretches, stretches
from modelgen.runtime.identification.assemble_stream_estimate import (
    StreamSolved,
    judge_stream,
    refused_columns,
    stream_drift,
)
from modelgen.runtime.least_squares.triangle_fit import FactorFit, fit_factors, with_inverse
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Channels, RecordChannels
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.same_data import refuse_same_data
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.record_factors import RecordFactors, record_factors
from modelgen.runtime.rows.record_rows import matched_rows

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class StreamEstimate:
    """What was identified from the records of a machine, or of a fleet.

    Attributes
    ----------
    records : tuple of str
        Names of the records.
    params : mapping of str to float
        Base parameter to value (SI).
    bse, printed_bse : mapping of str to float
        Standard deviations: heteroskedasticity- and autocorrelation-consistent (as printed where the banded
        solution was used), and as printed in eq. (11).
    not_identifiable : tuple of str
        Base parameters whose columns are zero or cannot be told from others.
    covariance : array or None
        Of `params`, shape (parameters, parameters); None from the banded solution.
    nobs : int
        Rows of the observation matrix.
    sigma, relative_error, condition_number : float
        As of `modelgen.Estimate`.
    """

    records: tuple[str, ...]
    params: Mapping[str, float]
    bse: Mapping[str, float]
    printed_bse: Mapping[str, float]
    not_identifiable: tuple[str, ...]
    covariance: FloatArray | None
    nobs: int
    sigma: float
    relative_error: float
    condition_number: float


def identify_stream(
    model: Model,
    records: Sequence[Channels | Record],
    cutoff_hz: float | None = None,
    filter_order: int | None = None,
    decimation: int | None = None,
    direction_cutoff_hz: float | None = None,
    prune_percent: float = 10.0,
    drift_check: bool = True,
    chunk_samples: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Estimate:
    """Identify the parameters of a model from records that are read in chunks.

    Parameters
    ----------
    model : Model
    records : sequence of Channels or Record
    cutoff_hz, filter_order, decimation, direction_cutoff_hz : optional
        Taken as given; otherwise chosen from each record, or from stretches of a long one, by the rules of
        `modelgen.runtime.filter_choice.filter_choice`. Frequencies in Hz.
    prune_percent : float
        Relative standard deviation in % from which parameters are removed in the list beside the estimate.
    drift_check : bool
        Add to the covariance how far the estimate drifts with cut-off and weights, as `modelgen.identify`
        does; costs up to three more passes.
    chunk_samples : int, optional
        Samples read at a time; changes memory and speed, never the estimate.
    threads : int, optional
        Threads that filter and solve, a chunk each; by default one for every core that the process may use,
        and 1 in a process started by multiprocessing or dask. They change memory and speed, never the
        estimate.
    progress : callable, optional
        Called with a few words before each step.

    Returns
    -------
    Estimate
        That of `modelgen.identify`, without the residual itself.

    Raises
    ------
    DataError
        When an option is out of range, a record is too short, or holds a sample that is not finite.
    IdentifiabilityError
        When the records answer none of the parameters.
    """
    say = progress or (lambda _: None)
    if not records:
        raise DataError.at("records", "there are none", "give at least one record")
    whole = isinstance(threads, Integral) and not isinstance(threads, bool)
    if threads is not None and not (whole and threads >= 1):
        raise DataError.at("threads", f"is {threads!r}", "give a whole number of threads, 1 or more")
    sources = [RecordChannels(record) if isinstance(record, Record) else record for record in records]
    say("choosing filters")
    pieces = [stretches(model, source) for source in sources]
    refuse_same_data(sources, model.channels)
    choice = choose_from_stretches(model, pieces, cutoff_hz, filter_order, decimation, direction_cutoff_hz)
    say("filtering and solving")
    tasks = [
        matched_rows(model, source, choice, factor, samples=chunk_samples)
        for source, factor in zip(sources, choice.decimation, strict=True)
    ]
    factors = [record_factors(task, threads) for task in tasks]
    fit = with_inverse(factors, fit_factors(model, factors))
    seen = [piece for record in pieces for piece in record]
    refused = refused_columns(model, seen, choice, fit)
    if all(model.base_parameters[column] in refused for column in fit.columns):
        remedy = "record another motion, or sense more"
        raise IdentifiabilityError(*(Problem(name, reason, remedy) for name, reason in refused.items()))
    drift = np.zeros((len(fit.columns), len(fit.columns)))
    if drift_check:
        say("changing cut-off and weights")

        def again(other: FilterChoice) -> FactorFit:
            same = other.direction_cutoff_hz == choice.direction_cutoff_hz
            moved = [
                matched_rows(
                    model, task.source, other, factor, 0, chunk_samples, task.survey if same else None
                )
                for task, factor in zip(tasks, choice.decimation, strict=True)
            ]
            return fit_factors(model, [record_factors(task, threads) for task in moved])

        drift += stream_drift(model, factors, fit, choice, min(source.fs for source in sources), again)
    say("judging the fit")
    solved = StreamSolved(model, choice, tuple(tasks), tuple(factors), fit, refused, drift)
    return judge_stream(solved, prune_percent)


def stream_estimate(
    model: Model, records: Sequence[RecordFactors], fit: FactorFit, covariance: FloatArray | None
) -> StreamEstimate:
    """Return the fit under the names of the model."""
    names = [model.base_parameters[column] for column in fit.columns]
    told = [index for index in range(len(names)) if not fit.undetermined[index]]
    printed = fit.sigma * np.sqrt(fit.variance)
    spread = printed if covariance is None else np.sqrt(np.diag(covariance))
    known = [names[index] for index in told]
    lost = tuple(name for name in model.base_parameters if name not in dict.fromkeys(known))

    def of(values: FloatArray) -> Mapping[str, float]:
        return MappingProxyType({names[index]: float(values[index]) for index in told})

    return StreamEstimate(
        records=tuple(record.name for record in records),
        params=of(fit.x[list(fit.columns)]),
        bse=of(spread),
        printed_bse=of(printed),
        not_identifiable=lost,
        covariance=None if covariance is None else covariance[np.ix_(told, told)],
        nobs=fit.samples,
        sigma=fit.sigma,
        relative_error=fit.relative_error,
        condition_number=fit.condition_number,
    )


def stream_choice(
    model: Model,
    sources: Sequence[Channels],
    cutoff_hz: float,
    filter_order: int | None,
    decimation: int | None,
    direction_cutoff_hz: float | None,
) -> FilterChoice:
    """Return the filter settings that were given, with the defaults of `modelgen.identify` for the rest.

    Raises
    ------
    DataError
        When there is no record, or a frequency is out of range.
    """
    if not sources:
        raise DataError.at("records", "there are none", "give at least one record")
    half = 0.5 * min(source.fs for source in sources)
    direction = direction_cutoff_hz or cutoff_hz
    remedy = f"give a frequency between 0 and half the sampling frequency, {half:g} Hz"
    problems = [
        Problem(name, f"is {value!r}", remedy)
        for name, value in (("cutoff_hz", cutoff_hz), ("direction_cutoff_hz", direction))
        if not 0.0 < value < half
    ]
    if problems:
        raise DataError(*problems)
    order = filter_order if filter_order is not None else least_order(model)
    factors = tuple(decimation or decimation_for(source.fs, cutoff_hz) for source in sources)
    return FilterChoice(order, float(cutoff_hz), float(direction), factors, None, None, (), (), ())
