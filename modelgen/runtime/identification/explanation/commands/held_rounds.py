"""Estimates with held commands, made round by round: images need parameters and delays, which need images."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.explanation.best_cutoff import at_cutoff_of
from modelgen.runtime.identification.explanation.commands.held_images import HoldKind, without_images
from modelgen.runtime.identification.explanation.commands.rest_of_commands import (
    LaterRest,
    held_for,
    rest_seen,
    rest_unseen,
)
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    begun_at,
    delays_of,
    run_method,
    with_note,
)
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import HELD_ROUNDS, HELD_SETTLED, REST_UNKNOWN


def held_estimate(
    task: Task,
    first: Begun,
    held: Mapping[str, float],
    run: Callable[[Task], Begun],
    stepped: bool = False,
    likely: Callable[[Begun, Mapping[str, float]], bool] = lambda known, lengths: True,
) -> tuple[Begun, Mapping[str, float], Mapping[str, float]]:
    """Return an estimate without images, by how many s each command is late, and over how many samples held.

    With `stepped` its steps are, and what is beside them as long as the estimate shows; the intervals hold
    how long that may be. What was estimated first where there is no estimate, and where one without effects,
    with how long commands are held in it, is not `likely`: nothing else is looked for then.
    """
    task, known = at_cutoff_of(task, first.task), first
    # nothing else is looked for until images are nearly right: that takes most of the time
    plain = partial(run_method, method=first.task.method)
    fs = task.records[0].fs
    rest: Mapping[str, LaterRest] = (
        rest_unseen(first, {key: late * fs for key, late in held.items()}) if stepped else {}
    )
    moves: list[tuple[FloatArray, float]] = []
    with suppress(IdentifiabilityError, DataError):
        known, held, rest = _without_images(task, known, held, plain, rest, told=True)
        if not likely(known, _lengths(held, rest, fs)):
            return first, held, {}
        moves = list(_moved_by_rest(task, known, held, plain, rest))
    try:
        known, held, _ = _without_images(task, known, held, run, rest)
    except (IdentifiabilityError, DataError):
        return first, held, {}
    found = known.found
    drift = sum((std**2 * np.outer(move, move) for move, std in moves), found.drift)
    known = replace(known, found=replace(found, drift=drift))
    if unknown := [key for key, one in rest.items() if one.std > REST_UNKNOWN]:
        keys = ", ".join(unknown)
        what = f"how long {keys} is held beside its steps hardly shows: the intervals hold what may be"
        known = with_note(known, f"{what}; record it as often as its controller acts")
    return known, held, _lengths(held, rest, fs)


def _lengths(held: Mapping[str, float], rest: Mapping[str, LaterRest], fs: float) -> Mapping[str, float]:
    """Return over how many samples each command is held, or what is no step of it; fs in Hz."""
    lengths = {key: held_for(one.later, held[key] * fs) for key, one in rest.items()}
    return lengths or dict.fromkeys(held, 1.0)


def _without_images(
    task: Task,
    known: Begun,
    held: Mapping[str, float],
    run: Callable[[Task], Begun],
    rest: Mapping[str, LaterRest],
    told: bool = False,
) -> tuple[Begun, Mapping[str, float], Mapping[str, LaterRest]]:
    """Return an estimate that is made, round by round, without the images of the one before.

    With the delays of commands in s, and what is known of those of the rest, if it is to be `told`.
    """
    fs = task.records[0].fs
    for _ in range(HELD_ROUNDS):
        again = run(_stepping(task, known, held, rest))
        # images feel when the command changes, which shows only without them
        late = {key: delays_of(again).get(key, delay) for key, delay in held.items()}
        moved = [abs(late[key] - held[key]) * fs for key in held]
        if rest and told:
            better = rest_seen(again, rest, {key: late[key] * fs for key in held})
            moved += [abs(better[key].later - rest[key].later) for key in rest]
            rest = better
        known, held = again, late
        if max(moved) < HELD_SETTLED:
            break
    return known, held, rest


def _stepping(task: Task, known: Begun, held: Mapping[str, float], rest: Mapping[str, LaterRest]) -> Task:
    """Return a task without images at an estimate, and what is no step as late as is known, if it is."""
    later = {key: one.later for key, one in rest.items()} if rest else None
    return begun_at(without_images(task, held, known, HoldKind(later)), known)


def _moved_by_rest(
    task: Task,
    known: Begun,
    held: Mapping[str, float],
    run: Callable[[Task], Begun],
    rest: Mapping[str, LaterRest],
) -> Iterator[tuple[FloatArray, float]]:
    """Yield what half a sample of the rest of each command moves, and the deviation of that, in halves."""
    for key, one in rest.items():
        if one.std:
            other = run(
                _stepping(task, known, held, {**rest, key: LaterRest(one.later + 1.0, 0.0)})
            ).found.fit
            if other.columns == known.found.fit.columns:
                yield other.solution.x - known.found.fit.solution.x, one.std
