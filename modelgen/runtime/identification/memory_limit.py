"""What a limit of memory leaves: least squares makes its rows again; others keep rows several times."""

from __future__ import annotations

from math import ceil, inf
from numbers import Real

from modelgen.errors import Problem
from modelgen.runtime.filter_choice.record_length import decimation_for
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV, WLS, Method
from modelgen.runtime.identification.thresholds import (
    COPIES_OF_CHANNELS,
    COPIES_OF_ROWS,
    COPIES_OF_ROWS_IV,
    FEWEST_LEFT,
    MEGABYTE,
)
from modelgen.runtime.rows.observation import kept_bytes


def limit_problems(memory_limit_mb: float | None) -> list[Problem]:
    """Return what is wrong with a limit as it is given."""
    value = memory_limit_mb
    number = isinstance(value, Real) and not isinstance(value, bool)
    if value is None or (number and 0.0 < value < inf):
        return []
    return [Problem("memory_limit_mb", f"is {value!r}", "give a number of MB above 0")]


def beyond_limit(job: Job, method: Method) -> Problem | None:
    """Return why a job does not fit its limit of memory with a method, and what would; None where it does."""
    limit = job.memory_limit
    if limit is None or _remade(job, method):
        return None
    needed = _needed(job, method)
    if needed <= limit:
        return None
    samples = sum(record.n for record in job.records)
    what = (
        f"is {limit / MEGABYTE:g}, and method {method.name} needs about {ceil(needed / MEGABYTE)} for "
        f"{samples} samples"
    )
    ways = [
        *_decimations(job, method, limit),
        "leave out robust weights and delays to estimate"
        if isinstance(method, WLS)
        else "use method wls, which makes its rows again",
    ]
    left = int(samples * limit / needed)
    if left >= FEWEST_LEFT:
        ways.append(f"cut the records to {left} samples in all")
    ways.append(f"raise it to {ceil(needed / MEGABYTE)}")
    return Problem("memory_limit_mb", what, ", or ".join(ways))


def _remade(job: Job, method: Method) -> bool:
    """Tell whether a method asks for rows in stretches alone, so that they can be made again."""
    return isinstance(method, WLS) and job.robust is None and not job.late


def _needed(job: Job, method: Method, sparser: float = 1.0) -> float:
    """Return about how many bytes a method takes, with so many times the decimation."""
    rows = kept_bytes(job.model, job.records, job.choice) / sparser
    if not isinstance(method, IV):
        return COPIES_OF_ROWS * rows
    # noise-free records stay; the simulation of the longest one holds more
    lengths = [record.n for record in job.records]
    channels = 8.0 * len(job.model.channels) * (sum(lengths) + COPIES_OF_CHANNELS * max(lengths))
    return COPIES_OF_ROWS_IV * rows + channels


def _decimations(job: Job, method: Method, limit: float) -> list[str]:
    """Return the smallest decimation that fits, if the cut-off bears it."""
    used, cutoff_hz = max(job.choice.decimation), job.choice.cutoff_hz
    most = min(decimation_for(record.fs, cutoff_hz) for record in job.records)
    fitting = (factor for factor in range(used + 1, most + 1) if _needed(job, method, factor / used) <= limit)
    return [f"give decimation={factor}" for factor in fitting][:1]
