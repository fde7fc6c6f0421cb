"""Gauss-Newton steps with instruments in physical parameters and delays, until they stand still.

Rows are linearised at the present estimate p,

    Y - W b(p) = W J (p' - p),    J = db/dp,

made white (`whitening`), and solved with the instruments Z J of a simulation at p (`gauss_newton_step`).
Delays of forces are further unknowns, see `delays`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.iv.divergence import diverged
from modelgen.runtime.iv.freed_effects import refuse_far
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.physical.course_of_steps import MORE, Course, is_solid
from modelgen.runtime.iv.physical.friction_rows import adds_friction
from modelgen.runtime.iv.physical.gauss_newton_step import (
    Rules,
    Unknowns,
    in_base_columns,
    possible_solution,
    step_from,
)
from modelgen.runtime.iv.physical.starting_values import refuse_emptied, vanished_names
from modelgen.runtime.iv.thresholds import (
    COMPOSITE_MOVE,
    COMPOSITE_ROUNDS,
    CREEPING_ROUNDS,
    FARTHEST,
    HOPELESS,
    LATER_MOVE,
    MANY_TIMES,
    NEARLY,
    ROUGH_ROUNDS,
    SMALL_CHANGE,
    STILL_ROUNDS,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.thresholds import SMALLEST_STEP
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.anderson import AndersonSteps
from modelgen.runtime.numerics.cycles import Passed
from modelgen.runtime.parameters.bounds import bounded_names
from modelgen.runtime.parameters.thresholds import BEYOND_CHANCE
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation

# records -> rows without the samples that a consistent estimate must not use
Rows = Callable[[tuple[Record, ...]], Observation]

PLAIN = Rules()


@dataclass(frozen=True, eq=False)
class Found:
    """Rows, their fit in base columns, and the physical parameters p it was made at, shape (parameters,).

    `following` is where the next step would go. `lost` names the inertias, stiffnesses and delays of which
    nothing is known there: an iteration that comes to rest so has only run out of slope, and what goes with
    them gets no number (`CarriedOver.unknown`) unless another start leads elsewhere. `below` is by how many
    standard deviations at most a parameter is negative that cannot be.
    """

    observation: Observation
    fit: Fit
    p: FloatArray
    following: FloatArray
    lost: tuple[str, ...] = ()
    below: float = 0.0

    @property
    def likely(self) -> bool:
        """Whether this may be the chain of the records: all of it is known, and nothing is impossible."""
        return not self.lost and self.below < BEYOND_CHANCE

    def values(self, model: Model) -> dict[str, float]:
        """Return the physical parameters by name."""
        return dict(zip(model.parameters, self.p.tolist(), strict=True))

    def leaves_bounds(self, model: Model) -> bool:
        """Tell whether what is never negative is, at p or after the next step."""
        places = [model.parameters.index(name) for name in bounded_names(model)]
        return bool(np.any(np.minimum(self.p, self.following)[places] < 0.0))


def fit_physical_iv(
    setting: Setting,
    rows: Rows,
    delays: Mapping[str, float],
    start: Mapping[str, float],
    rules: Rules = PLAIN,
    settled: bool = False,
) -> Found:
    """Estimate physical parameters and delays together, from a start (SI).

    Parameters
    ----------
    setting : Setting
        `records` as measured.
    rows : callable
        Takes records to their rows.
    delays : mapping of str to float
        Forces whose delay is estimated as well, to the delay in s to begin with.
    start : mapping of str to float
        All of the model's parameters.
    rules : Rules
        Robust weights, bounds, and what is held at zero.
    settled : bool
        Whether the start is an estimate already.

    Returns
    -------
    Found
        In base columns; delays compensated.

    Raises
    ------
    IdentifiabilityError
        When the steps do not come to rest.
    """
    model = setting.model
    sample = 1.0 / min(record.fs for record in setting.records)
    first = _allowed(model, start, rules)
    now, late = Unknowns(first, delays, setting.sizes), len(delays)
    c, steps, passed = len(model.parameters), AndersonSteps(), Passed()
    observation = rows(now.records(setting))
    plain = fit_matched(observation)
    if plain.absent:
        raise diverged(f"the records do not move what {', '.join(plain.absent)} needs", plain, model)
    # where directions of motion follow the estimate, white rows would hide what a wrong one leaves
    near = settled or not adds_friction(plain, setting)
    course = Course(model, first, rules, sample)
    for done in range(1, CREEPING_ROUNDS + 1):
        if (late or now.sizes) and done > 1:
            observation = rows(now.records(setting))
            plain = replace(plain, blocks=tuple(block for block in observation.blocks if block.place.size))
        try:
            step = step_from(setting, plain, now, rules, near)
        except IdentifiabilityError as error:
            course.refuse_led_away(now, MANY_TIMES)
            raise error
        if (instead := course.instead(step)) is not None:
            now = instead
            continue
        x, spread = possible_solution(step, model, now.p), step.spread
        move = np.r_[x[:c] - now.p, x[c:]]
        if not np.all(np.isfinite(move)):
            raise diverged("its estimate is not finite", plain, model)
        size = np.r_[
            np.abs(x[:c]), np.full(late, SMALLEST_STEP * sample / SMALL_CHANGE), np.zeros_like(now.sizes)
        ]
        still = COMPOSITE_MOVE if done <= STILL_ROUNDS else LATER_MOVE
        small = np.maximum(still * spread, SMALL_CHANGE * size)
        hopeless = spread > HOPELESS * np.r_[np.abs(x[:c]), np.full(late + len(now.sizes), np.inf)]
        if near and done > 1 and np.all((np.abs(move) <= small) | hopeless):
            lost, fit = _lost(setting, now, step.uncertainty[: c + late]), in_base_columns(step, now, done)
            refuse_emptied(model, first, now.p, lost, plain)
            if late and fit.carried is not None:
                fit = replace(fit, carried=replace(fit.carried, unknown=lost))
            return Found(observation, fit, now.p, x[:c], lost, _below_zero(model, x[:c], spread[:c]))
        nearly = bool(np.all((np.abs(move) <= NEARLY * spread) | hopeless))
        # where directions of motion jump, steps may go round for ever
        round_again = near and passed.again(now.vector, spread) and done > STILL_ROUNDS
        if not (course.leads_on(step) or nearly or done < COMPOSITE_ROUNDS) or round_again:
            break
        near = near or nearly or done >= ROUGH_ROUNDS
        if near and course.is_linear(now, move, spread):
            move = steps.combined(now.vector, move, spread)
        now = course.on(now, move)
        refuse_far(zip(setting.effects, now.sizes, strict=True), 1.0 / sample, plain, model)
        course.refuse_led_away(now, FARTHEST)
    raise _restless(model, x[:c], spread[:c], done)


def _below_zero(model: Model, values: FloatArray, spread: FloatArray) -> float:
    """Return by how many standard deviations at most a parameter is negative that cannot be."""
    bounded = [model.parameters.index(name) for name in bounded_names(model)]
    known = [place for place in bounded if 0.0 < spread[place] < np.inf]
    return float(np.max(-values[known] / spread[known], initial=0.0))


def _lost(setting: Setting, now: Unknowns, spread: FloatArray) -> tuple[str, ...]:
    """Return inertias and stiffnesses less certain than their size, delays than a radian at the cut-off.

    A body that vanished beside a delay is none that the records know: the delay has taken its place.
    """
    model, radian = setting.model, 1.0 / (2.0 * pi * setting.choice.cutoff_hz)
    limits = [
        abs(value) if is_solid(model, name) else np.inf
        for name, value in zip(model.parameters, now.p.tolist(), strict=True)
    ]
    names = (*model.parameters, *now.delays)
    limits += [radian] * len(now.delays)
    lost = [name for name, std, limit in zip(names, spread, limits, strict=True) if std > limit]
    values = dict(zip(model.parameters, now.p.tolist(), strict=True))
    gone = vanished_names(model, values) if now.delays else ()
    return tuple(dict.fromkeys((*lost, *gone)))


def _restless(model: Model, values: FloatArray, spread: FloatArray, rounds: int) -> IdentifiabilityError:
    """Return the error of steps that do not come to rest, with the parameters that nothing holds."""
    loose = [name for name, one, std in zip(model.parameters, values, spread, strict=True) if std > abs(one)]
    if not loose:
        return diverged(f"after {rounds} rounds the physical parameters still move")
    return IdentifiabilityError.at(
        "method iv",
        f"the records do not hold {', '.join(loose)}: after {rounds} rounds they still move, with "
        "standard deviations above their values",
        MORE,
    )


def _allowed(model: Model, start: Mapping[str, float], rules: Rules) -> FloatArray:
    """Return a start without what the rules do not allow, shape (parameters,)."""
    first = np.array([start[name] for name in model.parameters])
    held = [name in rules.at_zero for name in model.parameters]
    negative = [rules.bounded and name in bounded_names(model) for name in model.parameters] & (first < 0.0)
    return np.where(held | negative, 0.0, first)
