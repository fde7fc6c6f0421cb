"""A fit in which effects that the model lacks are estimated as well, and delays of forces."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.divergence import diverged, refuse_few, refuse_runaway
from modelgen.runtime.iv.effect import RIPPLE, Effect
from modelgen.runtime.iv.effect_rows import effect_rows, simulated_records
from modelgen.runtime.iv.instrumental_variables import Setting, instruments, weighed
from modelgen.runtime.iv.low_pass import without_starts
from modelgen.runtime.iv.model_errors import zero_effect
from modelgen.runtime.iv.thresholds import (
    EFFECT_CHANGE,
    EFFECT_MOVE,
    EFFECT_ROUNDS,
    KNOWN_ROUNDS,
    LOOSER,
    PATIENT_ROUNDS,
    SHORTER,
)
from modelgen.runtime.least_squares.delays import advanced, delay_rates, steps_of
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.further_columns import with_columns, without_columns
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.thresholds import SMALLEST_STEP
from modelgen.runtime.least_squares.wls import fit_at
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.masks import feels_turns
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.thresholds import LEAST_SHARE

Rows = Callable[[tuple[Record, ...]], Observation]
Grown = tuple[Sequence[FloatArray], ...]


@dataclass(frozen=True, eq=False)
class Freed:
    """Rows and their fit with effects estimated: Y lacks what they add, their columns are projected out.

    Attributes
    ----------
    setting : Setting
        With the records' delays compensated.
    sizes, stds : tuple of float
        Of the effects.
    others : tuple of tuple of array
        How Y - W X grows with delays and effects, one array a block each.
    at : tuple of float
        The sizes that the records of `setting` are set right for: the last step to `sizes` is in the rows.
    """

    observation: Observation
    fit: Fit
    setting: Setting
    sizes: tuple[float, ...] = ()
    stds: tuple[float, ...] = ()
    others: Grown = ()
    at: tuple[float, ...] = ()

    @property
    def late_forces(self) -> dict[str, float]:
        """By how many s forces are recorded late, where that was estimated with the fit and is known."""
        return {channel: late for channel, late, _ in self.fit.delays if channel not in self.fit.unknown}

    @property
    def certainty(self) -> float:
        """How many standard deviations the last effect's size is."""
        return abs(self.sizes[-1]) / max(self.stds[-1], float(np.finfo(float).tiny))


def fit_with_effects(
    setting: Setting,
    rows: Rows,
    start: Fit,
    effects: Sequence[Effect],
    known: Sequence[float] = (),
    finish: Callable[[Fit], Fit] | None = None,
    rounds: int | None = None,
) -> Freed:
    """Estimate parameters, delays and effects together, from a fit without the effects.

    Parameters
    ----------
    setting : Setting
        `records` as measured.
    rows : callable
        Takes records to their rows.
    start : Fit
        Its delays are those to be estimated on.
    effects : sequence of Effect
    known : sequence of float
        Sizes of the first effects at other settings, to start from. Of friction that is known to be missing
        rows use no samples about reversals.
    finish : callable, optional
        What is done to the fit with further columns once it has come to rest.
    rounds : int, optional
        At most so many; by default fewer where all sizes are known, as those at other settings are.

    Raises
    ------
    IdentifiabilityError
        When the rounds do not come to rest, or samples are too few for them.
    """
    delays = {channel: delay for channel, delay, _ in start.delays}
    refuse_few(start, len(delays) + len(effects), setting.model)
    sample = 1.0 / min(record.fs for record in setting.records)
    c, now, sizes = len(start.columns), start, np.r_[known, np.zeros(len(effects) - len(known))]
    length, before = 1.0, np.zeros(c + len(delays) + len(effects))
    edited = np.array([effect.edit is not None for effect in effects])
    turned = _turned(rows, start, setting, effects, sizes.tolist())
    for done in range(rounds or (KNOWN_ROUNDS if len(known) == len(effects) else EFFECT_ROUNDS)):
        here = replace(setting, records=corrected(setting.records, delays, effects, sizes.tolist()))
        observation = _calm(rows(tuple(here.records)), turned)
        plain = fit_at(observation, now)
        if plain.columns != start.columns:
            raise diverged("its columns change", now, setting.model)
        simulated = simulated_records(plain, here, effects, sizes.tolist())
        Z = instruments(plain, here, {index: one.record for index, one in enumerate(simulated)})
        grown = effect_rows(plain, here, simulated, effects, sizes.tolist())
        quiet = quiet_rows(plain, here, simulated, effects, grown)
        late = _late_rows(plain, here, delays)
        # what is set right in the records leaves only the step to its size in the rows
        left = np.where(edited, 0.0, sizes)
        larger = _with_columns(plain, Z, ((*late, *grown), (*late, *quiet)), left, len(late))
        x, steps = larger.solution.x[:c], larger.solution.x[c:]
        if not np.all(np.isfinite(steps)):
            raise diverged("its estimate is not finite", plain, setting.model)
        refuse_runaway(plain.columns, x, plain, setting.model)
        spread = np.sqrt(np.maximum(np.diag(hac_covariance(larger, grown=False)), 0.0))
        moves = np.r_[x - plain.solution.x, steps[: len(late)], steps[len(late) :] - left]
        size = np.r_[np.abs(x), np.full(len(late), SMALLEST_STEP * sample / EFFECT_CHANGE), np.abs(sizes)]
        small = np.maximum(EFFECT_MOVE * spread, EFFECT_CHANGE * size)
        # what has no size and is exactly known does not move
        relative = moves / np.maximum(small, np.finfo(float).tiny)
        # after many rounds a third of a standard deviation is rest enough
        if np.all(np.abs(relative) < (1.0 if done < PATIENT_ROUNDS else LOOSER)):
            last = larger if finish is None else finish(larger)
            more = (last.solution.x - larger.solution.x)[c:]
            fit, stds = _alone(last, plain, (*late, *grown), delays, more)
            fit, there = replace(fit, notes=start.notes), tuple((sizes + more[len(late) :]).tolist())
            return Freed(observation, fit, here, there, stds, (*late, *grown), tuple(sizes.tolist()))
        # what goes to and fro comes to rest with shorter steps
        length = SHORTER * length if float(relative @ before) < 0.0 else min(1.0, length / SHORTER)
        before = relative
        now = replace(plain, solution=replace(plain.solution, x=plain.solution.x + length * moves[:c]))
        sizes = sizes + length * (moves[c + len(late) :])
        refuse_far(zip(effects, sizes.tolist(), strict=True), 1.0 / sample, plain, setting.model)
        for channel, step in zip(delays, steps[: len(late)], strict=True):
            delays[channel] += length * float(np.clip(step, -sample, sample))
    raise diverged(
        f"with {', '.join(effect.name for effect in effects)} it does not come to rest", now, setting.model
    )


