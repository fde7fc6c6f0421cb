"""The cut-off at which instruments know most, looked for from the one that least squares predicts.

Where noise of the sensors is much of a column, what least squares predicts is uncertain itself. Nor does it
know that white rows weigh low frequencies most, of which the samples around reversals take the more away the
lower the cut-off is. Instruments say both themselves, from one simulation at all cut-offs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.noise_bias import noise_effect
from modelgen.runtime.diagnostics.residual_tests import residual_tests
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.diagnostics.tried_cutoff import Tried
from modelgen.runtime.identification.cutoffs.choose_cutoff import least_kept
from modelgen.runtime.identification.cutoffs.cutoff_steps import at_choice, choice_at, choices_above
from modelgen.runtime.identification.explanation.explained import Begun, run_method
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    CALM_SHARE,
    COLOURED,
    CUTOFF_STEPS,
    EVEN,
    KNOWN_BETTER,
    LITTLE_BIAS,
    OTHER_CHAIN,
    OVER_NOISE,
    STEPS_IN_VAIN,
    STRETCHES_TRIED,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import (
    hac_covariance,
    influence,
    influence_of_stretches,
)


def at_best_cutoff(begun: Begun) -> Begun:
    """Return instruments at the cut-off at which they know most; as they are where that is hardly better.

    What was given stays as it is, and what leaves more than noise is left to the search for its cause.
    """
    task = begun.task
    given = task.filters.cutoff_hz is not None or task.filters.directions
    if given or task.job.effects or not _matters(task.job, begun.found.fit):
        return begun
    scan = _Scan(begun)
    best = scan.best()
    if not best:
        return begun
    found = scan.found[best]
    before, choice = task.choice, found.task.choice
    sentence = (
        f"Cut-off {choice.cutoff_hz:.4g} Hz in place of {before.cutoff_hz:.4g} Hz: instruments, tried at "
        f"{len(scan.found)} cut-offs, know most there."
    )
    kept = [one for one in choice.sentences if not one.startswith("Cut-off")]
    choice = replace(choice, bands=before.bands, sentences=(sentence, *kept))
    job = replace(found.task.job, choice=choice, start=task.job.start)
    task = replace(found.task, choice=choice, job=job)
    return replace(found, task=task)


def at_cutoff_of(task: Task, found: Task) -> Task:
    """Return a task at the cut-off of another of the same records, as if it were given."""
    choice = found.choice
    filters = replace(task.filters, cutoff_hz=choice.cutoff_hz)
    return replace(task, choice=choice, filters=filters, job=replace(task.job, choice=choice))


def calmer(task: Task) -> Iterator[Task]:
    """Yield a task at the next higher cut-offs at which samples are free of reversals.

    Where every sample feels one at its own cut-off: a trapezoid shows the mode of its link in the little that
    rings behind each step, which a low-pass for the motion itself smears over all of them.
    """
    if task.filters.cutoff_hz is not None or not _turning(task):
        return
    every = (
        replace(task, choice=choice, job=replace(task.job, choice=choice, surveys=()))
        for choice in choices_above(task, CUTOFF_STEPS - 1)
    )
    yield from islice((higher for higher in every if not _turning(higher)), STEPS_IN_VAIN)


def at_white_cutoff(given: Task, begun: Begun, run: Callable[[Task], Begun]) -> Begun:
    """Return physical parameters, where their residual is far from white those at a cut-off where it is not.

    Several chains may nearly suit rows that see one of their resonances only. The residual of the wrong one
    has a colour that noise of the sensors has not; a higher cut-off, up to that of `given`, sees more. What
    is no other chain there, and where all have a colour, the difference to the whitest is in the intervals.
    """
    task = begun.task
    if given.filters.cutoff_hz is not None or _colour(begun) <= COLOURED:
        return begun
    highest, others = max(given.choice.cutoff_hz, np.sqrt(2.0) * task.choice.cutoff_hz), list[Begun]()
    for choice in choices_above(task, CUTOFF_STEPS):
        if choice.cutoff_hz > EVEN * highest:
            break
        why = ", at which the residual of physical parameters is no noise."
        with suppress(IdentifiabilityError, DataError):
            others.append(run(at_choice(task, choice, why)))
            if _colour(others[-1]) <= COLOURED:
                break
    if not others:
        return begun
    found = min(others, key=_colour)
    if found.found.fit.columns != begun.found.fit.columns:
        return found if _colour(found) <= COLOURED else begun
    move = found.found.fit.solution.x - begun.found.fit.solution.x
    variance = sum(np.diag(hac_covariance(one.found.fit) + one.found.drift) for one in (begun, found))
    other_chain = bool(np.any(np.abs(move) > OTHER_CHAIN * np.sqrt(np.maximum(variance, 0.0))))
    if other_chain and _colour(found) <= COLOURED:
        return found
    return replace(begun, found=replace(begun.found, drift=begun.found.drift + np.outer(move, move)))


def _colour(begun: Begun) -> float:
    """Return the largest statistic of whiteness of the rows' residuals, as a multiple of its bound."""
    job, fit = begun.task.job, begun.found.fit
    tests = residual_tests(job.model, job.records, job.choice, fit, {})
    return max(
        (one.whiteness / one.whiteness_bound for one in tests if one.whiteness and one.whiteness_bound),
        default=0.0,
    )


