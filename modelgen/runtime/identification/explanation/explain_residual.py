"""What the residual of a fit with instruments says of the model, and the fit with that taken into account.

Effects that the residual shows (`score_tests`) are estimated together with the parameters, one at a time, the
one that explains most first. Where another effect explains the residual as well, or one is left that cannot
be estimated, the intervals are widened by what it would move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.identification.explanation.explained import Explained
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import (
    DISAGREEMENT,
    INEXACT,
    LEFT_SHARE,
    LITTLE_LEFT,
    MOST_EFFECTS,
    MOST_TRIED,
    OVER_NOISE,
    ROUGH,
    TRIED_TOO,
)
from modelgen.runtime.iv.effect import DIRECTION, Effect, unlike
from modelgen.runtime.iv.effect_rows import effect_rows, noise_rows, simulated_records
from modelgen.runtime.iv.freed_effects import Freed, fit_with_effects
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.iv.other_explanations import Looked, other_explanations
from modelgen.runtime.iv.score_tests import Score, scores, slope_of, without_noise
from modelgen.runtime.iv.thresholds import AS_GOOD, LITTLE_OWN
from modelgen.runtime.iv.told_effects import estimated, left, summed
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.unrelated_regressions import across_rows
from modelgen.runtime.rows.observation import Observation


def explained(job: Job, now: Freed, fit: Fit, effects: tuple[Effect, ...] = ()) -> Explained:
    """Return the fit with the effects that its residual shows.

    Parameters
    ----------
    job : Job
        Of the fit.
    now : Freed
        What it found.
    fit : Fit
        To start from when effects are estimated.
    effects : tuple of Effect
        Those that were estimated already.
    """
    c, given = len(fit.columns), len(effects)
    drift, advice = np.zeros((c, c)), list[Advice]()
    slope = slope_of(job.model, fit)
    labels: tuple[str, ...] | None = None
    ties: tuple[tuple[_Equal, ...], ...] = ()
    while True:
        seen = _look(job, now, effects, slope)
        labels = summed(seen.hidden) if labels is None else labels
        if fit.carried is not None:
            drift, advice = _held(job, now.fit, seen.found)
            break
        shown = [one for one in seen.found if one.matters and one.effect.possible(one.size)]
        if not shown:
            break
        best = shown[0]
        if _of_the_same(best, effects):
            drift = drift + np.outer(best.move, best.move)
            break
        freed = None
        if len(effects) < given + MOST_EFFECTS:
            best, freed, equal = _best_freed(job, fit, effects, shown)
        if freed is None:
            drift = drift + np.outer(best.move, best.move)
            advice.append(_left(best, shown))
            break
        rough = ROUGH & {effect.kind for effect in effects}
        share = 1.0 if rough else INEXACT.get(best.effect.kind, 0.0)
        change = share * (freed.fit.solution.x - now.fit.solution.x)
        drift = drift + np.outer(change, change)
        now, effects, ties = freed, (*effects, best.effect), (*ties, equal)
    weighed, told = other_weights(job, now.fit)
    others, apart = _others(now, effects, seen, slope)
    for told_of, equal in zip(others[given:], ties, strict=True):
        names = {effect.name for effect, _ in told_of}
        told_of += [(one.effect, one.size) for one in equal if one.effect.name not in names]
    # what stood equal to the last one, solved for; of those before, what is left of it was looked at above
    for one in ties[-1] if ties else ():
        apart = apart + np.outer(one.x - now.fit.solution.x, one.x - now.fit.solution.x) / len(ties[-1])
    found = [estimated(*one) for one in zip(effects, now.sizes, others, strict=True)]
    fit = replace(now.fit, notes=now.fit.notes + labels)
    return Explained(
        now.observation, fit, effects, now.sizes, drift + weighed + apart, (*found, *advice, *told)
    )


def _held(job: Job, fit: Fit, found: Sequence[Score]) -> tuple[FloatArray, list[Advice]]:
    """Return what effects move that cannot be estimated, as a mean square, and what is said of them.

    Effects that are nearly sums of the columns are left out: a step that large tells nothing where nothing is
    solved again. Where the model lacks more than noise adds, what explains most counts, certain or not.
    """
    apart = [one for one in found if one.own > LITTLE_OWN and one.effect.possible(one.size)]
    shown = [one for one in apart if one.matters]
    loud = bool(exceeding_noise(job.model, job.records, job.choice, fit, OVER_NOISE))
    held = dict.fromkeys([*shown[:1], *(apart[:1] if loud else ())])
    drift = sum((np.outer(one.move, one.move) for one in held), np.zeros((len(fit.columns),) * 2))
    return drift, [_left(one, shown) for one in shown[:1]]


def _of_the_same(score: Score, effects: Sequence[Effect]) -> bool:
    """Tell whether an effect is what is left of one that is estimated, whatever it looks like.

    What a reversal does has no form that is known, and other effects are simulated in first order.
    """
    kinds = {effect.kind for effect in effects}
    return DIRECTION in kinds or (bool(kinds & INEXACT.keys()) and score.explained < LITTLE_LEFT)


def found_by(job: Job, observation: Observation, fit: Fit) -> Freed:
    """Return a fit without effects as what `explained` starts from."""
    return Freed(observation, fit, _setting(job, fit))


def with_turns(job: Job, found: Explained) -> Explained:
    """Return a fit with its intervals widened by a late direction, if it must use samples near reversals."""
    fit = found.fit
    if fit.carried is not None or not any(block.turning for block in fit.blocks):
        return found
    now = found_by(job, found.observation, fit)
    shown = _look(job, now, (), slope_of(job.model, fit), (DIRECTION,)).found
    drift = sum((np.outer(one.move, one.move) for one in shown), found.drift)
    return replace(found, drift=drift, advice=(*found.advice, *(_left(one, ()) for one in shown)))


def other_weights(job: Job, fit: Fit) -> tuple[FloatArray, tuple[Advice, ...]]:
    """Return what other weights of rows and records move, where the model lacks something, and what is said.

    What a link lacks is left by both of its bodies' rows: weights across rows know that. Weights from
    residuals hide a row that the model does not explain; weights from the rows' own size do not.

    Returns
    -------
    array, shape (c, c)
        Mean square of the moves, and the covariance with the last weights.
    tuple of Advice
    """
    c = len(fit.columns)
    if fit.carried is not None or len(fit.blocks) < 2:
        return np.zeros((c, c)), ()
    exceeding = exceeding_noise(job.model, job.records, job.choice, fit, OVER_NOISE)
    if not exceeding:
        return np.zeros((c, c)), ()
    across = across_rows(fit)
    # what these weights hardly determine does not disagree
    known = np.diag(hac_covariance(across)) < DISAGREEMENT**2 * np.diag(hac_covariance(fit))
    move = np.where(known, across.solution.x - fit.solution.x, 0.0)
    drift = np.outer(move, move)
    left = [(block, share) for block, share in exceeding if share > LEFT_SHARE]
    if not left:
        return drift, ()
    sizes = [
        block.terms_norm(fit.solution.x) / float(np.sqrt(len(block.place))) or 1.0 for block in fit.blocks
    ]
    weighed = replace(fit, weights=tuple(1.0 / size for size in sizes))
    other = two_stage(weighed, fit.regressors)
    move = other.solution.x - fit.solution.x
    advice = Advice(
        "unexplained",
        ", ".join(f"{block.record_name}, row {block.row_name}" for block, _ in left),
        f"leaves up to {100.0 * max(share for _, share in left):.0f} % of its largest term, more than noise "
        "explains: dynamics that the model lacks (a further mass, a resonance, backlash); the intervals "
        "hold what these rows would move",
        "identify from each record alone and compare, or add what is missing to the spec",
    )
    return drift + np.outer(move, move) + hac_covariance(other), (advice,)


def _setting(job: Job, fit: Fit) -> Setting:
    delays = {channel: delay for channel, delay, _ in fit.delays}
    records = tuple(advanced(record, delays) for record in job.records)
    return job.setting(records)


@dataclass(frozen=True, eq=False)
class _Seen:
    """What a residual says: scores, effects that are nearly columns, and rows that grow with those tested."""

    found: tuple[Score, ...] = ()
    hidden: tuple[Effect, ...] = ()
    tested: tuple[Effect, ...] = ()
    rows: tuple[tuple[FloatArray, ...], ...] = ()


def _look(
    job: Job,
    now: Freed,
    known: Sequence[Effect],
    slope: FloatArray | None,
    kinds: Sequence[str] = (),
) -> _Seen:
    """Return what the residual says of effects that are not estimated, of `kinds` if any."""
    try:
        simulated = simulated_records(now.fit, now.setting)
    except IdentifiabilityError:
        return _Seen()
    every = effects_of(job.model, simulated[0].plant.bodies, len(job.records))
    if not any(block.turning for block in now.fit.blocks):
        every = tuple(one for one in every if one.kind != DIRECTION)
    tested = [one for one in unlike(every, known) if not kinds or one.kind in kinds]
    others = now.others or tuple(job.rates(now.fit, tuple(now.setting.records), channel)
                                 for channel, _, _ in now.fit.delays)  # fmt: skip
    rows = effect_rows(now.fit, now.setting, simulated, tested)
    found = scores(now.fit, tested, rows, others, slope)
    doubtful = [tested.index(one.effect) for one in found if one.matters]
    if doubtful:
        seen = [tested[index] for index in doubtful]
        noise = noise_rows(now.fit, now.setting, seen, [rows[index] for index in doubtful])
        found = without_noise(found, now.fit, seen, noise, others, slope)
    told = {one.effect.name for one in found if one.own > LITTLE_OWN}
    hidden = tuple(effect for effect in tested if effect.name not in told)
    return _Seen(found, hidden, tuple(tested), rows)


def _others(
    now: Freed, effects: Sequence[Effect], seen: _Seen, slope: FloatArray | None
) -> tuple[list[list[tuple[Effect, float]]], FloatArray]:
    """Return what could stand in the place of each effect that is estimated, and what that would move."""
    late = len(now.others) - len(effects)
    looked = Looked(now.others[:late], now.others[late:], seen.rows, slope)
    return other_explanations(now.fit, effects, now.sizes, now.stds, seen.tested, looked)


def _left(best: Score, shown: Sequence[Score]) -> Advice:
    """Return what is said of an effect that the intervals hold, and of others that explain nearly as much."""
    per_share = (best.size / best.std) ** 2 / best.explained
    others = [
        (one.effect, one.size)
        for one in shown
        if one is not best and per_share * (best.explained - one.explained) < AS_GOOD
    ]
    return left(best.effect, best.size, others)


@dataclass(frozen=True, eq=False)
class _Equal:
    """An effect that leaves as little as the one that is taken, with its size, and X with it estimated."""

    effect: Effect
    size: float
    x: FloatArray


def _best_freed(
    job: Job, fit: Fit, effects: tuple[Effect, ...], shown: Sequence[Score]
) -> tuple[Score, Freed | None, tuple[_Equal, ...]]:
    """Return the effect that leaves least once it is estimated, the fit with it, and its equals.

    Far from the truth the shares that effects explain are shares along a tangent only. Of equals the one that
    explains most there is taken.
    """
    tried = [one for one in shown if one.explained >= TRIED_TOO * shown[0].explained][:MOST_TRIED]
    known = {effect.name for effect in effects}
    forms = [
        replace(one, effect=effect)
        for one in tried
        for effect in (one.effect, *one.effect.forms)
        if effect.name not in known
    ]
    found = [(one, _freed(job, fit, (*effects, one.effect))) for one in forms]
    come_out = [(one, freed) for one, freed in found if freed is not None]
    if not come_out:
        return shown[0], None, ()
    # the misfit is half a chi square
    most = min(freed.fit.misfit for _, freed in come_out) + 0.5 * AS_GOOD
    (one, taken), *equal = [entry for entry in come_out if entry[1].fit.misfit < most]
    return one, taken, tuple(_Equal(e.effect, f.sizes[-1], f.fit.solution.x) for e, f in equal)


def _freed(job: Job, fit: Fit, effects: tuple[Effect, ...]) -> Freed | None:
    try:
        found = fit_with_effects(job.setting(), job.calm, fit, effects, (), job.sharpened)
    except IdentifiabilityError:
        return None
    possible = all(effect.possible(size) for effect, size in zip(effects, found.sizes, strict=True))
    return found if possible else None
