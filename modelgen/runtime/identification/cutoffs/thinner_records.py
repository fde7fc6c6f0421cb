"""Records of means, for what rows behind a low cut-off tell: a drive may log far faster than they need.

A count of samples says nothing of the time in which a chain moves: of three bodies with modes at 3 and 8 Hz
that were logged at 20 kHz, four stretches with 16,000 samples each told no parameter, and means over 13
samples told all to 1 %.
"""

from __future__ import annotations

from dataclasses import replace

from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import FINE, LEAST_THINNED
from modelgen.runtime.records.record import Record


def thinner(job: Job) -> Job | None:
    """Return the job of means over as many samples as filters hardly notice; None where that saves little.

    All channels are averaged alike, about the same instants: what holds between them holds between the means.
    """
    choice, records = job.choice, job.records
    highest = max(choice.cutoff_hz, choice.direction_cutoff_hz, choice.signal_cutoff_hz or 0.0)
    factors = [
        min(int(record.fs / (FINE * highest)), factor)
        for record, factor in zip(records, choice.decimation, strict=True)
    ]
    if min(factors) < LEAST_THINNED or not all(record.in_memory for record in records):
        return None
    decimation = tuple(have // factor for have, factor in zip(choice.decimation, factors, strict=True))
    means = tuple(_means(record, factor) for record, factor in zip(records, factors, strict=True))
    return replace(job, records=means, choice=replace(choice, decimation=decimation), surveys=())


def _means(record: Record, factor: int) -> Record:
    """Return a record of the means over so many samples each."""
    whole = record.n - record.n % factor
    means = {key: one[:whole].reshape(-1, factor).mean(axis=1) for key, one in record.signals.items()}
    return Record(means, record.fs / factor, record.name, record.tag, record.units)
