"""Instrumental variables in the physical parameters, for rows whose columns are composites of them.

An elimination leaves more composites than physical parameters, and at the noise of usual sensors some of them
cannot be told apart; the fewer physical parameters can. Rows are linearised at the present estimate p,

    Y - W b(p) = W J (p' - p),    J = db/dp,

made white (`whitening`), and solved with the instruments Z J of a simulation at p, until p stands still
(Gauss-Newton steps, `physical_step`). Delays of forces are further unknowns, see `delays`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.iv.divergence import diverged
from modelgen.runtime.iv.gauss_newton_step import Rules, Unknowns, in_base_columns, step_from
from modelgen.runtime.iv.instrumental_variables import Setting, simulation_parameters
from modelgen.runtime.iv.starting_values import physical_starts
from modelgen.runtime.iv.thresholds import (
    COMPOSITE_MOVE,
    COMPOSITE_ROUNDS,
    FARTHEST,
    HOPELESS,
    LARGEST_STEP,
    SMALL_CHANGE,
)
from modelgen.runtime.least_squares.coarse_delays import coarse_delays
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.thresholds import SMALLEST_STEP
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import bounded_names
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation

# records -> rows without the samples that a consistent estimate must not use
Rows = Callable[[tuple[Record, ...]], Observation]
# physical parameters (SI) and delays of forces (s) to begin with
Beginning = tuple[Mapping[str, float], Mapping[str, float]]

# Nor can a parameter be this many times smaller or larger than at the start.
SIGNED = ("offset", "viscous", "coulomb")
PLAIN = Rules()


@dataclass(frozen=True, eq=False)
class Found:
    """Rows, their fit in base columns, and the physical parameters p it was made at, shape (parameters,).

    `following` is where the next step would go.
    """

    observation: Observation
    fit: Fit
    p: FloatArray
    following: FloatArray

    def values(self, model: Model) -> dict[str, float]:
        """Return the physical parameters by name."""
        return dict(zip(model.parameters, self.p.tolist(), strict=True))

    def leaves_bounds(self, model: Model) -> bool:
        """Tell whether what is never negative is, at p or after the next step."""
        places = [model.parameters.index(name) for name in bounded_names(model)]
        return bool(np.any(np.minimum(self.p, self.following)[places] < 0.0))


def fit_composites_iv(
    setting: Setting,
    rows: Rows,
    late: tuple[str, ...],
    near: Fit | None = None,
    rules: Rules = PLAIN,
    begin: Mapping[str, float] | None = None,
) -> tuple[Observation, Fit]:
    """Estimate physical parameters and delays together, from the first start that leads anywhere.

    Robust weights begin where the estimate without them is, and bounds are not looked at where it keeps to
    them by itself; where it leads nowhere, both are tried from the start. `near` is such a fit at other
    settings, `begin` a start that is tried before those of the records; else as `fit_physical_iv`.
    """
    model = setting.model
    delays: Mapping[str, float] = dict.fromkeys(late, 0.0)
    if near is not None and not near.absent:
        found = fit_physical_iv(setting, rows, delays, _start_near(model, near), rules)
        return found.observation, found.fit
    first = fit_matched(rows(tuple(setting.records)))
    plain = replace(rules, robust=False, bounded=False)
    try:
        found = _first_found(setting, rows, _beginnings(setting, rows, late, first, begin), plain)
    except IdentifiabilityError:
        if rules == plain:
            raise
        found = _first_found(setting, rows, _beginnings(setting, rows, late, first, begin), rules)
        return found.observation, found.fit
    delays = {channel: delay for channel, delay, _ in found.fit.delays}
    if rules.robust:
        found = fit_physical_iv(setting, rows, delays, found.values(model), replace(rules, bounded=False))
    if rules.bounded and found.leaves_bounds(model):
        found = fit_physical_iv(setting, rows, delays, found.values(model), rules)
    return found.observation, found.fit


def _start_near(model: Model, near: Fit) -> Mapping[str, float]:
    start = simulation_parameters(model, near)
    fitted = near.physical(model.parameters)
    # there is no way back from composites to parameters below zero
    return start if fitted is None or np.all(np.isfinite(list(start.values()))) else fitted


def _beginnings(
    setting: Setting, rows: Rows, late: tuple[str, ...], first: Fit, begin: Mapping[str, float] | None
) -> Iterator[Beginning]:
    """Yield where to begin, the cheapest first: parameters (SI) and delays of forces in s.

    Composites of forces that are late by samples are those of another chain, or of none: where the first
    start leads nowhere, that of the delay which leaves least is tried.
    """
    on_time = dict.fromkeys(late, 0.0)
    if begin is not None:
        yield begin, on_time
    starts = physical_starts(first, setting)
    yield from ((start, on_time) for start in islice(starts, 1))
    delays = coarse_delays(first, setting.model, setting.records, setting.choice, late)
    if any(delays.values()):
        there = replace(setting, records=tuple(advanced(record, delays) for record in setting.records))
        others = physical_starts(fit_matched(rows(tuple(there.records))), there)
        yield from ((start, delays) for start in islice(others, 1))
    yield from ((start, on_time) for start in starts)


def _first_found(setting: Setting, rows: Rows, beginnings: Iterable[Beginning], rules: Rules) -> Found:
    failures = []
    for start, delays in beginnings:
        try:
            return fit_physical_iv(setting, rows, delays, start, rules)
        except IdentifiabilityError as error:
            failures.append(error)
    # the first start is the most likely one, and so is what became of it
    raise failures[0] if failures else diverged("no physical parameters belong to its estimate")


def fit_physical_iv(
    setting: Setting,
    rows: Rows,
    delays: Mapping[str, float],
    start: Mapping[str, float],
    rules: Rules = PLAIN,
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
    now, late = Unknowns(first, delays), tuple(delays)
    c = len(model.parameters)
    observation = rows(tuple(advanced(record, delays) for record in setting.records))
    plain = fit_matched(observation)
    if plain.absent:
        raise diverged(f"the records do not move what {', '.join(plain.absent)} needs", plain, model)
    for done in range(1, COMPOSITE_ROUNDS + 1):
        if late and done > 1:
            observation = rows(tuple(advanced(record, now.delays) for record in setting.records))
            plain = replace(plain, blocks=tuple(block for block in observation.blocks if block.place.size))
        step = step_from(setting, plain, now, rules)
        x, spread = step.x, step.spread
        move = np.r_[x[:c] - now.p, x[c:]]
        if not np.all(np.isfinite(move)):
            raise diverged("its estimate is not finite", plain, model)
        size = np.r_[np.abs(x[:c]), np.full(len(late), SMALLEST_STEP * sample / SMALL_CHANGE)]
        small = np.maximum(COMPOSITE_MOVE * spread, SMALL_CHANGE * size)
        hopeless = spread > HOPELESS * np.r_[np.abs(x[:c]), np.full(len(late), np.inf)]
        if done > 1 and np.all((np.abs(move) <= small) | hopeless):
            return Found(observation, in_base_columns(step, now.delays, done), now.p, x[:c])
        now = _moved(model, now, move, sample, rules)
        _check_distance(model, now.p, first, rules)
    raise _restless(model, x[:c], spread[:c])


def _restless(model: Model, values: FloatArray, spread: FloatArray) -> IdentifiabilityError:
    """Return the error of steps that do not come to rest, with the parameters that nothing holds."""
    loose = [name for name, one, std in zip(model.parameters, values, spread, strict=True) if std > abs(one)]
    if not loose:
        return diverged(f"after {COMPOSITE_ROUNDS} rounds the physical parameters still move")
    return IdentifiabilityError.at(
        "method iv",
        f"the records do not hold {', '.join(loose)}: after {COMPOSITE_ROUNDS} rounds they still move, with "
        "standard deviations above their values",
        "sense more (modelgen show --sensors all), give one of them as known, excite more, or give the "
        "delays of forces where they are known (--delay none)",
    )


def _allowed(model: Model, start: Mapping[str, float], rules: Rules) -> FloatArray:
    """Return a start without what the rules do not allow, shape (parameters,)."""
    first = np.array([start[name] for name in model.parameters])
    held = [name in rules.at_zero for name in model.parameters]
    negative = [rules.bounded and name in bounded_names(model) for name in model.parameters] & (first < 0.0)
    return np.where(held | negative, 0.0, first)


def _keeps_sign(model: Model, name: str, rules: Rules) -> bool:
    """Tell whether a parameter keeps its sign because no step goes far: a bound lets damping go to zero."""
    if name not in model.roles or name in rules.at_zero:
        return False
    role = model.roles[name].role
    return role not in SIGNED and not (rules.bounded and role == "damping")


def _moved(model: Model, now: Unknowns, move: FloatArray, sample: float, rules: Rules) -> Unknowns:
    """Return the unknowns after a step, shortened where it would leave the range of the linear rows."""
    c = len(now.p)
    bound = np.array([_keeps_sign(model, name, rules) for name in model.parameters])
    share = np.abs(move[:c][bound]) / np.maximum(np.abs(now.p[bound]), np.finfo(float).tiny)
    length = min(1.0, LARGEST_STEP / max(float(share.max(initial=0.0)), LARGEST_STEP))
    late = np.clip(length * move[c:], -sample, sample)
    delays = {
        channel: delay + float(step) for (channel, delay), step in zip(now.delays.items(), late, strict=True)
    }
    return Unknowns(now.p + length * move[:c], delays)


def _check_distance(model: Model, p: FloatArray, first: FloatArray, rules: Rules) -> None:
    for name, value, start in zip(model.parameters, p, first, strict=True):
        far = not abs(start) / FARTHEST <= abs(value) <= abs(start) * FARTHEST
        if far and start and _keeps_sign(model, name, rules):
            raise diverged(f"{name} runs away")
