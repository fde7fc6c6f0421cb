"""What the residual of a fit with instruments says of the model, and the fit with that taken into account.

Effects that the residual shows (`score_tests`) are estimated together with the parameters (`search`). Where
another effect explains the residual as well, or one is left that cannot be estimated, the intervals are
widened by what it would move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.explanation.explained import Explained, Shown, slope_of
from modelgen.runtime.identification.explanation.folded_forces import forces_bend
from modelgen.runtime.identification.explanation.look_at_residual import (
    Seen,
    likely_of,
    look,
    varied,
)
from modelgen.runtime.identification.explanation.other_weights import other_weights
from modelgen.runtime.identification.explanation.search import Search
from modelgen.runtime.identification.explanation.what_is_left import leaves_noise
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import KNOWN_INSTANT, MOST_TRIED
from modelgen.runtime.iv.effect import DIRECTION, FORCES, LOW_PASSES, Effect
from modelgen.runtime.iv.freed_effects import Freed
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.other_explanations import Looked, other_explanations
from modelgen.runtime.iv.score_tests import Score
from modelgen.runtime.iv.thresholds import LITTLE_OWN
from modelgen.runtime.iv.told_effects import bent_or_smooth, estimated, late_or_lagging, left_of, summed
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.rows.given_directions import brings_directions
from modelgen.runtime.rows.masks import direction_keys
from modelgen.runtime.rows.observation import Observation

# Kinds of effects that say when something is read, or changes.
TIMING = (DIRECTION, "delay")


def explained(job: Job, now: Freed, fit: Fit, effects: tuple[Effect, ...] = ()) -> Explained:
    """Return the fit with the effects that its residual shows.

    Parameters
    ----------
    job : Job
        Of the fit.
    now : Freed
        What it found.
    fit : Fit
        What was started from.
    effects : tuple of Effect
        Those that were estimated already.
    """
    none = np.zeros((len(fit.columns),) * 2)
    search = Search(job, slope_of(job.model, fit), now, effects, len(effects), {}, none)
    seen = search.look()
    labels, hidden = _open_sizes(seen), seen.hidden
    if fit.carried is not None:
        drift, shown = _held(job, now.fit, seen.found)
        told = tuple(left_of(one, shown) for one in shown[:1])
        search = replace(search, drift=drift, advice=told, ended=True)
        labels = (*summed(hidden, job.effects), *labels)
        return replace(_concluded(search, seen, labels), shown=_to_estimate(job, seen, shown))
    while not search.ended:
        search = search.step(seen)
        seen = seen if search.ended else search.look()
    return _concluded(search, seen, (*summed((*hidden, *seen.hidden), search.effects), *labels))


def _open_sizes(seen: Seen) -> tuple[str, ...]:
    """Return the notes on what forces and delays may be that the residual hardly shows."""
    if seen.unsized is None:
        return ()
    return (*late_or_lagging(seen.unsized.either), *bent_or_smooth(seen.unsized.bent))


def _concluded(search: Search, seen: Seen, labels: tuple[str, ...]) -> Explained:
    """Return what a search found, with what else could explain it, and what other weights move."""
    now, effects = search.now, search.effects
    weighed, told = other_weights(search.job, now.fit)
    others, apart = _others(search, seen)
    for effect, told_of in zip(effects, others, strict=True):
        names = {one.name for one, _ in told_of}
        told_of += [
            (one.effect, one.size) for one in search.ties.get(effect.name, ()) if one.effect.name not in names
        ]
    # what stood equal to the last one, solved for; of those before, what is left of it was looked at above
    last = search.ties.get(effects[-1].name, ()) if effects else ()
    for one in last:
        apart = apart + np.outer(one.x - now.fit.solution.x, one.x - now.fit.solution.x) / len(last)
    every = [estimated(*one) for one in zip(effects, now.sizes, others, strict=True)]
    found = [one for one, certain in zip(every, search.told(seen), strict=True) if certain]
    fit = replace(now.fit, notes=now.fit.notes + labels)
    unsolved = search.drift + apart
    for effect, size in zip(effects, now.sizes, strict=True):
        unsolved = unsolved + varied(search.job, fit, effect, size)
    drift = unsolved + weighed + unknown_timing(search.job, seen)
    advice = (*found, *search.advice, *told)
    return Explained(now.observation, fit, effects, now.sizes, drift, advice, search.held, unsolved)


def _others(search: Search, seen: Seen) -> tuple[list[list[tuple[Effect, float]]], FloatArray]:
    """Return what could stand in the place of each effect that is estimated, and what that would move."""
    now = search.now
    late = len(now.others) - len(search.effects)
    looked = Looked(now.others[:late], now.others[late:], seen.rows, search.slope)
    return other_explanations(now.fit, search.effects, now.sizes, now.stds, seen.tested, looked)


def _held(job: Job, fit: Fit, found: Sequence[Score]) -> tuple[FloatArray, list[Score]]:
    """Return what effects move that are not estimated, as a mean square, and those that the residual shows.

    Effects that are nearly sums of the columns are left out: a step that large tells nothing where nothing is
    solved again. Where the model lacks more than noise adds, what explains most counts, certain or not.
    """
    apart = [one for one in found if one.own > LITTLE_OWN and one.effect.possible(one.size)]
    shown = [one for one in apart if one.matters]
    loud = not leaves_noise(job, fit)
    held = dict.fromkeys([*(shown or likely_of(found))[:1], *(apart[:1] if loud else ())])
    drift = sum(
        (np.outer(one.move, one.move) + varied(job, fit, one.effect, one.size) for one in held),
        np.zeros((len(fit.columns),) * 2),
    )
    return drift, shown


def _to_estimate(job: Job, seen: Seen, shown: Sequence[Score]) -> tuple[Shown, ...]:
    """Return what a fit in physical parameters may estimate of what its residual shows.

    Of that a column may have little of its own, as everything is solved again. What one of several sensors
    reads amiss is like no command that is held, and neither is a force; what has one form of many is none.
    Where a low-pass of a force explains as much as that of a sensor, all sensors may seem to have one.
    """
    sensors = [one.key for one in job.model.sensors if one.key in job.model.channels]
    forces = [one for one in shown if one.effect.kind in FORCES]
    edited = [one for one in seen.found if one.matters and one.effect.edit and one.effect.possible(one.size)]
    behind = [one for one in edited if one.effect.kind in LOW_PASSES and one.effect.channel not in sensors]
    least = min((one.explained for one in behind), default=np.inf)
    read = [
        one
        for one in edited
        if one.effect.channel in sensors
        and len(sensors) > 1
        and not (one.effect.kind in LOW_PASSES and one.explained <= least)
    ]
    first = (*forces[:1], *read[:1])
    others = [one for one in edited if one not in first and one.effect.kind not in TIMING]
    return (
        *(Shown(effect, 0.0) for effect in seen.shapes[:1]),
        *(Shown(one.effect, one.size) for one in first),
        *(Shown(one.effect, one.size, like_a_hold=True) for one in others[:MOST_TRIED]),
    )


def found_by(job: Job, observation: Observation, fit: Fit) -> Freed:
    """Return a fit without effects as what `explained` starts from."""
    return Freed(observation, fit, _setting(job, fit))


def timing_is_open(job: Job, found: Explained) -> bool:
    """Tell whether a fit must use samples near reversals, or forces bend between samples."""
    turning = found.fit.carried is None and found.fit.turning
    return turning or forces_bend(job.model, job.records)


def with_timing(job: Job, found: Explained) -> Explained:
    """Return a fit with its intervals widened by what open timings move that it does not estimate.

    A late direction is told as well.
    """
    fit = found.fit
    if not timing_is_open(job, found):
        return found
    seen = look(job, found_by(job, found.observation, fit), (), slope_of(job.model, fit), TIMING)
    told = tuple(left_of(one, ()) for one in seen.found if one.matters and one.effect.kind == DIRECTION)
    return replace(found, drift=found.drift + unknown_timing(job, seen), advice=(*found.advice, *told))


def timing_moves(job: Job, observation: Observation, fit: Fit) -> FloatArray:
    """Return what delays of forces and of directions move that least squares does not estimate, (c, c).

    A mean square in SI, as of `unknown_timing`; nothing where the rows are not kept.
    """
    if not all(block.in_memory for block in fit.blocks):
        return np.zeros((len(fit.columns),) * 2)
    feel = [bool(direction_keys(job.model, row)) for row in range(len(job.model.rows))]
    blocks = tuple(replace(block.kept(), turning=feel[block.row]) for block in fit.dense().blocks)
    fit = replace(fit, blocks=blocks)
    return unknown_timing(job, look(job, found_by(job, observation, fit), (), None, TIMING))


def unknown_timing(job: Job, seen: Seen) -> FloatArray:
    """Return what timings that are not estimated move, as a mean square in SI, certain or not, shape (c, c).

    What forces do between their samples is in it. Where samples near reversals are used, directions are never
    known exactly: friction bends the velocity there, and what a low-pass makes of that is late. Delays of
    forces are as unknown.
    """
    # those of a simulation are sampled
    simulated = [record.fs for record in job.records if brings_directions(job.model, record)]
    least = KNOWN_INSTANT / max(simulated, default=np.inf)
    moves = [
        one.move * _at_least(one, least)
        for one in seen.found
        if one.effect.kind == DIRECTION or (one.effect.kind == "delay" and one.effect.channel in job.late)
    ]
    none = np.zeros((len(moves[0]),) * 2 if moves else (1, 1))
    return sum((np.outer(move, move) for move in moves), none if seen.folded is None else seen.folded)


def _at_least(one: Score, late: float) -> float:
    """Return how many times as much a direction moves that is late by so many s at least; 1 for others."""
    return max(1.0, late / abs(one.size)) if one.effect.kind == DIRECTION and one.size else 1.0


def _setting(job: Job, fit: Fit) -> Setting:
    delays = {channel: delay for channel, delay, _ in fit.delays}
    records = tuple(advanced(record, delays) for record in job.records)
    return job.setting(records)