def _turned(
    rows: Rows, start: Fit, setting: Setting, effects: Sequence[Effect], sizes: Sequence[float]
) -> dict[tuple[int, int], BoolArray]:
    """Return which points of the grid feel reversals where missing friction is known, by record and row."""
    turning = [one for one, size in zip(effects, sizes, strict=True) if size and one.turns]
    found: dict[tuple[int, int], BoolArray] = {}
    if not turning:
        return found
    delays = {channel: delay for channel, delay, _ in start.delays}
    here = replace(setting, records=corrected(setting.records, delays, effects, sizes))
    plain, model, choice = fit_at(rows(tuple(here.records)), start), setting.model, setting.choice
    simulated = simulated_records(plain, here)
    for effect, grown in zip(turning, effect_rows(plain, here, simulated, turning), strict=True):
        for block, own in zip(plain.blocks, grown, strict=True):
            if np.any(own):
                speed, fs = simulated[block.record].led[effect.turns].speed, setting.records[block.record].fs
                felt = feels_turns(speed, model, block.row, choice, fs)
                felt = felt[block.start :: choice.decimation[block.record]][: block.grid]
                key = (block.record, block.row)
                found[key] = felt | found.get(key, np.zeros_like(felt))
    return found


def _calm(observation: Observation, turned: Mapping[tuple[int, int], BoolArray]) -> Observation:
    """Return rows without samples that are marked; a row of which little would be left keeps all."""
    if not turned:
        return observation
    blocks = list(observation.blocks)
    for place, block in enumerate(blocks):
        marked = turned.get((block.record, block.row))
        calm = block if marked is None else block.without(marked)
        if calm.count >= LEAST_SHARE * block.grid:
            blocks[place] = calm
    return replace(observation, blocks=tuple(blocks))


def refuse_far(sized: Iterable[tuple[Effect, float]], fs: float, plain: Fit, model: Model) -> None:
    """Raise where an effect has a size that no record can have, at `fs` in Hz."""
    far = [effect.name for effect, size in sized if effect.runs_away(size, fs)]
    if far:
        raise diverged(f"{', '.join(far)} runs away", plain, model)


