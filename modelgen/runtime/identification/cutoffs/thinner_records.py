"""Records of means, for what rows behind a low cut-off tell: a drive may log far faster than they need.

A count of samples says nothing of the time in which a chain moves: of three bodies with modes at 3 and 8 Hz
that were logged at 20 kHz, four stretches with 16,000 samples each told no parameter, and means over 13
samples told all to 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.cutoffs.cutoff_steps import choice_at
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import FEWEST_MEANS, FINE, LEAST_THINNED
from modelgen.runtime.records.channels import Channels
from modelgen.runtime.records.record import Record


def _thinned_by(job: Job) -> tuple[int, ...] | None:
    """Return over how many samples of each record means may be that filters hardly notice.

    None where that saves little.
    """
    choice, records = job.choice, job.records
    highest = max(choice.cutoff_hz, choice.direction_cutoff_hz, choice.signal_cutoff_hz or 0.0)
    factors = tuple(
        min(int(record.fs / (FINE * highest)), factor)
        for record, factor in zip(records, choice.decimation, strict=True)
    )
    return factors if min(factors) >= LEAST_THINNED else None


def thinner(job: Job) -> Job | None:
    """Return the job of such means, if they save much; its rows keep their rate.

    All channels are averaged alike, about the same instants: what holds between them holds between the means.
    """
    factors, choice = _thinned_by(job), job.choice
    if factors is None:
        return None
    decimation = tuple(have // factor for have, factor in zip(choice.decimation, factors, strict=True))
    means = tuple(_means(record, factor) for record, factor in zip(job.records, factors, strict=True))
    return replace(job, records=means, choice=replace(choice, decimation=decimation), surveys=())


def beyond_means(chosen: Task, decided: Task) -> Task | None:
    """Return a task at the cut-off that its means decided on; None where they were made for about that one.

    Parameters
    ----------
    chosen : Task
        Of all samples, with the cut-off that means were made for.
    decided : Task
        What became of these.
    """
    hertz, rate = decided.choice.cutoff_hz, min(record.fs for record in decided.records)
    if rate == min(record.fs for record in chosen.records) or hertz * FEWEST_MEANS <= rate:
        return None
    if (choice := choice_at(chosen, hertz)) is None:
        return None
    return replace(chosen, choice=choice, job=replace(chosen.job, choice=choice))


@dataclass(frozen=True, eq=False)
class MeanChannels:
    """Means over `factor` samples of a source each, less what a mean takes off a second derivative.

    That is right to fourth order in frequency times their time. Directions of motion have no such mean. They
    are the same however they are read; the first and the last are means alone.
    """

    source: Channels
    factor: int

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the channels."""
        return self.source.keys

    @property
    def name(self) -> str:
        """Names the record in messages."""
        return self.source.name

    @property
    def fs(self) -> float:
        """Means a second, in Hz."""
        return self.source.fs / self.factor

    @property
    def n(self) -> int:
        """Number of means."""
        return self.source.n // self.factor

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        """Return means start to stop of a channel, shape (stop - start,)."""
        first, behind = max(start - 1, 0), min(stop + 1, self.n)
        samples = self.source.read(channel, first * self.factor, behind * self.factor)
        means: FloatArray = np.asarray(samples, dtype=float).reshape(-1, self.factor).mean(axis=1)
        means[1:-1] -= np.diff(means, 2) / 24.0
        return means[start - first : stop - first]


def _means(record: Record, factor: int) -> Record:
    """Return a record of means; in memory where the one of all samples is."""
    means = MeanChannels(record.source, factor)
    if not record.in_memory:
        return Record.over(means, record.tag)
    every = {key: means.read(key, 0, means.n) for key in record.keys}
    return Record(every, means.fs, record.name, record.tag, record.units)
