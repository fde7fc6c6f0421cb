"""What the residual of a fit with instruments says of the model, and the fit with that taken into account.

Effects that the residual shows (`score_tests`) are estimated together with the parameters, one at a time, the
one that explains most first. Where another effect explains the residual as well, or one is left that cannot
be estimated, the intervals are widened by what it would move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.identification.explained import Explained
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import (
    AS_GOOD,
    DISAGREEMENT,
    INEXACT,
    LEFT_SHARE,
    LITTLE_LEFT,
    LITTLE_OWN,
    MOST_EFFECTS,
    MOST_TRIED,
    OVER_NOISE,
    TRIED_TOO,
)
from modelgen.runtime.iv.effect import DIRECTION, Effect
from modelgen.runtime.iv.effect_rows import effect_rows, noise_rows, simulated_records
from modelgen.runtime.iv.freed_effects import Freed, fit_with_effects
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.iv.score_tests import Score, scores, without_noise
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.unrelated_regressions import across_rows
from modelgen.runtime.rows.observation import Observation

# What is done about an effect, in words.
ESTIMATED = "; that is estimated with the parameters"
HELD = "; the intervals hold what that moves"
# Effects whose sum with what the spec names is told where sensors cannot tell them apart.
SUMMED = ("Coulomb friction", "viscous friction")


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
    slope = _slope(job, fit)
    sums: tuple[str, ...] | None = None
    while True:
        found, unseen = _scores(job, now, effects, slope)
        sums = _sums(unseen) if sums is None else sums
        if fit.carried is not None:
            drift, advice = _held(job, now.fit, found)
            break
        shown = [one for one in found if one.matters and one.effect.possible(one.size)]
        if not shown:
            break
        best = shown[0]
        if _of_the_same(best, effects):
            drift = drift + np.outer(best.move, best.move)
            break
        freed = None
        if len(effects) < given + MOST_EFFECTS:
            best, freed = _best_freed(job, fit, effects, shown)
        others = _as_good(best, shown)
        if freed is None:
            drift = drift + np.outer(best.move, best.move)
            advice.append(_left(best, others))
            break
        for other in others:
            apart = other.move - best.move
            drift = drift + np.outer(apart, apart) / len(others)
        change = INEXACT.get(best.effect.kind, 0.0) * (freed.fit.solution.x - now.fit.solution.x)
        drift = drift + np.outer(change, change)
        now, effects = freed, (*effects, best.effect)
        advice.append(estimated(best.effect, freed.sizes[-1], others))
    weighed, told = other_weights(job, now.fit)
    fit = replace(now.fit, notes=now.fit.notes + sums)
    return Explained(now.observation, fit, effects, now.sizes, drift + weighed, (*advice, *told))


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
    return drift, [_left(one, _as_good(one, shown)) for one in shown[:1]]


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
    shown, _ = _scores(job, now, (), _slope(job, fit), (DIRECTION,))
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


def _slope(job: Job, fit: Fit) -> FloatArray | None:
    """Return how the columns grow with the physical parameters, where those were fitted in their place."""
    values = fit.physical(job.model.parameters)
    if values is None:
        return None
    places = [job.model.base_parameters.index(name) for name in fit.columns]
    return job.model.base_jacobian(values)[places]


def _scores(
    job: Job,
    now: Freed,
    estimated: Sequence[Effect],
    slope: FloatArray | None,
    kinds: Sequence[str] = (),
) -> tuple[tuple[Score, ...], tuple[Effect, ...]]:
    """Return the scores of effects not estimated, of `kinds` if any, and those that are nearly columns."""
    try:
        simulated = simulated_records(now.fit, now.setting)
    except IdentifiabilityError:
        return (), ()
    known = {effect.name for effect in estimated}
    every = effects_of(job.model, simulated[0].plant.bodies, len(job.records))
    if not any(block.turning for block in now.fit.blocks):
        every = tuple(one for one in every if one.kind != DIRECTION)
    tested = [one for one in every if one.name not in known and (not kinds or one.kind in kinds)]
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
    return found, tuple(effect for effect in tested if effect.name not in told)


def _sums(unseen: Sequence[Effect]) -> tuple[str, ...]:
    """Return the note that labels friction of several bodies that these sensors see as a sum."""
    names = [effect.name for effect in unseen if effect.name.startswith(SUMMED)]
    if not names:
        return ()
    return (
        f"{' and '.join(names)}, which the spec does not name, can hardly be told from the friction that it "
        "names with these sensors: if there is any, the value is the sum of all bodies' friction",
    )


def _as_good(best: Score, shown: Sequence[Score]) -> list[Score]:
    """Return the other effects that explain the residual nearly as well."""
    per_share = (best.size / best.std) ** 2 / best.explained
    return [
        one for one in shown if one is not best and per_share * (best.explained - one.explained) < AS_GOOD
    ]


def _best_freed(
    job: Job, fit: Fit, effects: tuple[Effect, ...], shown: Sequence[Score]
) -> tuple[Score, Freed | None]:
    """Return the effect that leaves least once it is estimated, and the fit with it.

    Far from the truth the shares that effects explain are shares along a tangent only.
    """
    tried = [one for one in shown if one.explained >= TRIED_TOO * shown[0].explained][:MOST_TRIED]
    found = [(one, _freed(job, fit, (*effects, one.effect))) for one in tried]
    left = [(freed.fit.misfit, one, freed) for one, freed in found if freed is not None]
    if not left:
        return shown[0], None
    _, one, freed = min(left, key=lambda entry: entry[0])
    return one, freed


def _freed(job: Job, fit: Fit, effects: tuple[Effect, ...]) -> Freed | None:
    try:
        found = fit_with_effects(job.setting(), job.calm, fit, effects)
    except IdentifiabilityError:
        return None
    possible = all(effect.possible(size) for effect, size in zip(effects, found.sizes, strict=True))
    return found if possible else None


def estimated(effect: Effect, size: float, others: Sequence[Score]) -> Advice:
    """Return what is said of an effect that is estimated; `others` explain the residual nearly as well."""
    return Advice(
        "more than the model",
        "the residual",
        f"shows that {effect.said(size)}{ESTIMATED}{_or(others)}",
        effect.remedy,
    )


def _left(best: Score, others: Sequence[Score]) -> Advice:
    return Advice(
        "more than the model",
        "the residual",
        f"shows that {best.effect.said(best.size)}{HELD}{_or(others)}",
        best.effect.remedy,
    )


def _or(others: Sequence[Score]) -> str:
    if not others:
        return ""
    listed = "; or ".join(one.effect.said(one.size) for one in others[:3])
    return f" (or {listed}: the intervals hold for either)"
