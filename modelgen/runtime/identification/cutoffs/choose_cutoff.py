"""The cut-off whose estimate is predicted to be the best, tried by least squares on a part of the records.

Spectra do not tell which frequencies an estimate can use: a feedback carries the sensor's noise into the
force, lines of the electronics count as motion, and a hundredth of the power may hold all that tells two
inertias apart. So least squares is tried at lower and higher cut-offs, and its error predicted from its
covariance, what noise of the sensors does to it, and how far it moves from what lower cut-offs find.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.noise_bias import noise_effect
from modelgen.runtime.diagnostics.tried_cutoff import Tried
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.cutoffs.cutoff_steps import (
    at_choice,
    choice_at,
    lacks_samples,
    with_enough_samples,
)
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    CALM_DIGITS,
    CALM_SHARE,
    CLEARLY_BETTER,
    CUTOFF_STEPS,
    LEAST_CALM,
    LITTLE_BIAS,
    LOAD_ROW_LEFT,
    NEARLY_BEST,
    SAMPLES_TRIED,
    STEPS_IN_VAIN,
    STRETCHES_TRIED,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.further_columns import with_columns_free
from modelgen.runtime.least_squares.hac_covariance import (
    covariance_of_bandwidth,
    influence,
    influence_of_stretches,
)
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.numerics.bandwidth import scores_bandwidth
from modelgen.runtime.records.record import Record


def with_predicted_cutoff(task: Task, consistent: bool) -> Task:
    """Return a task with the cut-off that predicts the best estimate; the same if its own is nearly as good.

    What was given stays as it is. While a joint of an arm sticks its friction is no sign of a speed, and the
    low-pass of the rows spreads that around every turn: instruments, whose intervals do not hold it, need a
    cut-off at which every row with a force leaves turns out and keeps `LEAST_CALM` of its record.

    Parameters
    ----------
    task : Task
    consistent : bool
        Whether noise of the sensors leaves the method that is to follow unbiased.
    """
    # directions that were made of channels that the user names belong to the first cut-off (guessed ones are
    # what an estimate begins with); rows with given positions are linear about an estimate only, which there
    # is none of yet
    named = task.filters.directions.keys() - task.job.guessed
    given = task.filters.cutoff_hz is not None or task.job.share < 1.0 or named
    if given or isinstance(task.model.kernel, DeflectedKernel):
        return task
    parts = tuple(part_tried(record) for record in task.job.records)
    if consistent:
        task = with_enough_samples(task, parts)
    scan = Scan(task, consistent, parts)
    best = scan.best()
    found = scan.at(best)
    if best == 0 or found is None:
        return task
    tried = len(scan.worth())
    return at_choice(
        task, found.choice, f": least squares, tried at {tried} cut-offs, predicts that most is known there."
    )


class Scan:
    """Cut-offs in steps of the root of two around that of a task, each tried once; 0 is its own."""

    def __init__(self, task: Task, consistent: bool, parts: tuple[Record, ...]) -> None:
        self._task, self._consistent, self._records = task, consistent, parts
        self._found: dict[int, Tried | None] = {}
        self._moves: dict[tuple[int, int], FloatArray] = {}
        self._correlated = 0.0  # samples

    def best(self) -> int:
        """Return which step to take: 0, unless another is clearly better.

        Of those nearly best it is the nearest that noise pulls little. Where turns fill the records
        at the first, it is a higher one that knows nearly as much.
        """
        first = self.at(0)
        if first is None:
            return 0
        # a lower cut-off keeps noise out, a higher one is of no use where noise drowns everything already
        ways = (1,) * (self.worth()[0] != 0.0) + (-1,) * (first.noisy and first.calm >= LEAST_CALM)
        for way in ways:
            self._walk(way)
        c, worth = len(first.x), self.worth()
        top = max(worth.values())
        if worth[0] >= top - CLEARLY_BETTER * c:
            return 0
        if first.calm < LEAST_CALM:
            return self._calmest({step for step, one in worth.items() if one >= CALM_DIGITS * top})
        nearly = [step for step, one in worth.items() if one >= top - NEARLY_BEST * c]
        unbiased = [step for step in nearly if (one := self.at(step)) is not None and not one.pulled]
        return min(unbiased or nearly, key=abs)

    def _calmest(self, steps: Collection[int]) -> int:
        """Return the lowest of some steps that keeps `CALM_SHARE` of the records, else the highest."""
        kept = {step: one.calm for step in steps if (one := self.at(step)) is not None}
        return min((step for step, calm in kept.items() if calm >= CALM_SHARE), default=max(kept))

    def _walk(self, way: int) -> None:
        """Try one step after the other while they gain, or something is not known at all yet.

        Where noise drowns a column at the best of them, it may be known much further on only.
        """
        step, vain, top, known = 0, 0, self.worth()[0], self._all_known(0)
        while vain < STEPS_IN_VAIN and abs(step) < CUTOFF_STEPS:
            step += way
            if self.at(step) is None:
                return
            now = self.worth()[step]
            vain = vain + 1 if now <= top and top > 0.0 and (known or way > 0) else 0
            if now > top:
                top, known = now, self._all_known(step)

    def _all_known(self, step: int) -> bool:
        """Tell whether noise drowns no column at a step that has been tried."""
        one = self.at(step)
        return one is not None and bool(np.all(np.isfinite(one.square_error)))

    def worth(self) -> dict[int, float]:
        """Return the digits of every step that gave an estimate, none of those that are of no use.

        Below the first cut-off little may be left of a motion: what moves from there is a measure where as
        much is known there, and of an estimate that noise pulls where hardly any is left of it there.
        """
        found = {step: one for step, one in sorted(self._found.items()) if one is not None}
        size = np.median([one.size for one in found.values()], axis=0)
        alone = {step: one.digits(size) for step, one in found.items()}
        most, nearly = max(LOAD_ROW_LEFT, found[0].left), NEARLY_BEST * len(size)
        usable = {step: one for step, one in found.items() if one.left <= most and one.calm >= LEAST_CALM}
        worth = dict.fromkeys(found, -np.inf)
        for step, one in usable.items():
            moved = np.zeros(len(size))
            for k, other in found.items():
                as_much = one.noisy > other.noisy or alone[k] >= alone[step] - nearly
                if k < step and (k >= 0 or (k in usable and as_much)):
                    moved = np.maximum(moved, self._moved(step, k))
            worth[step] = one.digits(size, moved)
        return worth

    def _moved(self, step: int, lower: int) -> FloatArray:
        one, other = self.at(step), self.at(lower)
        assert one is not None and other is not None
        if (step, lower) not in self._moves:
            self._moves[step, lower] = one.moved_from(other)
        return self._moves[step, lower]

    def at(self, step: int) -> Tried | None:
        """Return what a step gives; None where it gives nothing, or other columns."""
        if step not in self._found:
            first = self._found.get(0)
            try:
                one = self._tried(step)
            except (DataError, IdentifiabilityError):
                one = None
            alike = one is None or first is None or one.columns == first.columns
            self._found[step] = one if alike else None
        return self._found[step]

    def _tried(self, step: int) -> Tried | None:
        task, consistent = self._task, self._consistent
        choice = task.choice if step == 0 else choice_at(task, task.choice.cutoff_hz * 2.0 ** (0.5 * step))
        if choice is None:
            return None
        here = replace(task.job, records=self._records, choice=choice, surveys=())
        rows = here.observed(self._records, turns=not consistent)
        if step < 0 and consistent and not task.model.is_arm and lacks_samples(task.model, rows):
            return None  # the first had enough, and lower ones have fewer
        fit = fit_matched(rows)
        if consistent and here.late:
            fit = _delays_free(here, fit)
        calm = least_kept(fit, self._records, choice) if consistent and task.model.is_arm else 1.0
        noise = noise_effect(task.model, self._records, choice, fit)
        series, lengths = influence(fit), [record.n for record in self._records]
        reach = self._correlated_for(step, series, choice, calm)
        covariance = covariance_of_bandwidth(fit, series, reach)
        told = influence_of_stretches(fit, series, choice.decimation, lengths, STRETCHES_TRIED)
        if consistent:
            covariance = noise.spread @ covariance @ noise.spread.T
            told = [psi @ noise.spread.T for psi in told]
        lost, x = ~np.isfinite(noise.bias), fit.solution.x
        bias = np.where(lost, 0.0, noise.bias)
        square = np.maximum(np.diag(covariance), 0.0) + np.where(lost, np.inf, 0.0)
        return Tried(
            choice,
            fit.columns,
            x - bias if consistent else x,
            np.maximum(np.abs(x - bias), np.abs(x) / 3.0),
            square if consistent else square + bias**2,
            np.zeros(len(bias)) if consistent else bias,
            told,
            bool(np.any(np.abs(noise.bias) > LITTLE_BIAS * np.abs(x))),
            _left_without_force(fit),
            calm,
        )

    def _correlated_for(
        self, step: int, series: Sequence[FloatArray], choice: FilterChoice, calm: float
    ) -> float:
        """Return the least bandwidth: what is correlated for long at the first cut-off is so above."""
        factor = choice.decimation[0]
        if not self._correlated and calm >= LEAST_CALM:
            self._correlated = factor * scores_bandwidth(series)
        return self._correlated / factor if step > 0 else 1.0


def _left_without_force(fit: Fit) -> float:
    """Return the largest share of its largest term that a row without a force leaves."""
    shares = zip(fit.blocks, fit.left_shares, strict=True)
    return max((share for block, share in shares if not block.has_force), default=0.0)


def least_kept(fit: Fit, records: Sequence[Record], choice: FilterChoice) -> float:
    """Return the least share of its record that a row with a force keeps, 0 where one keeps its turns."""
    every = [record.n / factor for record, factor in zip(records, choice.decimation, strict=True)]
    kept = [
        0.0 if block.turning else block.count / every[block.record] for block in fit.blocks if block.has_force
    ]
    return min(kept, default=0.0)


def _delays_free(job: Job, fit: Fit) -> Fit:
    """Return a fit that leaves open how late its forces are."""
    rates = [job.rates(fit, job.records, channel) for channel in job.late]
    return with_columns_free(fit, rates)


def part_tried(record: Record, most: int = SAMPLES_TRIED) -> Record:
    """Return the middle of a long record, so many samples: what is tried differs by far more than parts."""
    if record.n <= most:
        return record
    start = (record.n - most) // 2
    return record.part(start, start + most, record.name)
