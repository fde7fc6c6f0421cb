"""identify_stream: model and records of any length -> parameters, in constant memory.

The rows are those of `modelgen.identify` with method "wls", and so are weights and covariances; what needs
the whole record at once (the choice of filters, the drift with them, the residual itself) is left to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError, Problem
from modelgen.runtime.channels import Channels, RecordChannels
from modelgen.runtime.choose import FilterChoice, decimation_for
from modelgen.runtime.contract import Model
from modelgen.runtime.data import Record
from modelgen.runtime.factor_fit import FactorFit, fit_factors
from modelgen.runtime.record_factors import RecordFactors, matched_task, record_factors
from modelgen.runtime.stream_covariance import stream_hac_covariance

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StreamEstimate:
    """What was identified from records that no memory had to hold.

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
    cutoff_hz: float,
    filter_order: int | None = None,
    decimation: int | None = None,
    direction_cutoff_hz: float | None = None,
    chunk_samples: int | None = None,
) -> StreamEstimate:
    """Identify the parameters of a model from records that are read in chunks.

    Parameters
    ----------
    model : Model
    records : sequence of Channels or Record
    cutoff_hz : float
        Cut-off of the matched filter in Hz; `modelgen.runtime.choose.choose_filter` finds one from a stretch.
    filter_order, decimation, direction_cutoff_hz : optional
        As for `modelgen.identify`; directions of motion are by default taken below `cutoff_hz`.
    chunk_samples : int, optional
        Samples read at a time; changes memory and speed, never the estimate.

    Raises
    ------
    DataError
        When a record is too short, or holds a sample that is not finite.
    IdentifiabilityError
        When the records answer none of the parameters.
    """
    sources = [RecordChannels(record) if isinstance(record, Record) else record for record in records]
    choice = stream_choice(model, sources, cutoff_hz, filter_order, decimation, direction_cutoff_hz)
    tasks = [
        matched_task(model, source, choice, factor, samples=chunk_samples)
        for source, factor in zip(sources, choice.decimation, strict=True)
    ]
    factors = [record_factors(task) for task in tasks]
    fit = fit_factors(model, factors)
    covariance = stream_hac_covariance(fit, tasks) if fit.inverse is not None else None
    return stream_estimate(model, factors, fit, covariance)


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
        relative_error=fit.residual_norm / fit.measured_norm if fit.measured_norm else float("inf"),
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
    order = filter_order if filter_order is not None else max(row.order for row in model.rows) + 2
    factors = tuple(decimation or decimation_for(source.fs, cutoff_hz) for source in sources)
    return FilterChoice(order, float(cutoff_hz), float(direction), factors, None, None, (), (), ())
