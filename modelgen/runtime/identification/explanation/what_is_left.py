"""What estimates of the same records leave, compared: which of them is more likely."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.runtime.diagnostics.row_noise import exceeding_noise, row_noise
from modelgen.runtime.filter_choice.signal_to_noise import noise_band
from modelgen.runtime.identification.explanation.explained import Begun, exceeding
from modelgen.runtime.identification.thresholds import MOST_EXPONENT, OVER_NOISE
from modelgen.runtime.iv.thresholds import AS_LIKELY
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.records.record import Record

if TYPE_CHECKING:
    from modelgen.runtime.identification.job import Job
    from modelgen.runtime.iv.effect import Effect


@dataclass(frozen=True, eq=False)
class Equal:
    """An effect that leaves as little as the one that is taken, with its size, and X with it estimated."""

    effect: Effect
    size: float
    x: FloatArray


def gained(
    before: Begun, after: Begun, recorded: Job | None = None, held: Mapping[str, float] = MappingProxyType({})
) -> float:
    """Return by how much more likely `after` is than `before`: differences of logarithms, see `unlikely`.

    `recorded` has the records of both as they were, and `held` says over how many samples channels are held
    in `after`. Where either leaves clearly more than noise it is an error of the forces that is left, which
    no low-pass of a sensor makes less of: misfits are compared as they are. Only samples count that both use.
    """
    fits = on_common_samples([before.found.fit, after.found.fit])
    if exceeding(before) and exceeding(after):
        return fits[0].misfit - fits[1].misfit
    one, other = before.found, after.found
    left = unlikely(recorded or before.task.job, fits[0], one.effects, one.sizes)
    job = recorded or after.task.job
    # what encoders round is no part of either: of motions that hardly differ it would differ by chance
    return left - unlikely(job, fits[1], other.effects, other.sizes, held, fits[0].simulated)


def left_less(before: Fit, after: Fit) -> float:
    """Return by how much less `after` leaves of the samples that both use; a misfit is half a chi square."""
    fits = on_common_samples([before, after])
    return fits[0].misfit - fits[1].misfit


def leaves_noise(job: Job, fit: Fit) -> bool:
    """Tell whether what a fit leaves may be noise of the sensors, of which a low-pass leaves less."""
    return not exceeding_noise(job.model, job.records, job.choice, fit, OVER_NOISE)


def chance(less: float) -> float:
    """Return the chance of an estimate that is less likely than another by so much, as a logarithm.

    Odds are as uncertain as likelihoods are.
    """
    return 1.0 / (1.0 + exp(min(less / AS_LIKELY, MOST_EXPONENT)))


def left_of_each(
    job: Job,
    found: Sequence[tuple[Fit, Sequence[Effect], Sequence[float]]],
    moved: Mapping[int, Record] | None = None,
) -> list[float]:
    """Return what fits with effects of some sizes leave of the samples that all use, as minus a likelihood.

    Noise of the rows grows with the parameters: where one leaves no more than that, it counts in all as a
    multiple of it (`unlikely`, with `moved`); else by the size of the rows (`Fit.misfit`).
    """
    every = [fit for fit, _, _ in found]
    fits = on_common_samples(every)
    if not any(leaves_noise(job, fit) for fit in every):
        return [fit.misfit for fit in fits]
    entries = zip(fits, found, strict=True)
    return [unlikely(job, fit, effects, sizes, moved=moved) for fit, (_, effects, sizes) in entries]


def on_common_samples(fits: Sequence[Fit]) -> list[Fit]:
    """Return fits of the same rows with the samples that all of them use, for comparisons of what is left.

    A delay, or another direction, moves the samples that feel a reversal: what is left out of some, or is in
    addition, is no evidence. Samples that are not kept in memory, and other grids, stay as they are.
    """
    blocks = [{(block.record, block.row): block for block in fit.blocks} for fit in fits]
    keys = set.intersection(*(set(one) for one in blocks)) if blocks else set()
    kept = all(block.in_memory for one in blocks for block in one.values())
    if not keys or not kept or any(len({one[key].grid for one in blocks}) > 1 for key in keys):
        return list(fits)
    marked = {}
    for key in keys:
        marked[key] = np.zeros(blocks[0][key].grid, dtype=bool)
        for one in blocks:
            marked[key] |= np.bincount(one[key].place, minlength=one[key].grid) == 0
    return [_without(fit, marked) for fit in fits]


def _without(fit: Fit, marked: Mapping[tuple[int, int], BoolArray]) -> Fit:
    """Return a fit without samples that are marked on the grid of its rows, and without other rows."""
    keys = [(block.record, block.row) for block in fit.blocks]
    # most that are compared use the same samples: their triangles are known
    if all(
        key in marked and not marked[key][block.place].any()
        for key, block in zip(keys, fit.blocks, strict=True)
    ):
        return fit
    parts = []
    for place, (key, block) in enumerate(zip(keys, fit.blocks, strict=True)):
        out = marked.get(key)
        if out is not None and not out.all():
            residual = fit.residuals[place][~out[block.place]]
            parts.append((block.without(out), fit.weights[place], residual))
    if not parts:
        return fit
    blocks, weights, residuals = zip(*parts, strict=True)
    return replace(fit, blocks=tuple(blocks), weights=tuple(weights), residuals=residuals, projected=None)


def unlikely(
    job: Job,
    fit: Fit,
    effects: Sequence[Effect],
    sizes: Sequence[float],
    held: Mapping[str, float] = MappingProxyType({}),
    moved: Mapping[int, Record] | None = None,
) -> float:
    """Return minus the logarithm of a fit's likelihood, each block with noise of one size.

    What is left counts as a multiple of what noise of the sensors gives a row with its parameters. These, and
    what an effect or a hold of the channels `held` takes off a channel by a low-pass, make less of noise
    where they make less of a row: that explains nothing. Rows without noise count by size (`Fit.misfit`).
    Encoders round the motion `moved`, by record, that of the fit's own simulation if none is given.
    """
    from modelgen.runtime.iv.low_pass import noise_passed

    total, x = 0.0, fit.all_parameters(job.model.base_parameters)
    motions = moved or fit.simulated or {}
    for index, block in enumerate(fit.blocks):
        record, factor = job.records[block.record], job.choice.decimation[block.record]
        lines = noise_band(record, job.choice).frequency_hz
        passed = {key: np.sinc(length * lines / record.fs) ** 2 for key, length in held.items()}
        for one, size in zip(effects, sizes, strict=True):
            share = noise_passed(one, size, lines, record.fs)
            passed[one.channel] = passed.get(one.channel, 1.0) * share
        motion, left = motions.get(block.record), fit.rms(index)
        noise = row_noise(job.model, record, job.choice, factor, block.row, x, motion, passed)
        if noise <= 0.0 or left <= 0.0:
            return fit.misfit
        total += block.count * float(np.log(left / noise))
    return total