def corrected(
    records: Sequence[Record],
    delays: Mapping[str, float],
    effects: Iterable[Effect],
    sizes: Iterable[float],
) -> tuple[Record, ...]:
    """Return the records with delays compensated, and what effects can be set right in their channels."""
    found = []
    for index, record in enumerate(records):
        record = advanced(record, delays)
        for effect, size in zip(effects, sizes, strict=True):
            record = effect.corrected(record, index, size)
        found.append(record)
    return tuple(found)


def on_other_records(
    sized: Mapping[Effect, float], records: tuple[Record, ...], tails: bool
) -> tuple[tuple[Record, ...], tuple[Effect, ...], tuple[float, ...]]:
    """Return records that effects with their sizes were not found on, effects of these, and the known sizes.

    Effects are as they are, but zeros of sensors, phases and what a high-pass begins with are those of the
    records. Where these are the `tails` of the records fitted, in their order, zeros are the same and are set
    right.
    """
    count = len(records)
    waves = [wave for one in sized for wave in one.elsewhere(count)]
    sized = {without_starts(one, size): size for one, size in sized.items() if one.kind != RIPPLE}
    kept = {one: size for one, size in sized.items() if one.record is None}
    own = {one: size for one, size in sized.items() if one.record is not None}
    if tails:
        records = corrected(records, {}, own.keys(), own.values())
    keys = () if tails else dict.fromkeys(one.channel for one in own)
    zeros = [zero_effect(key, index, count) for key in keys for index in range(count)]
    return records, (*kept, *zeros, *waves), tuple(kept.values())


def _late_rows(fit: Fit, setting: Setting, delays: Mapping[str, float]) -> Grown:
    return tuple(
        delay_rates(fit, setting.model, setting.records, setting.choice, setting.drop, channel)
        for channel in delays
    )


def quiet_rows(
    fit: Fit, setting: Setting, simulated: Sequence[Simulated], effects: Sequence[Effect], grown: Grown
) -> Grown:
    """Return the instruments of effects: what they do to the rows without noise of the sensors."""
    ways = {place: effect.quiet for place, effect in enumerate(effects)}
    quiet = {place: replace(effects[place], changes=way) for place, way in ways.items() if way is not None}
    found = dict(zip(quiet, effect_rows(fit, setting, simulated, tuple(quiet.values())), strict=True))
    return tuple(found.get(place, rows) for place, rows in enumerate(grown))


def _with_columns(
    plain: Fit, Z: Sequence[FloatArray], grown: tuple[Grown, Grown], sizes: FloatArray, late: int
) -> Fit:
    """Return the fit with a column for each delay's step and each effect's size, and their instruments."""
    # a late force is set right by its step; an effect stays in the rows
    extra, further = ([*(steps_of(rates) for rates in one[:late]), *one[late:]] for one in grown)
    more = _added(plain, grown[0][late:], sizes)
    residuals = tuple(residual - own for residual, own in zip(plain.residuals, more, strict=True))
    return with_columns(weighed(replace(plain, residuals=residuals)), Z, extra, further)


def _alone(
    larger: Fit, plain: Fit, grown: Grown, delays: Mapping[str, float], moves: FloatArray
) -> tuple[Fit, tuple[float, ...]]:
    """Return the fit to the columns alone, `delays` moved, and the standard deviations of the effects."""
    c, late = len(plain.columns), len(delays)
    spread = np.sqrt(np.maximum(np.diag(hac_covariance(larger, grown=False)), 0.0))[c:].tolist()
    moved = [delay + move for delay, move in zip(delays.values(), moves.tolist(), strict=False)]
    found = tuple(zip(delays, moved, spread, strict=False))
    fit = _without(larger, plain, grown, larger.solution.x[c + late :])
    return replace(fit, delays=found), tuple(spread[late:])


def _without(larger: Fit, plain: Fit, grown: Grown, sizes: FloatArray) -> Fit:
    """Return the fit to the columns alone: effects subtracted from Y, further columns projected out."""
    return without_columns(larger, less_effects(plain, grown[len(grown) - len(sizes) :], sizes))


def less_effects(plain: Fit, effects: Grown, sizes: FloatArray) -> Fit:
    """Return a fit whose Y, in units of rows, lacks what effects of these sizes, shape (effects,), add."""
    parts = zip(plain.blocks, _added(plain, effects, sizes), strict=True)
    return replace(plain, blocks=tuple(replace(block.kept(), Y=block.Y - more) for block, more in parts))


def _added(plain: Fit, effects: Grown, sizes: FloatArray) -> list[FloatArray]:
    """Return what effects of these sizes add to each block, shape (n,)."""
    found = [np.zeros(block.count) for block in plain.blocks]
    for parts, size in zip(effects, sizes.tolist(), strict=True):
        found = [more + size * part for more, part in zip(found, parts, strict=True)]
    return found
