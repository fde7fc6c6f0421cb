"""Forces that are found half a sample early: commands that a drive holds over every sample.

A zero-order hold delays a command by half a sample and averages it over one. The delay is found; the average,
(f / fs)^2 pi^2 / 6 of the force, looks nearly like inertia, and records hardly tell the two apart. What is
half a sample early without a hold would be chance, or a converter in the middle of the period: what that
would move stays in the intervals where the hold does not leave less.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import log

import numpy as np

from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.explanation.commands.held_images import (
    quiet_job,
    stepping_commands,
)
from modelgen.runtime.identification.explanation.commands.held_rounds import held_estimate
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    Explained,
    delays_of,
    exceeding,
    late_forces,
    run_method,
    with_note,
)
from modelgen.runtime.identification.explanation.from_starts import with_shown_effects
from modelgen.runtime.identification.explanation.what_is_left import chance, gained
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    CLEARLY_LESS,
    HALF_SAMPLE,
    HARDLY_MOVES,
    HARDLY_SHOWS,
    LEAST_APART,
    LEAST_BEFORE,
    UNDONE,
)
from modelgen.runtime.iv.effect import LOW_PASSES
from modelgen.runtime.iv.thresholds import AS_LIKELY
from modelgen.runtime.least_squares.delays import with_holds
from modelgen.runtime.least_squares.hac_covariance import hac_covariance


def with_held_commands(task: Task, first: Begun, told: Sequence[str], run: Callable[[Task], Begun]) -> Begun:
    """Return an estimate with commands as a drive holds them, without what their images add to the sensors.

    Parameters
    ----------
    task : Task
    first : Begun
        Its estimate, without regard to images.
    told : sequence of str
        Forces that are known to be held: the task has them as a hold makes them. Otherwise they are looked
        for.
    run : callable
        Takes a task to its estimate. Where it finds none, what was estimated first stays.
    """
    if told:
        held = {key: delays_of(first).get(key, 0.0) for key in told}
        return held_estimate(task, first, held, run)[0]
    if not first.task.checks.drift_check:
        return first
    others = [one for one in _alternatives(task, first, run) if one.begun is not first and one.follows]
    # steps are held wherever all of a command is, and how long the rest is held has to be estimated
    others.sort(key=lambda one: AS_LIKELY * one.further - one.gained(first))
    for place, one in enumerate(others):
        better = better_held(first, one)
        if better is not None:
            return _or_other(better, one.gained(first), others[place + 1 :], first)
    return _or_other(first, 0.0, others, first)


def with_shown_or_held(plain: Begun, held: Begun) -> Begun:
    """Return instruments in physical parameters with what their residual shows, with or without a hold.

    A lag that is no hold looks like one as long as it is not estimated: where a hold leaves more than noise,
    or needs further effects (a lag of the force less a hold is a low-pass of every sensor), the estimate
    without it, `plain`, is looked at as well.
    """
    best = with_shown_effects(held, holds_known=True)
    forces = held_commands(plain)
    alike = plain.found.fit.carried is not None and plain.task.choice == held.task.choice
    needed = [len(one.task.job.effects) for one in (held, best)]
    if not (forces and alike and (exceeding(best) or needed[1] > needed[0])):
        return best
    other = with_shown_effects(plain, holds_known=True)
    further = len(best.found.effects) - len(other.found.effects)
    by = gained(other, best, quiet_job(other.task), dict.fromkeys(forces, 1.0))
    return best if by > AS_LIKELY * max(further, 0) else other


@dataclass(frozen=True, eq=False)
class Held:
    """An estimate with held commands, or with their steps held alone.

    With by how many s each is late, and over how many samples it is held, or what is no step. It may be the
    `whole` of a command that takes steps at its samples.
    """

    begun: Begun
    late: Mapping[str, float]
    lengths: Mapping[str, float]
    stepped: bool = False
    whole: bool = False

    @property
    def follows(self) -> bool:
        """Whether each can be held, and late by that."""
        least = 1.0 if self.stepped or self.whole else 0.0
        return all(_follows(self.begun, key, late, least) for key, late in self.late.items())

    @property
    def further(self) -> int:
        """How many numbers are estimated beside the parameters: how long each is held where no step is."""
        return len(self.late) if self.stepped else 0

    @property
    def surprise(self) -> float:
        """Minus the logarithm of the chance that forces without a hold are as near to half a sample early.

        What a model lacks moves a delay: where more than noise is left, it may be anywhere by chance.
        """
        if self.stepped or exceeding(self.begun):
            return 0.0
        fs = self.begun.task.records[0].fs
        apart = [abs(late * fs - round(late * fs)) for late in self.late.values()]
        return -sum(log(2.0 * max(one, LEAST_APART)) for one in apart)

    def gained(self, first: Begun) -> float:
        """Return by how much more likely it is than `first`, which has the records without a hold."""
        return gained(first, self.begun, quiet_job(first.task), self.lengths)


def _alternatives(task: Task, first: Begun, run: Callable[[Task], Begun]) -> Iterator[Held]:
    held, likely = held_commands(first), partial(_may_be, cache(partial(_without_effects, first)))
    if held:
        holding = _holding(task, tuple(held))
        yield Held(*held_estimate(holding, first, held, run, likely=likely))
    beside, fs = late_forces(first), first.task.records[0].fs
    stepping = {key: beside[key] + 0.5 / fs if key in beside else 0.0 for key in stepping_commands(task)}
    if stepping:
        steps = Held(*held_estimate(task, first, stepping, run, True, likely), stepped=True)
        yield steps
        if not stepping.keys() <= held.keys():
            # a drive that acts at its samples alone holds all of its command, however late that is: with such
            # a delay a lag looks alike, but leaves more than noise
            holding = _holding(task, tuple(stepping))
            other = Held(*held_estimate(holding, steps.begun, steps.late, run, likely=likely), whole=True)
            if other.begun is not steps.begun and not exceeding(other.begun):
                yield other


def _without_effects(first: Begun) -> Begun:
    """Return an estimate without what its residual shows."""
    task = first.task
    return run_method(replace(task, job=replace(task.job, effects=(), sizes=())), task.method)


def _may_be(plain: Callable[[], Begun], held: Begun, lengths: Mapping[str, float]) -> bool:
    """Tell whether commands may be held, by estimates without and with it in which no effect is.

    What the residual shows of either takes most of the time. An effect may make up for a hold that there is
    not; no record speaks for that.
    """
    first = plain()
    before, after = first.found.fit, held.found.fit
    if before.columns == after.columns:
        known = np.sqrt(np.diag(hac_covariance(before) + first.found.drift))
        if np.all(np.abs(after.solution.x - before.solution.x) < HARDLY_MOVES * known):
            return False
    return gained(first, held, quiet_job(first.task), lengths) > -AS_LIKELY


def _or_other(better: Begun, by: float, others: Sequence[Held], first: Begun) -> Begun:
    """Return an estimate with what alternatives move in its drift, as far as these are as likely.

    What a controller adds to a binary command is nearly a sum of the columns: whether that is held as well
    shows in other motions only. The mean square about the estimate is that of the mixture of both (Hoeting et
    al. 1999), with odds as uncertain as likelihoods are; the estimate is by so much more likely than `first`.
    """
    for other in others:
        fit, found = other.begun.found.fit, better.found
        if fit.columns != found.fit.columns:
            continue
        likely = chance(by - other.gained(first))
        move = fit.solution.x - found.fit.solution.x
        known = np.sqrt(np.diag(hac_covariance(found.fit) + found.drift))
        if likely < HARDLY_SHOWS or np.all(np.abs(move) < HARDLY_MOVES * known):
            continue
        keys = ", ".join(other.late)
        note = (
            f"how {keys} acts between its samples hardly shows: the intervals hold what may be; if the "
            f"controller is sampled all of it is held (--held {keys})"
        )
        either = np.outer(move, move) + other.begun.found.drift
        better = with_note(better, note, (1.0 - likely) * found.drift + likely * either)
    return better


def held_commands(begun: Begun) -> dict[str, float]:
    """Return the forces whose delay was to be found that are early by half a sample, or one and a half.

    With each by how many s it is late beside a hold: what is computed in one period may act in the next. A
    record of it may be late as well, by whole samples; by one, it may be a mean over the last sample.
    """
    fs = begun.task.records[0].fs
    beside = {key: late + 0.5 / fs for key, late in late_forces(begun).items()}
    return {
        key: late
        for key, late in beside.items()
        if abs(late * fs - round(late * fs)) < HALF_SAMPLE and round(late * fs) != 1
    }


def _follows(begun: Begun, key: str, late: float, seen: float) -> bool:
    """Tell whether a command, or its steps, can be held, and late by so many s beside that.

    A lag that is estimated beside the hold is late, too: together they cannot take longer than the command
    does, which acts after it is given. Where they do, the lag alone is what was taken for a hold. A low-pass
    in the reading of what is held undoes the hold. Steps between samples are `seen` by up to so many later.
    """
    found, fs = begun.found, begun.task.records[0].fs
    sizes = {
        effect: size
        for effect, size in zip(found.effects, found.sizes, strict=True)
        if effect.channel == key and effect.kind in LOW_PASSES
    }
    if late * fs > 1.0:  # recorded late: when it was given is not known
        return not sizes
    lag = sum(effect.samples(size, fs) for effect, size in sizes.items() if effect.kind == "lag")
    undone = UNDONE / (24.0 * fs**2)
    return all(size < undone for size in sizes.values()) and seen - late * fs > lag - LEAST_BEFORE


def _holding(task: Task, channels: tuple[str, ...]) -> Task:
    return task.changed(partial(with_holds, channels=channels))


def _late_as_effect(before: Explained, after: Explained, channels: Collection[str]) -> bool:
    """Tell whether holds stand for delays that are effects, and need no other ones.

    They are effects where rows use samples near reversals: directions that change late move them there, and
    what they take off is no evidence against a hold.
    """
    late = {one.name for one in before.effects if one.kind == "delay" and one.channel in channels}
    names, kept = ({one.name for one in found.effects} for found in (before, after))
    return bool(late) and kept <= names


def better_held(begun: Begun, other: Held) -> Begun | None:
    """Return the estimate with holds unless it leaves more.

    What the holds move is in the intervals, unless they leave clearly less, or as little with fewer effects:
    the estimate without holds lies at the edge of a 95 % interval. What needs fewer effects may leave a
    little more for each, as may what half a sample speaks for; what needs more of them has to leave less.
    """
    held, channels = other.begun, tuple(other.late)
    before, after = begun.found.fit, held.found.fit
    more = other.gained(begun)
    fewer = len(begun.found.effects) - len(held.found.effects) - other.further
    allowed = AS_LIKELY * (1 + fewer if fewer >= 0 else fewer) + other.surprise
    if _late_as_effect(begun.found, held.found, channels):
        allowed = max(allowed, -log(CLEARLY_LESS) * before.count)
    if other.whole:
        allowed = -AS_LIKELY  # no half sample speaks for it
    if before.columns != after.columns or more < -allowed:
        return None
    half = 0.5 * (after.solution.x - before.solution.x)
    certain = more > AS_LIKELY * (0 if fewer > 0 else 1 - fewer)
    found = held.found
    drift = found.drift if certain else found.drift + np.outer(half, half)
    held = replace(held, found=replace(found, drift=drift))
    also = "" if certain else ", and the intervals hold what else it may be"
    if other.stepped or other.whole:
        where = "all of it is held" if other.whole else "and is held where it does"
        return with_note(held, f"{', '.join(channels)} takes steps at its samples, {where}{also}")
    what = (
        "acts half a sample later than recorded, as a command does that is held over every sample; it is "
        f"taken for one{also}"
    )
    told = tuple(
        Advice("more than the model", channel, what, f"name it (--held {channel})") for channel in channels
    )
    return replace(held, found=replace(held.found, advice=(*told, *found.advice)))
