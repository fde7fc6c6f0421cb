"""Channels that were taken for each other: exchanged, they fit what the given ones do not.

An estimate from swapped channels need not look wrong: least squares pulls the row that no longer holds
towards zero and explains the rest. So where a value contradicts physics, or a row explains little, two
channels at a time are exchanged, or one is reversed, and the rows are solved again: those of the middle of a
long record. What no change of all records mends may be wrong in some of them alone.

What was set right in wrong channels, zeros, delays and gains, is as wrong as they are: channels are exchanged
as they were read, and zeros of encoders that read a deflection are found anew.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, product
from typing import NamedTuple

import numpy as np

from modelgen.errors import IdentifiabilityError, ModelgenError, Problem
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.row_noise import exceeding_noise, hardly_weighed
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.channel_changes import ChannelChange, channel_changes
from modelgen.runtime.identification.cutoffs.choose_cutoff import part_tried
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.refusals import dependent_columns, unanswered
from modelgen.runtime.identification.thresholds import (
    AS_LITTLE,
    BETTER,
    FAR_BETTER,
    LOOKED_INTO,
    OVER_NOISE,
    TRIES,
    TRIES_A_CHANNEL,
    UNEXPLAINED,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.parameters.bounds import negative_columns
from modelgen.runtime.parameters.thresholds import BEYOND_CHANCE
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class _Sense:
    """What a fit contradicts; of some (record, row) only what they leave, of all without."""

    job: Job
    fit: Fit
    rows: frozenset[tuple[int, int]] | None = None

    @cached_property
    def unexplained(self) -> float:
        """What share of its terms the worst row leaves."""
        used = {(block.record, block.row) for block in self.fit.blocks}
        # a row that is not used is not explained
        left = [0.0 if self.rows is None or self.rows <= used else 1.0]
        for index, block in enumerate(self.fit.blocks):
            if self.rows is None or (block.record, block.row) in self.rows:
                share = self.fit.unexplained(index)
                left.append(1.0 if share is None else share)
        return max(left)

    @cached_property
    def impossible(self) -> int:
        """How many values contradict physics; asks for a covariance."""
        fit, job = self.fit, self.job
        refused = unanswered(job.model, job.records, job.choice, fit) | dependent_columns(fit)
        spread = np.sqrt(np.maximum(np.diag(hac_covariance(fit)), 0.0))
        spreads = dict(zip(fit.columns, spread.tolist(), strict=True))
        # what cannot be told from others, or from zero, has a sign by chance
        return sum(
            name not in refused and -value > BEYOND_CHANCE * spreads[name]
            for name, value in negative_columns(job.model, fit).items()
        )

    def as_well(self, other: _Sense) -> bool:
        """Tell whether another fit leaves about as much or less; what explains nothing has any sign."""
        return other.unexplained < min(self.unexplained / BETTER, BETTER)

    def explained_by(self, other: _Sense) -> bool:
        """Tell whether the worst row of another fit leaves much less; to leave all of a term is the worst."""
        share = BETTER if self.unexplained >= UNEXPLAINED or self.impossible else FAR_BETTER
        return other.unexplained < share * min(self.unexplained, 1.0)

    def mended_by(self, other: _Sense) -> bool:
        """Tell whether another fit explains what this one does not, and contradicts nothing."""
        # only what fits is worth a covariance
        if not self.explained_by(other) and not (self.as_well(other) and self.impossible):
            return False
        return not other.impossible


class _Mended(NamedTuple):
    """A change of the channels of some records, and the fit that it mends."""

    sense: _Sense
    change: ChannelChange
    places: Sequence[int]


def swapped_channels(job: Job, fit: Fit) -> tuple[Advice, ...]:
    """Return what exchanging or reversing channels would mend; empty where nothing needs it.

    Parameters
    ----------
    job : Job
        Model, records and filters.
    fit : Fit
        Of the channels as they are given.
    """
    job = replace(job, late=())
    given, rows = _Sense(job, fit), None
    if not given.impossible:
        # a derivative may be all noise in a record that hardly moves: that says nothing of the channels
        rows = _beyond_noise(job, fit)
        given = _Sense(job, fit, rows)
        if given.unexplained < LOOKED_INTO:
            return ()
    run = METHODS["wls"].run
    parts = tuple(part_tried(record) for record in job.records)
    shorter = any(part.n < record.n for part, record in zip(parts, job.records, strict=True))
    job = replace(job, polished=False, leave_open=False)
    job = replace(job, records=parts, surveys=(), start=None) if shorter else job
    if shorter or fit.carried is not None or any(block.opened for block in fit.blocks):
        # composites that are free of each other explain by terms that cancel what physical values leave
        given = _Sense(job, run(job)[1], rows)
    if job.unaligned:
        parts = tuple(part_tried(record) for record in job.unaligned)
        job = replace(job, records=parts, surveys=(), start=None)
    still = [key for key in job.model.channels if not any(_spans(record, key) for record in job.records)]
    tries, every = max(TRIES, TRIES_A_CHANNEL * len(job.model.channels)), tuple(range(len(parts)))
    changes = [*islice(channel_changes(job.model, parts, still), tries)]
    alike = [change for change in changes if change.alike]
    others = [change for change in changes if not change.alike]
    # what measures something else may look like nearly anything, of noise as well: last, and in all records;
    # composites that are free of each other take it for what it is not
    if fit.carried is not None:
        others = []
    unlike = _unlike_others(fit, len(parts))
    for group in (product([every], alike), product(unlike, alike), product([every], others)):
        tried: list[_Mended] = []
        for places, change in group:
            try:
                other = _zeros_anew(_changed(job, change, places))
                found = _Sense(other, run(other)[1], rows)
                if given.mended_by(found):
                    tried.append(_Mended(found, change, places))
            except ModelgenError:
                continue
        if tried:
            return (_told(job, given, tried),)
    return ()


def or_swapped(error: IdentifiabilityError, job: Job, fit: Fit) -> IdentifiabilityError:
    """Return a refusal, or in its place what exchanging channels would mend: the rest follows."""
    swapped = [Problem(one.where, one.what, one.remedy) for one in swapped_channels(job, fit)]
    return IdentifiabilityError(*swapped) if swapped else error


def _unlike_others(fit: Fit, count: int) -> list[tuple[int, ...]]:
    """Return which of so many records may have wrong channels: those that explain little, or all others.

    The sum of all decides which of the two the values follow. Of two records that both explain little it may
    be either.
    """
    shares = [fit.unexplained(index) for index in range(len(fit.blocks))]
    worst = max((1.0 if share is None else share for share in shares), default=0.0)
    least = UNEXPLAINED if worst >= UNEXPLAINED else LOOKED_INTO
    little = {
        block.record
        for block, share in zip(fit.blocks, shares, strict=True)
        if share is None or share >= least
    }
    if count == 2 and len(little) != 1:
        little = {0}
    parts = tuple(sorted(little)), tuple(sorted(set(range(count)) - little))
    return [*parts] if all(parts) else []


def _spans(record: Record, key: str) -> bool:
    return key in record.signals and record.facts.extent(key).span > 0.0


def _told(job: Job, given: _Sense, tried: Sequence[_Mended]) -> Advice:
    """Return what is said of the change that leaves least, and of those that leave as much."""
    found, change, places = min(tried, key=lambda one: one.sense.unexplained)
    alike = [
        one.change.channels
        for one in tried
        if (one.change.words, one.places) == (change.words, places)
        and one.sense.unexplained <= (1.0 + AS_LITTLE) * found.unexplained
    ]
    records = [job.records[place] for place in places]
    names = ", ".join(record.name for record in records)
    samples = max(record.n for record in records)
    what = f"may be {change.words}: "
    if given.explained_by(found):
        what += f"the worst row then leaves {100.0 * found.unexplained:.3g} % of its largest term unexplained"
        what += f" (now {100.0 * given.unexplained:.3g} %)"
    else:
        what += f"then no value is negative that cannot be ({given.impossible} are now)"
    where = f"{names}, channel {' or '.join(alike)}, samples 0 to {samples - 1}"
    return Advice("swapped", where, what, "check which column is which channel, and their signs (--map)")


def _changed(job: Job, change: ChannelChange, places: Container[int]) -> Job:
    """Return a job whose records at these places are changed."""
    records = tuple(
        change.apply(record) if place in places else record for place, record in enumerate(job.records)
    )
    choice = job.choice if change.alike else choose_filter(job.model, records)
    return replace(job, records=records, choice=choice)


def _zeros_anew(job: Job) -> Job:
    if not job.model.is_arm:  # others need not load it
        return job
    from modelgen.runtime.identification.elastic.effect_rows import with_zeros_anew

    return with_zeros_anew(job)


def _beyond_noise(job: Job, fit: Fit) -> frozenset[tuple[int, int]]:
    """Return which (record, row) leave more than noise of the sensors, and than other values might leave."""
    beyond = exceeding_noise(job.model, job.records, job.choice, fit, OVER_NOISE)
    found = {(block.record, block.row) for block, _ in beyond}
    # only of those: it takes a covariance, and many exchanges are tried
    light = {
        (block.record, block.row)
        for index, block in enumerate(fit.blocks)
        if (block.record, block.row) in found and hardly_weighed(fit, index)
    }
    return frozenset(found - light)
