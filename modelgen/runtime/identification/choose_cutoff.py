"""A lower cut-off where noise of the sensors would drown the estimate at the one that the spectra ask for.

And a higher one for instruments of arms, where turns of the joints fill a record.

Spectra do not tell which frequencies an estimate can use: a feedback carries the sensor's noise into the
force, and lines of the electronics count as motion. So least squares is tried at lower cut-offs, its error
predicted from its covariance, its bias by noise, and how far the neighbouring cut-offs move it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.noise_bias import noise_bias
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.filter_choice.thresholds import HIGHEST_CUTOFF, SIGNAL_CUTOFF
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.options import Filters
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    CALM_CUTOFFS,
    CALM_SHARE,
    CALM_STEP,
    CLEARLY_BETTER,
    CUTOFF_STEPS,
    FULLY_KNOWN,
    LEAST_CALM,
    LITTLE_BIAS,
    LOAD_ROW_LEFT,
    NEARLY_BEST,
    SAMPLES_TRIED,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_block import RowBlock


@dataclass(frozen=True, eq=False)
class Tried:
    """Least squares at one cut-off: estimate, its variance and its bias by noise, shape (c,) each.

    `left` is the largest share of its largest term that a row without a force leaves.
    """

    choice: FilterChoice
    columns: tuple[str, ...]
    x: FloatArray
    variance: FloatArray
    bias: FloatArray
    left: float


def usable_cutoff(job: Job, filters: Filters) -> FilterChoice:
    """Return the filter choice of a job, or one with a lower cut-off that predicts a better estimate."""
    records = tuple(part_tried(record) for record in job.records)
    try:
        first = _tried(job, records, job.choice)
    except (DataError, IdentifiabilityError):
        return job.choice
    if np.all(np.abs(first.bias) <= LITTLE_BIAS * np.abs(first.x)):
        return job.choice
    found = [first]
    for step in range(1, CUTOFF_STEPS):
        try:
            choice = choose_filter(
                job.model,
                job.records,
                cutoff_hz=job.choice.cutoff_hz * 2.0 ** (-0.5 * step),
                filter_order=filters.filter_order,
                decimation=filters.decimation,
                direction_cutoff_hz=filters.direction_cutoff_hz,
                signal_cutoff_hz=filters.signal_cutoff_hz,
            )
            choice = replace(choice, slow_speeds=job.choice.slow_speeds)
            tried = _tried(job, records, choice)
        except (DataError, IdentifiabilityError):
            break
        if tried.columns != first.columns:
            break
        found.append(tried)
    best = _best(found)
    return job.choice if best == 0 else _explained(found[best].choice, job.choice)


def part_tried(record: Record) -> Record:
    """Return the middle of a long record: what is tried on it differs by far more than its parts."""
    if record.n <= SAMPLES_TRIED:
        return record
    start = (record.n - SAMPLES_TRIED) // 2
    return record.part(start, start + SAMPLES_TRIED, record.name)


def _tried(job: Job, records: tuple[Record, ...], choice: FilterChoice) -> Tried:
    here = replace(job, records=records, choice=choice, surveys=())
    fit = fit_matched(here.observed(records))
    bias = noise_bias(job.model, records, choice, fit)
    variance = np.maximum(np.diag(hac_covariance(fit)), 0.0)
    return Tried(choice, fit.columns, fit.solution.x, variance, bias, _load_rows_left(fit))


def _load_rows_left(fit: Fit) -> float:
    shares = zip(fit.blocks, fit.left_shares, strict=True)
    return max((share for block, share in shares if not block.has_force), default=0.0)


def _best(found: Sequence[Tried]) -> int:
    """Return which cut-off to take: the first, unless another is clearly better."""
    c = len(found[0].x)
    most = max(LOAD_ROW_LEFT, found[0].left)
    digits = [_digits(found, index) if one.left <= most else -np.inf for index, one in enumerate(found)]
    top = max(digits)
    if digits[0] >= top - CLEARLY_BETTER * c:
        return 0
    return next(index for index, one in enumerate(digits) if one >= top - NEARLY_BEST * c)


def _digits(found: Sequence[Tried], index: int) -> float:
    """Return how many digits of all parameters an estimate is predicted to know."""
    one = found[index]
    neighbours = [found[k].x for k in (index - 1, index + 1) if 0 <= k < len(found)]
    moved = np.mean([(other - one.x) ** 2 for other in neighbours], axis=0) if neighbours else 0.0
    bias = np.where(np.isfinite(one.bias), one.bias, one.x)
    error = np.sqrt(one.variance + bias**2 + moved)
    size = np.maximum(np.abs(one.x - bias), np.abs(one.x) / 3.0)
    share = error / np.maximum(size, np.finfo(float).tiny)
    return float(np.sum(-np.log10(np.clip(share, FULLY_KNOWN, 1.0))))


def _explained(choice: FilterChoice, first: FilterChoice) -> FilterChoice:
    sentence = (
        f"Cut-off {choice.cutoff_hz:.4g} Hz in place of {first.cutoff_hz:.4g} Hz: noise of the sensors would "
        "drown the estimate there."
    )
    kept = tuple(one for one in choice.sentences if not one.startswith("Cut-off"))
    return replace(choice, bands=first.bands, sentences=(sentence, *kept))


def with_calm_turns(task: Task) -> Task:
    """Return a task with a cut-off at which rows with a force leave turns out and keep enough samples.

    While a joint sticks its friction is no sign of a speed, and the low-pass of the rows spreads that around
    every turn. The rows of least squares see little of noise behind a low cut-off; noise does not bias
    instruments, so these may see a wider band, in which a turn is short. It is the lowest cut-off at which
    every row keeps `CALM_SHARE` of its record, else the one at which the row that keeps least keeps most, if
    that is `LEAST_CALM`; else the same task. What was given stays as it is.
    """
    filters, job = task.filters, task.job
    if filters.cutoff_hz is not None or filters.directions:
        return task
    choice, lowest_fs = task.choice, min(record.fs for record in task.records)
    found = []
    for _ in range(CALM_CUTOFFS):
        try:
            blocks = replace(job, choice=choice).calm(job.records).blocks
        except (DataError, IdentifiabilityError):
            break
        shares = (_calm_share(block, job, choice) for block in blocks if block.has_force)
        found.append((min(shares, default=0.0), choice))
        cutoff_hz = CALM_STEP * choice.cutoff_hz
        if found[-1][0] >= CALM_SHARE or cutoff_hz * SIGNAL_CUTOFF > HIGHEST_CUTOFF * lowest_fs:
            break
        choice = choose_filter(
            job.model,
            job.records,
            cutoff_hz=cutoff_hz,
            filter_order=filters.filter_order,
            decimation=filters.decimation,
            direction_cutoff_hz=filters.direction_cutoff_hz,
            signal_cutoff_hz=filters.signal_cutoff_hz,
        )
        choice = replace(choice, slow_speeds=task.choice.slow_speeds)
    share, choice = max(found, key=lambda one: one[0], default=(0.0, task.choice))
    if share < LEAST_CALM or choice is task.choice:
        return task
    sentence = (
        f"Cut-off {choice.cutoff_hz:.4g} Hz in place of {task.choice.cutoff_hz:.4g} Hz: rows that leave out "
        "the turns of their joints keep enough samples there."
    )
    kept = tuple(one for one in choice.sentences if not one.startswith("Cut-off"))
    choice = replace(choice, bands=task.choice.bands, sentences=(sentence, *kept))
    return replace(task, choice=choice, job=replace(job, choice=choice))


def _calm_share(block: RowBlock, job: Job, choice: FilterChoice) -> float:
    """Return the share of its record that a block keeps, 0 where it does not leave turns out."""
    every = job.records[block.record].n / choice.decimation[block.record]
    return 0.0 if block.turning else block.count / every
