"""How far noise of measured forces pulls instruments, which these forces drive in their simulation.

What noise n of a force moves in the simulation, Z holds and W does not: E[Z^T Y] is too large by E[dZ^T n].
A chain takes power from any force, so its friction comes out too large, by as much in long records as in
short ones. Where a body is not seen, rows differentiate forces, and columns hold them: n is what the noise
changes of Y - W X, and Z holds the force itself as well. Z moves as the chain does that a weak feedback holds
(`HeldChain`), linear between reversals. A noise of the same density is drawn, a random phase a frequency, and
taken through all that the fit does to its rows: masks, weights that make them white, columns of delays that
are projected out, physical parameters in place of their sums.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.diagnostics.residual_whiteness import largest_density
from modelgen.runtime.diagnostics.row_noise import row_noise
from modelgen.runtime.diagnostics.thresholds import MOST_SAMPLES
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.noise_spectrum import calm_noise
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import MOST_DRIVEN
from modelgen.runtime.iv.held_motion import feedback_hz
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.efficient_weights import block_whiteners
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.thresholds import WHITENING_ORDER
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.row_block import runs_of
from modelgen.runtime.simulation.held_chain import held_chain
from modelgen.runtime.simulation.plant import Plant, make_plant, possible

# rows of each block, with which columns these are
Tables = Sequence[tuple[FloatArray, IntArray]]

# Noise is drawn in periods of so many samples at most, and of a multiple of so many that are kept: transforms
# of other lengths take far longer. Periods of more than a few forces are shorter: all are in memory.
LONGEST_PERIOD, EVEN_LENGTH, FEW_FORCES = 1 << 16, 1 << 10, 4
# So often over all forces: masks, and rows that begin anew behind them, see parts of it.
DRAWS, FEWEST_DRAWS = 4, 2
# Where rows leave less than this share of a force's floor, something else than noise stands in it.
MOSTLY_NOISE = 0.5
# A floor that is this share of another record's, or that the calmest samples show, is the noise of both.
FLOORS_APART = 0.25
# Steps in which the largest share comes out to some percent.
POWER_STEPS = 20


class DriveBias(NamedTuple):
    """By how much noise of the forces shifts an estimate, (c,) in SI, and `delays` estimated with it, in s.

    `spread`, (c, c), is the covariance of that number, and `share` the largest share of the instruments'
    power along a direction that is this noise. It is `at_most` so much where what stands in a force's floor
    is no noise alone. `carried` is the shift of all columns of the fit of physical parameters, if it was one.
    """

    shift: FloatArray
    delays: FloatArray
    spread: FloatArray
    share: float
    at_most: bool = False
    carried: FloatArray | None = None


def drive_bias(job: Job, fit: Fit) -> DriveBias:
    """Return by how much noise of the forces shifts an estimate by instruments of a chain.

    (Z^T W)^-1 E[dZ^T n]. The noises are white, at the readings' floors, no more than rows leave in any band.

    Parameters
    ----------
    job : Job
        Whose records the fit is of.
    fit : Fit
        With instruments that the forces drive.
    """
    estimated = fit if fit.carried is None else fit.carried.linear
    made, inverse = estimated.regressors.made, estimated.solution.inverse
    if fit.white is not None:
        made, inverse = fit.white.regressors.made, fit.white.inverse
    c = len(estimated.columns)
    own = np.eye(c) if made is None else made[:c]
    plant = make_plant(job.model, possible(job.model, simulation_parameters(job.model, fit)))
    draws = max(FEWEST_DRAWS, DRAWS // len(job.model.actuators))
    passed = {index: _passed(job, fit, index) for index in fit.by_record}
    found, power = np.zeros((draws, len(inverse))), np.zeros((c + 1, c + 1))
    slope = None if fit.carried is None else _slope(job, fit)
    weighed = partial(_weighed, fit) if slope is None else _of_physical(job, fit, slope, c)
    for draw in range(draws):
        products = np.zeros((c + 1, c + 1))
        for part, places in weighed(_drawn(job, fit, plant, passed, draw)):
            products[np.ix_(places, places)] += part.T @ part
        found[draw] = own.T @ products[:c, c]
        power += products / draws
    noisy = own.T @ power[:c, :c] @ own
    if slope is not None:
        inverse = _known(inverse, noisy)
    found, share = found @ inverse, _largest(inverse, noisy)
    shift = found.mean(axis=0)
    at_most = min(float(one) for shares in passed.values() for one in shares.values()) < MOSTLY_NOISE
    apart = (found - shift) / sqrt(draws * (draws - 1))
    if slope is not None:
        p = slope.shape[1]
        moves, late = apart[:, :p] @ slope.T, shift[p : p + len(fit.delays)]
        return DriveBias(slope @ shift[:p], late, moves.T @ moves, share, at_most, shift)
    # columns of delays stand behind the parameters' where rows are white, and are projected out elsewhere
    late = shift[c : c + len(fit.delays)] if fit.white is not None else _of_delays(job, fit, shift)
    return DriveBias(shift[:c], late, apart[:, :c].T @ apart[:, :c], share, at_most)


def _known(inverse: FloatArray, noisy: FloatArray) -> FloatArray:
    """Return the inverse of a fit of physical parameters, (c, c), less the directions that are mostly noise.

    Rows are not linear as far as these go, and what noise does there is not known: an overdamped load and a
    delay are told apart by next to nothing. `noisy` is the part of the inverse's inverse that is noise.
    """
    scale = np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny))
    size, along = np.linalg.eigh(inverse / np.outer(scale, scale))
    root = scale[:, None] * along * np.sqrt(np.maximum(size, 0.0))
    shares, turned = np.linalg.eigh(root.T @ noisy @ root)
    kept = root @ turned[:, shares <= MOST_DRIVEN]
    return np.asarray(kept @ kept.T)


def _slope(job: Job, fit: Fit) -> FloatArray:
    """Return how the columns of a fit grow with the physical parameters that it was carried over from."""
    slope = job.model.base_jacobian(simulation_parameters(job.model, fit))
    return np.asarray(slope[[job.model.base_parameters.index(name) for name in fit.columns]])


def _of_physical(job: Job, fit: Fit, slope: FloatArray, c: int) -> Callable[[Tables], Tables]:
    """Return what takes rows in base columns to those of a fit of physical parameters, which are white.

    That has c columns, and Y counts as the one behind them.
    """
    white_rows = block_whiteners(fit, job.choice.steps_s(job.records), WHITENING_ORDER)
    places = np.append(np.arange(slope.shape[1]), c)

    def weighed(tables: Tables) -> Tables:
        found = []
        for block, white_of, (table, own) in zip(fit.blocks, white_rows, tables, strict=True):
            rows = np.column_stack([table[:, :-1] @ slope[own[:-1]], table[:, -1]])
            found.append((white_of(rows[block.place % len(rows)], block.place), places))
        return found

    return weighed


def _of_delays(job: Job, fit: Fit, shift: FloatArray) -> FloatArray:
    """Return by how much delays shift, in s, (delays,), that are estimated with parameters that shift, (c,).

    Their columns are their own instruments: they take up what they can of W times that shift.
    """
    if not fit.delays:
        return np.zeros(0)
    late = {channel: delay for channel, delay, _ in fit.delays}
    records = tuple(advanced(record, late) for record in job.records)
    rates = [job.rates(fit, records, channel) for channel in late]
    blocks = list(zip(fit.weights, fit.blocks, zip(*rates, strict=True), strict=True))
    columns = np.concatenate([weight * np.column_stack(own) for weight, _, own in blocks])
    moved = np.concatenate([weight * (block.W @ block.own(shift)) for weight, block, _ in blocks])
    return np.asarray(np.linalg.lstsq(columns, moved, rcond=None)[0])


def _largest(inverse: FloatArray, power: FloatArray) -> float:
    """Return the largest eigenvalue of the product of two that have none below zero, (c, c) each."""
    scale = np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny))
    inner, outer = inverse / np.outer(scale, scale), power * np.outer(scale, scale)
    along, size = np.ones(len(scale)), 0.0
    for _ in range(POWER_STEPS):
        along = inner @ (outer @ along)
        size = float(np.linalg.norm(along))
        if size == 0.0:
            break
        along = along / size
    return size


def _weighed(fit: Fit, tables: Tables) -> Tables:
    """Return rows of blocks as the fit weighs them, and which columns these are, that repeat a table each."""
    repeated = [block.place % len(table) for block, (table, _) in zip(fit.blocks, tables, strict=True)]
    places = [own for _, own in tables]
    if fit.white is None:
        # what is alike counts as often as it is there
        often = [np.bincount(at, minlength=len(t)) for at, (t, _) in zip(repeated, tables, strict=True)]
        each = zip(fit.weights, often, tables, strict=True)
        return [(weight * (np.sqrt(times) * t.T).T, own) for weight, times, (t, own) in each]
    return fit.white.rows.columns([t[at] for at, (t, _) in zip(repeated, tables, strict=True)], places)


def _drawn(
    job: Job, fit: Fit, plant: Plant, passed: Mapping[int, Mapping[str, FloatArray]], draw: int
) -> list[tuple[FloatArray, IntArray]]:
    """Return what noise of the forces adds to instruments and, last, to Y - W X, and which columns these are.

    One pair a block, (period, k + 1) in SI and (k + 1,); Y counts as the column behind all.
    """
    model, choice, c = job.model, job.choice, len(fit.columns)
    position = np.full(len(model.base_parameters), -1)
    position[[model.base_parameters.index(name) for name in fit.columns]] = np.arange(c)
    x, forces = fit.all_parameters(model.base_parameters), {one.key for one in model.actuators}
    found = [(np.zeros((0, 0)), np.zeros(0, dtype=np.int64))] * len(fit.blocks)
    for index, blocks in fit.by_record.items():
        record, factor = job.records[index], choice.decimation[index]
        noise, period = _answered(plant, record, choice, factor, passed[index], [draw, index])
        rows, derivatives = unmasked_rows(model, noise, choice, factor), dict[str, FloatArray]()
        for number in blocks:
            row = fit.blocks[number].row
            ways = noise_ways(model, record, choice, factor)[row]
            expected = row_noise(model, record, choice, factor, row, x, passed=passed[index])
            seen = min(1.0, fit.rms(number) / expected) if expected else 0.0
            lines = np.zeros((period, len(ways.columns) + 1))
            for channel, by_order in ways.slopes.items():
                slopes = np.array([slope.mean(axis=1) for slope in by_order.values()])
                key = f"{channel} {[*by_order]}"
                if key not in derivatives:
                    derivatives[key] = rows.derivatives(channel, [*by_order])[:period]
                moved = derivatives[key] @ slopes
                lines[:, :-1] += moved[:, :-1]
                if channel in forces:
                    lines[:, -1] += moved[:, -1] - moved[:, :-1] @ x[ways.columns]
            places = np.append(position[ways.columns], c)
            kept = np.flatnonzero(places >= 0)
            kept = kept[np.argsort(places[kept])]
            found[number] = seen * lines[:, kept], places[kept]
    return found


def _passed(job: Job, fit: Fit, index: int) -> Mapping[str, FloatArray]:
    """Return by force the share of its floor that may be noise in a record: rows that hold it leave no less.

    Above a filter's band may stand what moves the machine, such as the edges of a pseudorandom binary force:
    few samples feel them, and another record does not hold them.
    """
    x, record, shares = fit.all_parameters(job.model.base_parameters), job.records[index], {}
    left = [(fit.blocks[number], _left(fit, number)) for number in fit.by_record[index]]
    for key in (one.key for one in job.model.actuators):
        floor = record.facts.spectrum(key).noise
        most = [
            largest_density(job.model, record, block, residuals, x, job.choice, key)
            for block, residuals in left
        ]
        others = [one.facts.spectrum(key).noise for one in job.records if key in one.signals]
        calm = calm_noise(record.read(key, 0, min(record.n, MOST_SAMPLES)), record.fs)
        least = min(one for one in (calm, floor, *others) if one > 0.0 or one == floor)
        apart = [least] if least < FLOORS_APART * floor else []
        shares[key] = np.asarray(
            min([1.0, *(one / floor for one in (*most, *apart))]) if floor > 0.0 else 1.0
        )
    return shares


def _left(fit: Fit, number: int) -> list[FloatArray]:
    """Return what a row leaves of stretches without a gap; of rows that are made again the longest one."""
    block = fit.blocks[number]
    if block.in_memory:
        return [fit.residuals[number][run] for run in runs_of(block.place)]
    return [fit.fitted(number, block.longest_run(MOST_SAMPLES)).residual]


def _answered(
    plant: Plant,
    record: Record,
    choice: FilterChoice,
    factor: int,
    passed: Mapping[str, FloatArray],
    seed: list[int],
) -> tuple[Record, int]:
    """Return two periods of the forces' noise, and of what the held chain answers to it, as a record.

    A period is as many samples kept; of a force's floor the share `passed` is noise.
    """
    actuators, step = plant.model.actuators, EVEN_LENGTH * factor
    longest = LONGEST_PERIOD // -(-len(actuators) // FEW_FORCES)
    n = -(-min(record.n, longest) // step) * step
    omega = np.asarray(2.0 * pi * np.fft.rfftfreq(n, record.dt), dtype=float)
    phases = 2.0 * pi * np.random.default_rng(seed).random((len(actuators), len(omega)))
    densities = np.array([float(passed[one.key]) * record.facts.spectrum(one.key).noise for one in actuators])
    noise = np.sqrt(0.5 * record.fs * n * densities)[:, None] * np.exp(1j * phases)
    noise[:, 0] = 0.0
    pushes = plant.space(tuple(1 for _ in plant.sticking)).B[len(plant.bodies) :] * plant.inertia[:, None]
    held = held_chain(plant, omega, 2.0 * pi * feedback_hz(choice))
    lines = held.driven(pushes @ noise) | {one.key: line for one, line in zip(actuators, noise, strict=True)}
    signals = {key: np.tile(np.fft.irfft(line, n), 2) for key, line in lines.items() if key in record.signals}
    none = np.zeros(2 * n)
    return Record({key: signals.get(key, none) for key in record.signals}, record.fs, "noise"), n // factor
