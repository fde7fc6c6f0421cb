"""What is said of effects that a residual shows, and what is done about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from modelgen.runtime.advice import ROWS_OWN, Advice
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import AT_REVERSALS, Effect
from modelgen.runtime.iv.score_tests import Score
from modelgen.runtime.iv.thresholds import AS_GOOD
from modelgen.runtime.records.record import Record

# What is done about an effect, in words.
ESTIMATED = "; that is estimated with the parameters"
HELD = "; the intervals hold what that moves"
# Effects whose sum with what the spec names is told where sensors cannot tell them apart.
SUMMED = ("Coulomb friction", "viscous friction")
# Kinds of effects that change a level: the mean of others is that of motion, of which encoders have a zero.
LEVELS = ("zero", "constant")
# So many other explanations are listed at most.
LISTED = 3


def estimated(effect: Effect, size: float, others: Sequence[tuple[Effect, float]]) -> Advice:
    """Return what is said of an effect that is estimated; `others` explain the residual nearly as well."""
    return _told(effect, size, ESTIMATED, others)


def left(effect: Effect, size: float, others: Sequence[tuple[Effect, float]]) -> Advice:
    """Return what is said of an effect that is not estimated, but held by the intervals."""
    return _told(effect, size, HELD, others)


def left_of(best: Score, shown: Sequence[Score]) -> Advice:
    """Return what is said of an effect that the intervals hold, and of others that explain nearly as much."""
    per_share = (best.size / best.std) ** 2 / best.explained
    others = [
        (one.effect, one.size)
        for one in shown
        if one.effect is not best.effect and per_share * (best.explained - one.explained) < AS_GOOD
    ]
    return left(best.effect, best.size, others)


def held_instead(told: Sequence[Advice], kept: Mapping[Effect, float]) -> tuple[Advice, ...]:
    """Return what is said of effects where none is estimated after all, but those that are `kept`."""
    on_time = [effect.said(size) for effect, size in kept.items()]
    return tuple(
        one
        if any(said in one.what for said in on_time)
        else replace(one, what=one.what.replace(ESTIMATED, HELD))
        for one in told
    )


def _told(effect: Effect, size: float, done: str, others: Sequence[tuple[Effect, float]]) -> Advice:
    listed = "; or ".join(other.said(step) for other, step in others[:LISTED])
    either = f" (or {listed}: the intervals hold for either)" if listed else ""
    what = f"shows that {effect.said(size)}{done}{either}"
    kind = ROWS_OWN if effect.kind in AT_REVERSALS else "more than the model"
    return Advice(kind, "the residual", what, effect.remedy)


def below_noise(effect: Effect, size: float, records: Sequence[Record]) -> bool:
    """Tell whether a zero is less than what one reading of its sensor is known to.

    Encoders have no zero to a part of a step. What it moves is in the estimate, or in the intervals.
    """
    key = effect.channel
    read = [one for one in records if key in one.signals] if effect.kind == "zero" else []
    return any(size**2 < 0.5 * one.facts.spectrum(key).noise * one.fs for one in read)


def within_rounding(effect: Effect, size: float, simulated: Sequence[Simulated]) -> bool:
    """Tell whether an effect changes positions by less than encoders round them, rms.

    Rounding follows the motion: it does not average out, and looks like whatever else does so. Positions that
    are not rounded tell what they tell, and so does what changes none.
    """
    seen = False
    for one in simulated:
        changes, sensors = effect.added(one, size), one.plant.model.sensors
        for sensor in sensors:
            record = one.measured
            if sensor.measures != "position" or sensor.key not in changes or record is None:
                continue
            step = record.facts.rounding(sensor.key) if sensor.key in record.signals else 0.0
            moved = changes[sensor.key]
            moved = moved if effect.kind in LEVELS else moved - np.mean(moved)
            if size**2 * float(moved @ moved) > len(moved) * step**2 / 12.0:
                return False
            seen = True
    return seen


def summed(unseen: Sequence[Effect], known: Sequence[Effect]) -> tuple[str, ...]:
    """Return the note that labels friction of several bodies that these sensors see as a sum.

    Each is named once, and none of those that are `known`, being estimated: what is estimated is in no sum.
    """
    every = dict.fromkeys(effect.name for effect in unseen if effect.name.startswith(SUMMED))
    apart = [effect.name for effect in known if effect.name.startswith(SUMMED)]
    names = [name for name in every if name not in apart]
    if not names:
        return ()
    holds = f"holds it as well, {' and '.join(apart)} not" if apart else "is the sum of all bodies' friction"
    return (
        f"{' and '.join(names)}, which the spec does not name, can hardly be told from the friction that it "
        f"names with these sensors: if there is any, the value {holds}",
    )


def late_or_lagging(channels: Sequence[str]) -> tuple[str, ...]:
    """Return the note on channels with delays of which a part may be that of a lag."""
    if not channels:
        return ()
    are = "is" if len(channels) == 1 else "are"
    return (
        f"whether {' and '.join(channels)} {are} late by the same time at all frequencies or behind a lag "
        "(a current loop, a filter) hardly shows: the intervals hold either",
    )


def bent_or_smooth(channels: Sequence[str]) -> tuple[str, ...]:
    """Return the note on forces that may do something else between their samples than a smooth one does."""
    if not channels:
        return ()
    bend = "bends" if len(channels) == 1 else "bend"
    return (
        f"whether {' and '.join(channels)} {bend} at every sample (a current loop behind a sampled "
        "controller) hardly shows: the intervals hold either; record it more often than its controller acts",
    )
