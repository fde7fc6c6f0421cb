"""Instrumental variables in the physical parameters, for rows whose columns are composites of them.

An elimination leaves more composites than physical parameters, and at the noise of usual sensors some of them
cannot be told apart; the fewer physical parameters can. Where the steps of `physical_iv` begin decides where
they end: starts are tried until one leads to a chain that the records know.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import islice

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.iv.instrumental_variables import Setting, simulation_parameters
from modelgen.runtime.iv.physical.course_of_steps import MORE
from modelgen.runtime.iv.physical.friction_rows import adds_friction
from modelgen.runtime.iv.physical.gauss_newton_step import Rules, Unknowns, in_base_columns, step_from
from modelgen.runtime.iv.physical.physical_iv import PLAIN, Found, Rows, fit_physical_iv
from modelgen.runtime.iv.physical.response_start import response_start
from modelgen.runtime.iv.physical.start_in_rows import start_in_rows
from modelgen.runtime.iv.physical.starting_values import (
    cheap_starts,
    near_composites,
    physical_starts,
    vanished_names,
    with_shared_friction,
)
from modelgen.runtime.iv.thresholds import (
    HELD_DELAY,
    HELD_PARTS,
    HELD_ROUNDS,
    HELD_STARTS,
    MANY_TIMES,
    RESPONSE_CLOSE,
)
from modelgen.runtime.least_squares.coarse_delays import coarse_delays
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.observation import Observation

# physical parameters (SI) and delays of forces (s) to begin with
Beginning = tuple[Mapping[str, float], Mapping[str, float]]


def fit_composites_iv(
    setting: Setting,
    rows: Rows,
    late: tuple[str, ...],
    near: Fit | None = None,
    rules: Rules = PLAIN,
    begin: Mapping[str, float] | None = None,
    known_delays: Mapping[str, float] | None = None,
) -> tuple[Observation, Fit]:
    """Estimate physical parameters and delays together, from the first start that leads anywhere.

    Robust weights begin where the estimate without them is, and bounds are not looked at where it keeps to
    them by itself; where it leads nowhere, both are tried from the start. `near` is such a fit at other
    settings, `begin` a start that is tried before those of the records, and in their place where it is an
    estimate of nearly the same records with `known_delays`; else as `fit_physical_iv`.
    """
    model = setting.model
    on_time: Mapping[str, float] = dict.fromkeys(late, 0.0)
    if near is not None and not near.absent:
        found = fit_physical_iv(setting, rows, on_time, _start_near(model, near), rules, settled=True)
        return found.observation, found.fit
    first = fit_matched(rows(tuple(setting.records)))
    if begin is not None and known_delays is not None:
        # an estimate of nearly the same records is not that far off
        rules = replace(rules, farthest=MANY_TIMES)
    plain = replace(rules, robust=False, bounded=False)

    def beginnings() -> Iterator[Beginning]:
        if begin is not None and known_delays is not None:
            # without the delays that are known steps go the same way, or in vain
            yield begin, {channel: known_delays.get(channel, 0.0) for channel in late}
            return
        if begin is not None:
            yield begin, on_time
        yield from _beginnings(setting, rows, late, first)

    try:
        found = _first_found(setting, rows, beginnings(), plain)
    except IdentifiabilityError:
        if rules == plain:
            raise
        found = _first_found(setting, rows, beginnings(), rules)
        return found.observation, found.fit
    delays = {channel: delay for channel, delay, _ in found.fit.delays}
    if rules.robust:
        found = fit_physical_iv(
            setting, rows, delays, found.values(model), replace(rules, bounded=False), True
        )
    if rules.bounded and found.leaves_bounds(model):
        found = fit_physical_iv(setting, rows, delays, found.values(model), rules, settled=True)
    return found.observation, found.fit


def moved_by_turns(setting: Setting, observation: Observation, fit: Fit, rules: Rules = PLAIN) -> FloatArray:
    """Return by how much X of such a fit to its rows moves, shape (c,) in SI, with `other_directions`.

    Parameters as of `fit_composites_iv`, whose `observation` and `fit` these are. Nothing moves where no row
    drops the friction of what turns near its samples.
    """
    carried, plain = fit.carried, fit_matched(observation)
    if carried is None or carried.at is None or not adds_friction(plain, setting):
        return np.zeros(len(fit.columns))
    sizes = tuple(begun + size for begun, (size, _) in zip(setting.sizes, carried.sizes, strict=True))
    now = Unknowns(carried.at, {channel: delay for channel, delay, _ in fit.delays}, sizes)
    own, other = (step_from(replace(setting, closer=closer), plain, now, rules) for closer in (False, True))
    return np.asarray(own.slope @ (other.x - own.x)[: len(carried.at)])


def _start_near(model: Model, near: Fit) -> Mapping[str, float]:
    start = simulation_parameters(model, near)
    fitted = near.physical(model.parameters)
    # there is no way back from composites to parameters below zero
    return start if fitted is None or np.all(np.isfinite(list(start.values()))) else fitted


def _beginnings(setting: Setting, rows: Rows, late: tuple[str, ...], first: Fit) -> Iterator[Beginning]:
    """Yield where to begin, the cheapest first: parameters (SI) and delays of forces in s.

    Composites of forces that are late by samples are those of another chain, or of none: where the first
    start leads nowhere, that of the delay which leaves least is tried.
    """
    on_time = dict.fromkeys(late, 0.0)
    near = near_composites(setting.model, first)
    cheap = cheap_starts(near, setting)
    responding = response_start(setting, near, late, cheap)
    if responding is not None and responding.missed < RESPONSE_CLOSE:
        yield responding.values, responding.delays
    nearest = start_in_rows(first, setting, cheap, late)
    if nearest is not None:
        values, delays = nearest
        yield with_shared_friction(setting.model, values), delays
    starts = physical_starts(first, setting, near)
    yield from ((start, on_time) for start in islice(starts, 1))
    delays = coarse_delays(first, setting.model, setting.records, setting.choice, late)
    if any(delays.values()):
        there = replace(setting, records=tuple(advanced(record, delays) for record in setting.records))
        others = physical_starts(fit_matched(rows(tuple(there.records))), there)
        yield from ((start, delays) for start in islice(others, 1))
    yield from ((start, on_time) for start in starts)


def _first_found(setting: Setting, rows: Rows, beginnings: Iterable[Beginning], rules: Rules) -> Found:
    """Return the first estimate that knows its chain, else one whose delays are held, else any.

    What no machine is (friction far below zero) is one of several chains that belong to the same rows: the
    others are looked for, and the least impossible one is taken.
    """
    failures, doubtful, tried = [], list[Found](), list[Beginning]()
    for start, delays in beginnings:
        if (start, delays) in tried:
            continue
        tried.append((start, delays))
        try:
            found = fit_physical_iv(setting, rows, delays, start, rules)
        except IdentifiabilityError as error:
            failures.append(error)
        else:
            if found.likely:
                return found
            doubtful.append(found)
    impossible = [one for one in doubtful if not one.lost]
    if impossible:
        return min(impossible, key=lambda one: one.below)
    sample = 1.0 / min(record.fs for record in setting.records)
    held = (
        _with_held_delays(
            setting, rows, {key: delay + part * sample for key, delay in delays.items()}, start, rules
        )
        for part in HELD_PARTS
        for start, delays in tried[:HELD_STARTS]
        if delays
    )
    known = next((found for found in held if found is not None), None)
    if known is not None or doubtful:
        return known or doubtful[0]
    # the first start is the most likely one, and so is what became of it; a motion that cannot be simulated
    # is none that the user has seen
    told = [error for error in failures if not isinstance(error.__cause__, DataError)]
    raise (
        told[0]
        if told
        else IdentifiabilityError.at(
            "method iv", "no chain that can be simulated belongs to what the records give", MORE
        )
    )


def _with_held_delays(
    setting: Setting, rows: Rows, delays: Mapping[str, float], start: Mapping[str, float], rules: Rules
) -> Found | None:
    """Return the estimate of a chain whose delays are held, None where nothing near the start suits.

    They are held as at the start, or where steps from estimates with held delays lead.
    Far from the solution delays and an overdamped link look alike, and steps in both lead away. The
    covariance is that of parameters and delays together: it holds what an unknown delay changes.
    """
    model, c = setting.model, len(setting.model.parameters)
    for _ in range(HELD_ROUNDS):
        there = replace(setting, records=tuple(advanced(record, delays) for record in setting.records))
        try:
            found = fit_physical_iv(there, rows, {}, start, rules)
        except IdentifiabilityError:
            return None
        # beside a delay a body that vanished is none that the records know: the delay has taken its place
        if found.lost or vanished_names(model, found.values(model)):
            return None
        sizes = tuple(size for size, _ in found.fit.carried.sizes) if found.fit.carried else ()
        now = Unknowns(found.p, delays, sizes)
        step = step_from(setting, fit_matched(found.observation), now, rules)
        moved, spread = (one[c : c + len(delays)] for one in (step.x, step.spread))
        if np.all(np.abs(moved) <= HELD_DELAY * spread):
            note = f"parameters and delays do not come to rest together: {_delays_held(delays)}"
            fit = in_base_columns(step, now, 1)
            return replace(found, fit=replace(fit, notes=(*found.fit.notes, note)))
        start = found.values(model)
        delays = {key: delay + one for (key, delay), one in zip(delays.items(), moved.tolist(), strict=True)}
    return None


def _delays_held(delays: Mapping[str, float]) -> str:
    told = [f"{1e6 * delay:.4g} us that of {channel}" for channel, delay in delays.items()]
    return f"held at {', '.join(told)}; the intervals hold what an unknown delay changes"
