"""Where to start from when zeros of positions differ, or a channel is read at quite other instants.

A sensor that is late by samples, a clock that drifts by samples, readings behind a slow low-pass, a force
that acts behind one (a current loop): small steps from the records as they are lead nowhere. Channels are set
right by sizes on a grid and solved by least squares, with a constant in each row where zeros may differ; the
best of these is what is estimated from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from math import log
from typing import NamedTuple

import numpy as np

from modelgen.errors import IdentifiabilityError
from modelgen.runtime.diagnostics.samples.unit_errors import moves_as_one
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import (
    CLEARLY_LESS,
    CLOCK_DRIFTS,
    DEFLECTED,
    FINER,
    HIGH_PASSES,
    LARGEST_CLOCK_TRIED,
    LOOKED_AT,
    LOW_PASSES,
    MOST_TRIED,
    SENSOR_DELAYS,
)
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.freed_effects import corrected
from modelgen.runtime.iv.low_pass import low_pass, two_poles, undone_high_pass, without_starts
from modelgen.runtime.iv.model_errors import clock_effects, delay_effect, delay_effects, zero_effects
from modelgen.runtime.least_squares.coarse_delays import coarse_delays
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.wls import fit_matched, solve_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_triangles import misfit_of
from modelgen.runtime.simulation.closed_loop import rigid_motion


@dataclass(frozen=True, eq=False)
class Start:
    """Effects to begin with, the sizes of the first of them, and the fit that these belong to."""

    effects: tuple[Effect, ...]
    sizes: tuple[float, ...]
    fit: Fit

    def lagging(self, sizes: tuple[float, ...]) -> tuple[float, ...]:
        """Return sizes with those of low-passes as of a single lag that is late by the delay found."""
        late = {one.channel: by for one, by in zip(self.effects, sizes, strict=True) if one.kind == "delay"}
        return tuple(
            0.5 * late[one.channel] * abs(late[one.channel])
            if one.kind == "lag" and one.channel in late
            else size
            for one, size in zip(self.effects, sizes, strict=True)
        )


def coarse_starts(job: Job) -> Iterator[Start]:
    """Yield where to start from: with zeros, with what is read at other instants, with both.

    Raises
    ------
    IdentifiabilityError
        When least squares says nothing of the records as they are.
    """
    zeros = zeros_apart(job)
    if zeros.effects:
        yield Start(zeros.effects, zeros.sizes, _about_zeros(job))
    # clocks drift apart from the first sample on
    short = replace(
        job, records=tuple(one.part(0, min(LOOKED_AT, one.n), one.name) for one in job.records), surveys=()
    )
    plain, count = _misfit(short, short.records)
    limit = plain + log(CLEARLY_LESS) * count
    found = [best for best in (_best(short, one) for one in _families(short)) if best is not None]
    found = [one for one in found if one.misfit < limit]
    for one in sorted(found, key=lambda one: one.misfit)[:MOST_TRIED]:
        start = _with_delays(job, one.effects, one.sizes)
        yield start
        if zeros.effects:
            effects, sizes = (*start.effects, *zeros.effects), (*start.sizes, *zeros.sizes)
            yield replace(start, effects=effects, sizes=sizes)


class Zeros(NamedTuple):
    """Zeros of positions, those at which links are not deflected in the median (SI), and whether they differ.

    They do where that is more than links are deflected in the records.
    """

    effects: tuple[Effect, ...]
    sizes: tuple[float, ...]
    differ: bool


def zeros_apart(job: Job) -> Zeros:
    """Return the zeros of positions.

    Zeros may differ by thousands of deflections: what moves by that has nothing to do with the records.
    """
    effects = zero_effects(job.model, len(job.records))
    moves = rigid_motion(job.model) if effects and moves_as_one(job.model) else {}
    read = [one for one in job.model.sensors if one.measures == "position" and one.body in moves]
    shares = {one.key: moves[str(one.body)] / moves[str(read[0].body)] for one in read}
    sizes, differ = [], False
    for effect in effects:
        size = 0.0
        if effect.channel in shares and effect.record is not None:
            record = job.records[effect.record]
            keys = (effect.channel, read[0].key)
            own, first = (record.read(key, 0, min(record.n, LOOKED_AT)) for key in keys)
            apart = own - shares[effect.channel] * first
            size = float(np.median(apart))
            differ |= abs(size) > DEFLECTED * float(np.std(apart))
        sizes.append(size)
    return Zeros(effects, tuple(sizes), differ)


def _with_delays(job: Job, effects: tuple[Effect, ...], sizes: tuple[float, ...]) -> Start:
    """Return the start of the whole records; delays of forces are those of its fit, and no effects."""
    fit = _fit(job, corrected(job.records, {}, effects, sizes))
    sized = list(zip(effects, sizes, strict=True))
    late = {one.channel: size for one, size in sized if one.kind == "delay" and one.channel in job.late}
    kept = [(one, size) for one, size in sized if one.channel not in late or one.kind != "delay"]
    delays = tuple((key, late.get(key, 0.0), 0.0) for key in job.late)
    effects, sizes = tuple(without_starts(one) for one, _ in kept), tuple(size for _, size in kept)
    return Start(effects, sizes, replace(fit, delays=delays))


@dataclass(frozen=True, eq=False)
class _Family:
    """Effects of one channel whose sizes follow from one number, and those that are tried: mostly samples."""

    effects: tuple[Effect, ...]
    sizes: Callable[[float], tuple[float, ...]]
    tried: tuple[float, ...]


def _families(job: Job) -> Iterator[_Family]:
    sample = 1.0 / min(record.fs for record in job.records)
    longest = max(record.n for record in job.records)
    late_by = {effect.channel: effect for effect in delay_effects(job.model)}
    for late in list(late_by.values())[1:]:
        yield _Family((late,), lambda by: (by * sample,), SENSOR_DELAYS)
        yield _behind(late, low_pass(late.channel, force=False), sample, LOW_PASSES)
        yield _Family((two_poles(late.channel),), lambda by: (by * sample,), LOW_PASSES)
    for sensor in job.model.sensors:
        if sensor.measures == "acceleration":
            yield _Family((undone_high_pass(sensor.key),), lambda octave: (2.0**octave,), HIGH_PASSES)
    # a force may be read through a low-pass, or act behind one
    either = (*(-by for by in LOW_PASSES), *LOW_PASSES)
    for key in job.late:
        yield _behind(delay_effect(key), low_pass(key, force=True), sample, either)
    drifts = tuple(by for by in CLOCK_DRIFTS if abs(by) < LARGEST_CLOCK_TRIED * longest)
    for effect in clock_effects(job.model):
        yield _Family((effect,), lambda by: (by / longest,), drifts)


def _behind(late: Effect, lag: Effect, sample: float, tried: tuple[float, ...]) -> _Family:
    """Return a low-pass with so many samples (s each) as its time constant; it is late by them, too."""
    return _Family((late, lag), lambda by: (by * sample, 0.5 * by * abs(by) * sample**2), tried)


class _Looked(NamedTuple):
    """Effects of a family at the sizes that leave least, and the misfit."""

    effects: tuple[Effect, ...]
    sizes: tuple[float, ...]
    misfit: float


def _best(job: Job, family: _Family) -> _Looked | None:
    """Return the sizes that leave least, those between the ones that are tried included; None without any."""
    found: dict[float, float] = {}

    def look(by: float) -> None:
        records = corrected(job.records, {}, family.effects, family.sizes(by))
        with suppress(IdentifiabilityError):
            found[by], _ = _misfit(job, records)

    for by in family.tried:
        look(by)
    for step in FINER if found else ():
        best = min(found, key=found.__getitem__)
        for by in (best + step, best - step):
            if by not in found:
                look(by)
    best = min(found, key=found.__getitem__, default=0.0)
    return _Looked(family.effects, family.sizes(best), found[best]) if found else None


def _misfit(job: Job, records: tuple[Record, ...]) -> tuple[float, int]:
    """Return the misfit of `_fit`, and how many samples it is of, from triangles of the rows."""
    rows = job.calm(records)
    blocks, columns = [block.summary for block in rows.blocks if block.count], rows.columns
    if zero_effects(job.model, len(records)):
        blocks = [block.about_constant(len(columns) + place) for place, block in enumerate(blocks)]
        columns = (*columns, *_constants(len(blocks)))
    found = solve_matched(blocks, columns)
    x = found.solution.x
    left = misfit_of(found.rows, [row.residual_norm(x) for row in found.rows], x)
    return left, sum(row.count for row in found.rows)


def _fit(job: Job, records: tuple[Record, ...]) -> Fit:
    """Return least squares of the rows, with a constant in each block where zeros may differ."""
    plain = fit_matched(job.calm(records))
    return _about_means(plain, _with_constants(plain)) if zero_effects(job.model, len(records)) else plain


def _about_means(plain: Fit, larger: Fit) -> Fit:
    """Return a fit with the solution, and what is left, of its rows with a constant in each block."""
    values = dict(zip(larger.columns, larger.solution.x.tolist(), strict=True))
    x = np.array([values[name] for name in plain.columns])
    return replace(plain, solution=replace(plain.solution, x=x), residuals=larger.residuals)


def _with_constants(plain: Fit) -> Fit:
    count = len(plain.blocks)
    blocks = tuple(
        replace(
            block.kept(), W=np.column_stack([block.W, np.tile(np.eye(count)[index], (len(block.place), 1))])
        )
        for index, block in enumerate(plain.dense().blocks)
    )
    return fit_matched(Observation(plain.columns + _constants(count), blocks))


def _constants(count: int) -> tuple[str, ...]:
    return tuple(f"constant {index}" for index in range(count))


def _about_zeros(job: Job) -> Fit:
    """Return least squares about constants of the blocks, with delays of forces that leave clearly less."""
    plain = fit_matched(job.calm(job.records))
    larger = _with_constants(plain)
    late = coarse_delays(larger, job.model, job.records, job.choice, job.late)
    delays = tuple((channel, delay, 0.0) for channel, delay in late.items())
    return replace(_about_means(plain, larger), delays=delays)