def _turning(task: Task) -> bool:
    """Tell whether some row has no sample that feels no reversal."""
    return task.job.calm(task.job.records).turning


def _matters(job: Job, fit: Fit) -> bool:
    """Tell whether another cut-off may tell more: noise is in the columns, or reversals take samples away.

    White rows weigh all frequencies as they should; without either they know the same at any cut-off. Rows
    that use samples about reversals, or physical parameters, have a cut-off that the directions want.
    """
    kept = least_kept(fit, job.records, job.choice)
    if fit.carried is not None or not kept:
        return False
    if exceeding_noise(job.model, job.records, job.choice, fit, OVER_NOISE):
        return False
    if kept < CALM_SHARE:
        return True
    return noise_effect(job.model, job.records, job.choice, fit).most > LITTLE_BIAS


class _Scan:
    """Cut-offs in steps of the root of two around that of instruments, each from their estimate; 0 is it."""

    def __init__(self, begun: Begun) -> None:
        self._begun = begun
        self.found = {0: begun}
        self._tried = {0: _tried(begun)}
        self._moves: dict[tuple[int, int], FloatArray] = {}

    def best(self) -> int:
        """Return which step to take: 0, unless another is clearly better."""
        for way, in_vain in ((1, STEPS_IN_VAIN), (-1, 1)):
            step, vain, top = 0, 0, self._worth()[0]
            while vain < in_vain and abs(step) < CUTOFF_STEPS and self._try(step + way):
                step += way
                now = self._worth()[step]
                vain = vain + 1 if now <= top else 0
                top = max(top, now)
        worth = self._worth()
        best = max(worth, key=lambda step: (worth[step], -abs(step)))
        return best if worth[best] >= worth[0] + KNOWN_BETTER * len(self._tried[0].x) else 0

    def _worth(self) -> dict[int, float]:
        """Return the digits of every step; what moves from a lower one that knows as much is an error."""
        size = np.median([one.size for one in self._tried.values()], axis=0)
        alone = {step: one.digits(size) for step, one in self._tried.items()}
        worth = {}
        for step, one in self._tried.items():
            moved: FloatArray = np.zeros(len(size))
            for lower, other in self._tried.items():
                if lower < step and alone[lower] >= alone[step]:
                    if (step, lower) not in self._moves:
                        self._moves[step, lower] = one.moved_from(other)
                    moved = np.maximum(moved, self._moves[step, lower])
            worth[step] = one.digits(size, moved)
        return worth

    def _try(self, step: int) -> bool:
        """Tell whether a step gives the same columns, of samples that feel no reversal."""
        begun = self._begun
        choice = choice_at(begun.task, begun.task.choice.cutoff_hz * 2.0 ** (0.5 * step))
        if choice is None:
            return False
        job = replace(begun.task.job, choice=choice, start=begun.found.fit, surveys=())
        task = replace(begun.task, choice=choice, job=job)
        try:
            found = run_method(task, begun.task.method)
        except (DataError, IdentifiabilityError):
            return False
        fit = found.found.fit
        # where every sample feels a reversal, directions err by more than noise says
        if fit.columns != begun.found.fit.columns or fit.turning:
            return False
        self.found[step], self._tried[step] = found, _tried(found)
        return True


def _tried(begun: Begun) -> Tried:
    """Return what instruments at one cut-off know."""
    job, fit = begun.task.job, begun.found.fit
    lengths, none = [record.n for record in job.records], np.zeros(len(fit.columns))
    told = influence_of_stretches(fit, influence(fit), job.choice.decimation, lengths, STRETCHES_TRIED)
    square, x = np.maximum(np.diag(hac_covariance(fit)), 0.0), fit.solution.x
    return Tried(job.choice, fit.columns, x, np.abs(x), square, none, told, False, 0.0, 1.0)
