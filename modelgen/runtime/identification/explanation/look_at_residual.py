"""What the residual of a fit with instruments shows of effects that are not estimated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.identification.explanation.folded_forces import (
    MovedByUnsized,
    moved_by_unsized,
    unsized_effects,
    white_moves,
)
from modelgen.runtime.identification.explanation.hidden_friction import moved_by_hidden_friction
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import MOST_TRIED, OVER_NOISE, SUSPECTED
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import DIRECTION, Effect, unlike
from modelgen.runtime.iv.effect_rows import effect_rows, simulated_records
from modelgen.runtime.iv.freed_effects import Freed
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.iv.noise_on_rows import NoiseRows, noise_rows, rounded_rows
from modelgen.runtime.iv.score_tests import Score, Span, scores, stacked
from modelgen.runtime.iv.shapes.creep import creep_effects, creeping_links
from modelgen.runtime.iv.shapes.mass_search import further_masses
from modelgen.runtime.iv.shapes.ripple_search import ripples
from modelgen.runtime.iv.shapes.shape_search import ShapeRows
from modelgen.runtime.iv.thresholds import EXACTNESS, LEVEL, LITTLE_OWN, ROUNDED_AT
from modelgen.runtime.iv.told_effects import within_rounding
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.numerics.few_instants import USUAL
from modelgen.runtime.numerics.tails import normal_beyond


@dataclass(frozen=True, eq=False)
class Seen:
    """What a residual says: scores, effects that are nearly columns, and rows that grow with those tested.

    Sizes that no channel can have do not matter, and stand in for nothing.
    `shapes` are further masses, creep and ripples with which least squares leave clearly less, where it is
    more than noise.
    `rounded` names those, estimated or not, that encoders are too coarse for.
    `folded` is what forces that bend between samples, lags in place of delays and hidden friction move, as a
    mean square, shape (c, c); `unsized` has the channels for which that is told.
    """

    found: tuple[Score, ...] = ()
    hidden: tuple[Effect, ...] = ()
    tested: tuple[Effect, ...] = ()
    rows: tuple[Sequence[FloatArray], ...] = ()
    shapes: tuple[Effect, ...] = ()
    folded: FloatArray | None = None
    rounded: frozenset[str] = frozenset()
    unsized: MovedByUnsized | None = None


def look(
    job: Job,
    now: Freed,
    known: Sequence[Effect],
    slope: FloatArray | None,
    kinds: Sequence[str] = (),
    shapes_too: bool = False,
) -> Seen:
    """Return what the residual says of effects that are not estimated, of `kinds` if any.

    `slope` says how X grows with the parameters that were fitted in its place, in SI, shape (c, p).
    Further masses and ripples are searched for where shapes are asked for, and a row leaves far more than
    noise.
    """
    try:
        simulated = simulated_records(now.fit, now.setting, known, now.sizes)
    except IdentifiabilityError:
        return Seen()
    # where every sample feels a reversal, a delay of a force is estimated only where the residual shows it
    known_late = [channel for channel, _, _ in now.fit.delays]
    late = [channel for channel in job.late if channel not in known_late]
    every = effects_of(job.model, simulated[0].plant.bodies, job.records, late, now.fit.turning)
    if not job.model.cubic_springs:
        every = (*every, *creep_effects(job.model, job.records, now.setting.choice))
    tested = [one for one in unlike(every, known) if not kinds or one.kind in kinds]
    others = now.others or tuple(job.rates(now.fit, tuple(now.setting.records), channel)
                                 for channel, _, _ in now.fit.delays)  # fmt: skip
    unsized = unsized_effects(job, now, known)
    grown = effect_rows(now.fit, now.setting, simulated, (*tested, *unsized.every))
    rows, folds = grown[: len(tested)], grown[len(tested) :]
    span = Span(now.fit, others, slope, white_moves(job, now.fit, slope))
    found = _one_a_name(scores(span, tested, rows))
    best = {one.effect.name: one.effect for one in found}
    shapes: tuple[Effect, ...] = ()
    if shapes_too and not job.model.cubic_springs and _unexplained(job, now):
        shaped, names = ShapeRows(now.fit, now.setting, simulated, others), {effect.name for effect in known}
        shapes = ripples(shaped, names, [one.effect for one in found if one.matters][:MOST_TRIED])
        # steps in physical parameters take a size along and no shape: a mass is far off without it
        if now.fit.carried is None:
            shapes = (*further_masses(shaped, names), *creeping_links(shaped, names), *shapes)
    doubtful = [tested.index(one.effect) for one in found if one.matters]
    if doubtful:
        seen = [tested[index] for index in doubtful]
        shown = [rows[index] for index in doubtful]
        noise = noise_rows(now.fit, now.setting, simulated, seen, shown, known, now.sizes)
        found = _without_noise(found, span, dict(zip(seen, shown, strict=True)), noise)
    found = _beyond_rounding(found, span, (tested, rows), now, simulated)
    forces = now.late_forces
    beyond = {one.effect.name for one in found if not believable(job, one.effect, one.size, forces)}
    found = tuple(
        replace(one, matters=False, likely=False) if one.effect.name in beyond else one for one in found
    )
    sized = [*zip(known, now.sizes, strict=True), *((one.effect, one.size) for one in found if one.matters)]
    rounded = frozenset(effect.name for effect, size in sized if within_rounding(effect, size, simulated))
    told = {one.effect.name for one in found if one.own > LITTLE_OWN}
    hidden = {effect: row for effect, row in zip(tested, rows, strict=True) if effect.name not in told}
    open_sizes = moved_by_unsized(span, unsized, folds)
    folded = open_sizes.square + moved_by_hidden_friction(job.model, span, simulated, known, hidden)
    kept = [best.get(effect.name, effect) is effect and effect.name not in beyond for effect in tested]
    left = [entry for entry, stays in zip(zip(tested, rows, strict=True), kept, strict=True) if stays]
    apart, told_by = tuple(one for one, _ in left), tuple(row for _, row in left)
    return Seen(found, tuple(hidden), apart, told_by, shapes, folded, rounded, open_sizes)


def _beyond_rounding(
    found: Sequence[Score],
    span: Span,
    tested: tuple[Sequence[Effect], Sequence[Sequence[FloatArray]]],
    now: Freed,
    simulated: Sequence[Simulated],
) -> tuple[Score, ...]:
    """Return the scores, which matter where rounding of the encoders is not why.

    Where encoders are in their steps is not known: sizes scatter by what that changes. `tested` are the
    effects and what each adds to the residual, in SI, (rows,) a block.
    """
    effects, grown = tested
    critical = normal_beyond(0.5 * LEVEL / max(len(found), 1))
    phases = np.linspace(0.0, 1.0, ROUNDED_AT, endpoint=False).tolist()
    left, changed = list[FloatArray](), list[Score]()
    for one in found:
        if (one.matters or one.likely) and within_rounding(one.effect, one.size, simulated):
            left = left or [
                span.apart(stacked(span.fit, rows))
                for rows in rounded_rows(now.fit, now.setting, simulated, phases)
            ]
            own = stacked(span.fit, grown[effects.index(one.effect)])
            spread = float(np.sqrt(np.mean([float(own @ r) ** 2 for r in left]))) / one.power
            wider, size = float(np.hypot(1.0, spread / one.std)), abs(one.size)
            likely = one.likely and size > critical * wider * one.std
            matters = one.matters and size > wider * one.least
            one = replace(one, least=wider * one.least, matters=matters, likely=likely)
        changed.append(one)
    return tuple(changed)


def _without_noise(
    found: Sequence[Score], span: Span, effects: Mapping[Effect, Sequence[FloatArray]], noise: NoiseRows
) -> tuple[Score, ...]:
    """Return the scores without what noise of the forces makes of them, the most explained first.

    What is regressed on instruments has less of their noise: nearly a column, an effect has none of its own.

    Parameters
    ----------
    span : Span
    effects : mapping of Effect to sequence of array
        Those that matter, and what they do to the rows, as from `effect_rows`.
    noise : NoiseRows
    """
    fit = span.fit
    r, shift = span.apart(stacked(fit, noise.residual)), {}
    shares = span.compared([*effects.values()], span.left).share
    shares = np.zeros((len(fit.columns), len(effects))) if span.made is None else span.made @ shares
    for effect, change, share in zip(effects, noise.effects, shares.T, strict=True):
        blocks = zip(change, noise.instruments, map(fit.touched, range(len(change))), strict=True)
        shift[effect.name] = float(stacked(fit, [own - Z @ share[places] for own, Z, places in blocks]) @ r)
    changed = []
    for one in found:
        if one.effect.name in shift:
            share = 1.0 - shift[one.effect.name] / (one.power * one.size)
            matters = one.matters and share > 0.0 and abs(share * one.size) > one.least
            one = replace(
                one,
                size=share * one.size,
                explained=share**2 * one.explained,
                move=share * one.move,
                matters=matters,
                likely=matters,
            )
        changed.append(one)
    return tuple(sorted(changed, key=lambda one: -one.explained))


def _one_a_name(found: Sequence[Score]) -> tuple[Score, ...]:
    """Return the first score of each name: an effect may be tested at several settings."""
    names = [one.effect.name for one in found]
    return tuple(one for place, one in enumerate(found) if one.effect.name not in names[:place])


def likely_of(found: Sequence[Score]) -> list[Score]:
    """Return the effects that are likely, and are told from the columns: the intervals hold one unsaid.

    A parameter that varies is likely where that explains much, certain or not: along a tangent that is far
    from the truth a large change is none.
    """
    large = [bool(one.effect.varies) and one.explained > SUSPECTED for one in found]
    return [
        one
        for one, much in zip(found, large, strict=True)
        if (one.likely or (much and abs(one.size) > USUAL * one.std))
        and one.own > LITTLE_OWN
        and one.effect.possible(one.size)
    ]


def believable(job: Job, effect: Effect, size: float, late: Mapping[str, float]) -> bool:
    """Tell whether an effect has a size that its channel can have; `late` says by how many s forces are.

    A low-pass moves the zeros of a velocity by less than half a period of its cut-off.
    """
    if effect.kind == DIRECTION and 2.0 * abs(size) * job.choice.direction_cutoff_hz > 1.0:
        return False
    fs = min(record.fs for record in job.records)
    return not effect.runs_away(size, fs) and effect.follows(size, late, fs)


def _unexplained(job: Job, now: Freed) -> bool:
    """Tell whether a row leaves far more than noise, and than rows are exact to."""
    return bool(exceeding_noise(job.model, job.records, job.choice, now.fit, OVER_NOISE, EXACTNESS))


def moves_of_forms(
    before: Fit, effect: Effect, freed: Freed, others: Sequence[tuple[Effect, Freed]]
) -> FloatArray:
    """Return from an effect that was taken what other forms of it move X by, in SI, shape (moves, c).

    A link that bends by another form than all that are known leaves more than noise: then X may be anywhere
    between none of them and each.

    Parameters
    ----------
    before : Fit
        Without the effect.
    others : sequence of (Effect, Freed)
        What was tried in its place.
    """
    found = freed.fit.solution.x
    if effect.kind != "form" or not effect.forms:
        return np.zeros((0, len(found)))
    names = {one.name for one in effect.forms}
    away = [other.fit.solution.x - found for one, other in others if one.name in names]
    return np.array([found - before.solution.x, *away])


def varied(job: Job, fit: Fit, effect: Effect, size: float) -> FloatArray:
    """Return what parameters vary by that are no one number then, as a mean square in SI, shape (c, c)."""
    ways = list[FloatArray]()
    if not effect.varies:
        return np.zeros((len(fit.solution.x),) * 2)
    values = simulation_parameters(job.model, fit)
    places = [job.model.base_parameters.index(name) for name in fit.columns]
    slopes = job.model.base_jacobian(values)[places]
    for name, rms in effect.varies:
        if name not in job.model.parameters:
            continue  # its value was given
        by = size * rms * slopes[:, job.model.parameters.index(name)]
        ways.append(by * values[name] if effect.relative else by)
    ways = [np.sum(ways, axis=0)] if effect.relative else ways
    return np.asarray(sum(np.outer(by, by) for by in ways))
