"""Which force or error periodic in a body's position leaves least of the rows: from what they leave.

What is left, taken through the same filters backwards, is the part of it that a force on the body explains,
or an error of its sensor; its spectrum over the position, and not over time, shows the period.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray, IntArray
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import RIPPLE, Changes, Effect
from modelgen.runtime.iv.effect_rows import effect_rows
from modelgen.runtime.iv.shapes.ripple import PeriodicPlace, places_of, position, ripple, waves
from modelgen.runtime.iv.shapes.shape_search import ShapeRows
from modelgen.runtime.iv.thresholds import AS_LIKELY, FEWEST_PERIODS, MOST_PERIODS, RIPPLES_TRIED
from modelgen.runtime.numerics.block_column import block_column
from modelgen.runtime.rows.row_block import RowBlock


def ripples(rows: ShapeRows, names: Collection[str], others: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return for each place the ripple with which clearly less is left, if there is one; the least first.

    Parameters
    ----------
    rows : ShapeRows
    names : collection of str
        Those of effects that are estimated already.
    others : sequence of Effect
        A slow ripple may look like these, which have a size only: it has to leave clearly less than each.
    """
    found, numbers = list[tuple[Effect, float]](), 1 + rows.records
    seen, limit = rows.limits
    least = min((rows.left(rows.columns((one,))).misfit for one in others), default=np.inf)
    limit = min(limit, least - numbers * AS_LIKELY)
    for at in places_of(rows.setting.model, rows.simulated[0].plant.bodies):
        if at.name in names:
            continue
        places = [position(one, at.body) for one in rows.simulated]
        way = max(float(np.ptp(place)) for place in places)
        begun = [_begun(rows, at, way, number) for number in _numbers(rows, at, places, way)]
        at_peaks = sorted(begun, key=lambda pair: pair[1])[:RIPPLES_TRIED]
        tried = [rows.sharpened(one, numbers) for one, misfit in at_peaks if misfit < seen]
        best = min(tried, key=lambda pair: pair[1], default=None)
        if best is not None and best[1] < limit:
            found.append(best)
    return tuple(effect for effect, _ in sorted(found, key=lambda pair: pair[1]))


def _begun(rows: ShapeRows, at: PeriodicPlace, way: float, number: float) -> tuple[Effect, float]:
    """Return the ripple of so many radians per rad or m with its phases, and what is left with it."""
    left = rows.left(rows.columns(waves(at, number, rows.records)))
    sine, cosine = np.reshape(left.sizes, (-1, 2)).T
    return ripple(rows.setting.model, at, way, number, np.arctan2(cosine, sine).tolist()), left.misfit


def _numbers(rows: ShapeRows, at: PeriodicPlace, places: Sequence[FloatArray], longest: float) -> list[float]:
    """Return in rad per rad or m where the spectrum over the position is largest, one an octave."""
    slow = rows.simulated[0].slow[at.body]
    if not longest > 0.0:
        return []
    least = 2.0 * np.pi * FEWEST_PERIODS / longest
    most = min(2.0 * np.pi * rows.setting.choice.cutoff_hz / slow, 2.0 * np.pi * MOST_PERIODS / longest)
    if most <= least:
        return []
    felt = _felt(rows, at)
    # four points a bin of the longest way
    step = 2.0 * np.pi / (4.0 * longest)
    number = step * np.arange(int(most / step) + 1, dtype=float)
    power = np.zeros(len(number))
    for samples, place in zip(felt, places, strict=True):
        power += np.abs(_spectrum(samples, place, step, len(number))) ** 2
    return _peaks(number, power, least, most)


def _peaks(number: FloatArray, power: FloatArray, least: float, most: float) -> list[float]:
    """Return where a spectrum is largest in each octave between two numbers."""
    octave = np.floor(np.log2(np.maximum(number, 0.5 * least) / least))
    octave[number > most] = -1.0
    inside = [np.flatnonzero(octave == one) for one in range(int(np.max(octave)) + 1)]
    return [float(number[one[np.argmax(power[one])]]) for one in inside if len(one)]


def _spectrum(samples: FloatArray, place: FloatArray, step: float, count: int) -> ComplexArray:
    """Return the sums of samples exp(-i k step place), k = 0 .. count - 1, shape (count,).

    Samples are gathered in bins of the position, a quarter of the shortest period or less.
    """
    bins = 1 << int(np.ceil(np.log2(8 * count)))
    whole = 2.0 * np.pi / step
    at = np.floor((place / whole + 0.5) * bins).astype(int) % bins
    gathered = np.bincount(at, samples, bins)
    return np.asarray(np.fft.rfft(gathered)[:count])


def _felt(rows: ShapeRows, at: PeriodicPlace) -> list[FloatArray]:
    """Return what would have to act at a place at each sample to be left in the rows, by record.

    Filters are linear: weighted residuals that pass them backwards are sums of what each instant adds.
    """
    fit, setting = rows.fit, rows.setting
    kept = sorted({block.row for block in fit.blocks})
    left = {(block.record, block.row): index for index, block in enumerate(fit.blocks)}

    def samples_at(block: RowBlock, place: IntArray) -> IntArray:
        return block.start + setting.choice.decimation[block.record] * place

    def backwards(row: int) -> Effect:
        def changes(simulated: Simulated) -> Changes:
            index = left.get((simulated.index, row))
            if index is None:
                return {}
            block, n = fit.blocks[index], simulated.record.n
            grid = np.zeros(block.grid)
            grid[block.place] = fit.weights[index] ** 2 * fit.residuals[index]
            whole = np.interp(np.arange(n), samples_at(block, np.arange(block.grid)), grid, 0.0, 0.0)
            return at.changes(simulated, whole[::-1])

        return Effect(f"row {row} backwards", RIPPLE, "", "", "", changes)

    found = [np.zeros(record.n) for record in setting.records]
    grown = effect_rows(fit, setting, rows.simulated, [backwards(row) for row in kept])
    for row, column in zip(kept, grown, strict=True):
        for index, part in block_column(column).parts.items():
            block = fit.blocks[index]
            if block.row == row:
                samples = found[block.record]
                samples[len(samples) - 1 - samples_at(block, block.place)] += part
    return found
