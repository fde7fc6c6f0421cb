"""How large the noise of the sensors is in a row: their noise behind filter and derivatives.

It is white, but for what encoders round: that follows the motion. At rest, or at a steady speed of nearly
whole steps a sample, its power lies at low frequencies, where rows that hold a spring let all of it through.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.diagnostics.thresholds import (
    FRICTION_OVER_REST,
    LARGEST_NOISE,
    LONGEST_ROUNDED,
    NULL_SHARE,
    WITHIN_INTERVAL,
)
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.signal_to_noise import noise_band
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.tails import chi_square_tail
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_block import RowBlock


def row_noise(
    model: Model,
    record: Record,
    choice: FilterChoice,
    factor: int,
    row: int,
    x: FloatArray,
    moved: Record | None = None,
    passed: Mapping[str, FloatArray] | None = None,
) -> float:
    """Return the rms that noise of the sensors gives Y - W x of a row, in its unit.

    Parameters
    ----------
    factor : int
        Decimation of the record.
    x : array, shape (columns,)
        All base parameters in the model's order, zero for those not in the fit.
    moved : Record, optional
        The motion without noise: encoders are taken to round that.
    passed : mapping of str to array, optional
        By channel the share of its noise's power that it has, in the lines of `noise_band`.
    """
    band, ways = noise_band(record, choice), noise_ways(model, record, choice, factor)[row].of_residual(x)
    total = float(ways.spread[0, 0])
    for key in ways.slopes:
        white = record.facts.spectrum(key).noise
        density = white if moved is None else _as_rounded(record, moved, key, white, band.frequency_hz)
        if passed and key in passed:
            density = density * passed[key]
        if isinstance(density, float):
            total += density * float(ways.products(key, band)[0, 0])
        else:
            total += float(np.sum(density * ways.spectrum(key, band.frequency_hz) * band.power))
    return sqrt(max(total, 0.0))


def rounded_motion(fit: Fit, index: int, record: Record, choice: FilterChoice) -> Record:
    """Return the motion that encoders round in a record: that of the simulation, or what a low-pass leaves.

    What rounding does in slow motion are lines, of which the floor, a median, is a part.
    """
    if fit.simulated and index in fit.simulated:
        return fit.simulated[index]

    def smoothed() -> Record:
        order, cutoff_hz = choice.filter_order, choice.cutoff_hz
        signals = dict(record.signals)
        for key in signals:
            if record.facts.rounding(key) > 0.0:
                signals[key] = zero_phase(signals[key], order, cutoff_hz, record.fs)
        return Record(signals, record.fs, record.name)

    short = record.n <= 3 * choice.filter_order or record.n > LONGEST_ROUNDED
    return record if short else record.facts.kept(("smoothed", choice), smoothed)


def block_noise(
    fit: Fit, index: int, model: Model, record: Record, choice: FilterChoice, rounded: bool = False
) -> float:
    """Return the rms that noise of the sensors gives what a block of a fit leaves, in its row's unit.

    `rounded` says whether encoders round the motion where nothing is simulated, too (`rounded_motion`).
    """
    block, x = fit.blocks[index], fit.all_parameters(model.base_parameters)
    if rounded:
        moved: Record | None = rounded_motion(fit, block.record, record, choice)
    else:
        moved = (fit.simulated or {}).get(block.record)
    return row_noise(model, record, choice, choice.decimation[block.record], block.row, x, moved)


def _as_rounded(
    record: Record, moved: Record, key: str, white: float, frequency_hz: FloatArray
) -> FloatArray | float:
    """Return the density of a reading's noise at some frequencies: that of its rounding where it is more."""
    step = record.facts.rounding(key) if key in moved.signals else 0.0
    if step <= 0.0 or record.n > LONGEST_ROUNDED:
        return white
    density = moved.facts.kept(("rounded", key, step), lambda: _rounding(moved.signals[key], step, moved.fs))
    # cells of the band and lines of the spectrum: what lies in a cell is spread over it
    width_hz = 2.0 * float(frequency_hz[0])
    cell = np.round(np.fft.rfftfreq(moved.n, 1.0 / moved.fs) / width_hz - 0.5).astype(int).clip(0)
    inside = cell < len(frequency_hz)
    line_hz = moved.fs / moved.n
    found = np.bincount(cell[inside], density[inside], len(frequency_hz)) * line_hz / width_hz
    return np.asarray(np.maximum(found, white))


