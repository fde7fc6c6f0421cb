"""What the workers of a fleet do: stretches of a record -> triangles, fits -> sums for their covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.least_squares.hac_covariance import KernelSums
from modelgen.runtime.least_squares.hac_covariance_chunks import (
    Moments,
    MomentSums,
    ParzenSums,
    influence_chunks,
)
from modelgen.runtime.least_squares.triangle_fit import FactorFit, fit_factors, with_inverse
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.channels import Channels
from modelgen.runtime.rows.record_factors import RecordFactors, record_factors
from modelgen.runtime.rows.record_rows import RecordRows, matched_rows
from modelgen.runtime.rows.standstill_speeds import Survey

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Job:
    """What a worker needs to know of a record."""

    module_text: str
    source: Channels
    choice: FilterChoice
    task_samples: int

    def parts(self) -> range:
        """Number the parts that the record is cut into."""
        return range(max(1, -(-self.source.n // self.task_samples)))


@lru_cache(maxsize=8)
def fleet_model(text: str) -> Model:
    """Return the model of a generated module's text."""
    return model_from_text(text, "fleet")


@dataclass(frozen=True, eq=False)
class Prepared:
    """A job and the grid and survey of its record: what is found once for all its parts."""

    job: Job
    grid: range
    survey: Survey

    @cached_property
    def task(self) -> RecordRows:
        """What is to be done with the record; made by whoever first works on it, not by who receives it.

        What arrives at a worker is unpacked by the thread that answers the scheduler, which must not wait.
        """
        return replace(_task(self.job, self.survey), grid=self.grid)

    def __reduce__(self) -> tuple[Any, ...]:
        # a module does not travel, its text does
        return Prepared, (self.job, self.grid, self.survey)


def prepare(job: Job) -> Prepared:
    """Look through a record once."""
    task = _task(job, None)
    return Prepared(job, task.grid, task.survey)


def _task(job: Job, survey: Survey | None) -> RecordRows:
    return matched_rows(
        fleet_model(job.module_text), job.source, job.choice, job.choice.decimation[0], survey=survey
    )


def part_factors(prepared: Prepared, index: int) -> RecordFactors:
    """Return the factors of one part of a record's grid, cut at whole blocks."""
    task = prepared.task
    parts = len(prepared.job.parts())
    step = -(-len(task.grid) // parts)
    block = task.plan.feature_operator.block
    step = -(-step // block) * block
    mine = task.grid[index * step : (index + 1) * step]
    return record_factors(replace(task, grid=mine), threads=1)  # the workers are the threads


def fit_records(model: Model, records: Sequence[RecordFactors]) -> FactorFit:
    """Return the fit of records together, with its whole inverse."""
    return with_inverse(records, fit_factors(model, records))


def own_fit(module_text: str, record: RecordFactors) -> FactorFit:
    """Return the fit of one record alone."""
    return fit_records(fleet_model(module_text), [record])


def moments_of(prepared: Prepared, fits: Sequence[tuple[FactorFit, int]]) -> list[Moments]:
    """Return the moments of each fit's influence on a record, which is the fit's record of that number."""
    sums = [MomentSums(len(fit.columns)) for fit, _ in fits]
    _feed(sums, prepared, fits)
    return [one.result() for one in sums]


def kernel_sums(
    prepared: Prepared, fits: Sequence[tuple[FactorFit, int]], widths: Sequence[float]
) -> list[KernelSums]:
    """Return the kernel sums of each fit's influence on a record, for its bandwidth."""
    sums = [ParzenSums(len(fit.columns), width) for (fit, _), width in zip(fits, widths, strict=True)]
    _feed(sums, prepared, fits)
    return [one.result() for one in sums]


class _Sums(Protocol):
    def add(self, psi: FloatArray) -> None: ...


def _feed(sums: Sequence[_Sums], prepared: Prepared, fits: Sequence[tuple[FactorFit, int]]) -> None:
    for found in influence_chunks(fits, prepared.task):
        for one, psi in zip(sums, found, strict=True):
            one.add(psi)