def _rounding(samples: FloatArray, step: float, fs: float) -> FloatArray:
    """Return the one-sided density of what rounding changes, (lines,), for zeros half a step apart."""
    total = np.zeros(len(samples) // 2 + 1)
    for zero in (0.0, 0.5):
        changed = step * (np.round(samples / step + zero) - zero) - samples
        total += np.abs(np.fft.rfft(changed)) ** 2
    total[1:] *= 2.0
    return total / (2.0 * fs * len(samples))


def exceeding_noise(
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    fit: Fit,
    multiple: float,
    share: float = 0.0,
    rounded: bool = False,
) -> list[tuple[RowBlock, float]]:
    """Return the blocks that leave more than noise of the sensors explains, and what share they leave.

    Parameters
    ----------
    multiple : float
        Of the noise, that a residual exceeds.
    share : float
        Of its largest term, that it leaves.
    rounded : bool
        As for `block_noise`.
    """
    found = []
    for index, (block, left) in enumerate(zip(fit.blocks, fit.left_shares, strict=True)):
        noise = block_noise(fit, index, model, records[block.record], choice, rounded)
        if left > share and fit.rms(index) > multiple * noise:
            found.append((block, left))
    return found


def hardly_weighed(fit: Fit, index: int) -> bool:
    """Return whether some values within the intervals explain a row without a force, which the fit does not.

    Such a row weighs no more than those with forces, and what it says of the ratios of its parameters is lost
    where these leave more: the estimate may lie many times its terms beside what would balance it. The ratios
    that balance it best are those of the smallest singular value; of what is proportional to them the joint
    95 % interval must hold some, and not because it holds zero, which balances every row.
    """
    block = fit.blocks[index]
    balanced = None if block.has_force else best_ratios(block, len(fit.columns))
    if balanced is None:
        return False
    at, along, share = balanced
    if share >= NULL_SHARE:
        return False
    covariance = hac_covariance(fit)[np.ix_(at, at)]
    deviation = np.sqrt(np.maximum(np.diag(covariance), float(np.finfo(float).tiny)))
    inverse = np.linalg.pinv(covariance / np.outer(deviation, deviation), hermitian=True)
    found, along = fit.solution.x[at] / deviation, along / deviation
    zero, explained = float(found @ inverse @ found), float(along @ inverse @ found) ** 2
    explained /= float(along @ inverse @ along)
    near = chi_square_tail(zero - explained, len(at) - 1) >= WITHIN_INTERVAL
    return near and chi_square_tail(explained, 1) < WITHIN_INTERVAL


def best_ratios(block: RowBlock, width: int) -> tuple[IntArray, FloatArray, float] | None:
    """Return which of all columns a row holds, the ratios that balance it best, in SI, and what these leave.

    The first two of shape (n,). They are those of the smallest singular value, of columns of length one; what
    is left is a share of the largest term. None where the row holds a single column.
    """
    at = np.arange(width) if block.touched is None else block.touched
    entries = block.triangle[:, 1:-1]
    length = np.linalg.norm(entries, axis=0)
    at, entries, length = at[length > 0.0], entries[:, length > 0.0], length[length > 0.0]
    if len(at) < 2:
        return None
    least, ratios = (one[-1] for one in np.linalg.svd(entries / length)[1:])
    return at, ratios / length, float(least / np.max(np.abs(ratios)))


def drowned_friction(
    model: Model,
    records: Sequence[Record],
    choice: FilterChoice,
    fit: Fit,
    reasons: Mapping[str, str],
) -> dict[str, str]:
    """Return those of frictions in vibration that what the model lacks may have made, with the reason.

    Where the residual of the rows that hold a friction is noise, its standard deviation says all. Otherwise
    forces that the model lacks are about as large as the residual, and friction must stand out of them.

    Parameters
    ----------
    reasons : mapping of str to str
        Base columns that are friction in vibration alone, with the reason to doubt them.
    """
    exceeding = exceeding_noise(model, records, choice, fit, LARGEST_NOISE)
    lacking = {(block.record, block.row) for block, _ in exceeding}
    found = {}
    for name, reason in reasons.items():
        if name not in fit.columns:
            continue
        index = fit.columns.index(name)
        rows = [
            (abs(float(fit.solution.x[index])) * block.column_norm(index), left)
            for block, left in zip(fit.blocks, fit.residual_norms, strict=True)
            if (block.record, block.row) in lacking and block.column_norm(index) > 0.0
        ]
        force = sqrt(sum(size**2 for size, _ in rows))
        rest = sqrt(sum(left**2 for _, left in rows))
        if rows and force < FRICTION_OVER_REST * rest:
            share = f"there {name} gives {force / rest:.2g} times what the model leaves unexplained"
            found[name] = f"{reason}; {share}"
    return found
