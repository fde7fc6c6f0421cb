"""How far noise of measured forces pulls instruments, which these forces drive in their simulation.

What noise n of a force moves in the simulation, Z holds and W does not: E[Z^T Y] is too large by E[dZ^T n].
A chain takes power from any force, so its friction comes out too large, by as much in long records as in
short ones. Z moves as the chain does that a weak feedback holds (`HeldChain`), linear between reversals. A
noise of the same density is drawn, a random phase a frequency, and taken through all that the fit does to its
rows: masks, weights that make them white, columns of delays that are projected out.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.diagnostics.row_noise import row_noise
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.job import Job
from modelgen.runtime.iv.companion_simulation import possible
from modelgen.runtime.iv.held_motion import feedback_hz
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.simulation.held_chain import held_chain
from modelgen.runtime.simulation.plant import Plant, make_plant

# Noise is drawn in periods of so many samples at most, and of a multiple of so many that are kept: transforms
# of other lengths take far longer.
LONGEST_PERIOD, EVEN_LENGTH = 1 << 16, 1 << 10
# So often: masks, and rows that begin anew behind them, see parts of it.
DRAWS = 4


class DriveBias(NamedTuple):
    """By how much noise of the forces shifts an estimate, (c,) in SI, and `delays` estimated with it, in s.

    `spread`, (c, c), is the covariance of that number, and `share` the largest share of the instruments'
    power along a direction that is this noise.
    """

    shift: FloatArray
    delays: FloatArray
    spread: FloatArray
    share: float


def drive_bias(job: Job, fit: Fit) -> DriveBias:
    """Return by how much noise of the forces shifts an estimate by instruments of a chain.

    (Z^T W)^-1 E[dZ^T n]. The noises are those of `noise_floor`, white, and no more than each row leaves.

    Parameters
    ----------
    job : Job
        Whose records the fit is of.
    fit : Fit
        With instruments that the forces drive.
    """
    made, inverse = fit.regressors.made, fit.solution.inverse
    if fit.white is not None:
        made, inverse = fit.white.regressors.made, fit.white.inverse
    c = len(fit.columns)
    own = np.eye(c) if made is None else made[:c]
    plant = make_plant(job.model, possible(job.model, simulation_parameters(job.model, fit)))
    pushes = plant.space(tuple(1 for _ in plant.sticking)).B[len(plant.bodies) :] * plant.inertia[:, None]
    found, power = np.zeros((DRAWS, len(inverse))), np.zeros(inverse.shape)
    for draw in range(DRAWS):
        for actuator, push in zip(job.model.actuators, pushes.T, strict=True):
            for part in _weighed(fit, _drawn(job, fit, plant, actuator.key, push, draw)):
                along = own.T @ (part[:, :-1].T @ part)
                found[draw] += inverse @ along[:, -1]
                power += along[:, :-1] @ own / DRAWS
    share = np.linalg.eigvals(inverse @ power).real.max(initial=0.0)
    shift = found.mean(axis=0)
    apart = (found - shift)[:, :c]
    spread = apart.T @ apart / (DRAWS * (DRAWS - 1))
    # columns of delays stand behind the parameters'
    return DriveBias(shift[:c], shift[c : c + len(fit.delays)], spread, float(share))


def _weighed(fit: Fit, tables: Sequence[FloatArray]) -> list[FloatArray]:
    """Return rows of blocks as the fit weighs them, (n, columns), that repeat a table (period, columns)."""
    repeated = [block.place % len(table) for block, table in zip(fit.blocks, tables, strict=True)]
    if fit.white is None:
        # what is alike counts as often as it is there
        often = [np.bincount(at, minlength=len(table)) for at, table in zip(repeated, tables, strict=True)]
        each = zip(fit.weights, often, tables, strict=True)
        return [weight * (np.sqrt(times) * table.T).T for weight, times, table in each]
    parts, every = [t[at] for at, t in zip(repeated, tables, strict=True)], np.arange(tables[0].shape[1])
    return [white for white, _ in fit.white.rows.columns(parts, [every] * len(parts))]


def _drawn(job: Job, fit: Fit, plant: Plant, force: str, push: FloatArray, draw: int) -> list[FloatArray]:
    """Return what a noise of a force adds to instruments and, last, to Y: (period, c + 1) a block, in SI."""
    model, choice = job.model, job.choice
    places = [model.base_parameters.index(name) for name in fit.columns]
    x, found = fit.all_parameters(model.base_parameters), [np.zeros((0, 0))] * len(fit.blocks)
    for index, blocks in fit.by_record.items():
        record, factor = job.records[index], choice.decimation[index]
        noise, period = _answered(plant, record, choice, factor, force, push, [draw, index])
        rows = unmasked_rows(model, noise, choice, factor)
        for number in blocks:
            row = fit.blocks[number].row
            ways = noise_ways(model, record, choice, factor)[row]
            expected = row_noise(model, record, choice, factor, row, x)
            seen = min(1.0, fit.rms(number) / expected) if expected else 0.0
            lines = np.zeros((period, len(model.base_parameters) + 1))
            for channel, by_order in ways.slopes.items():
                slopes = np.array([slope.mean(axis=1) for slope in by_order.values()])
                moved = rows.derivatives(channel, [*by_order])[:period] @ slopes
                if channel == force:
                    lines[:, -1] += moved[:, -1]
                else:
                    lines[:, ways.columns] += moved[:, :-1]
            found[number] = seen * lines[:, [*places, -1]]
    return found


def _answered(
    plant: Plant,
    record: Record,
    choice: FilterChoice,
    factor: int,
    force: str,
    push: FloatArray,
    seed: list[int],
) -> tuple[Record, int]:
    """Return two periods of a force's noise, and of what the held chain answers to it, in place of a record.

    Channels that answer nothing are zero; a period is as many samples kept.
    """
    step = EVEN_LENGTH * factor
    n = -(-min(record.n, LONGEST_PERIOD) // step) * step
    omega = np.asarray(2.0 * pi * np.fft.rfftfreq(n, record.dt), dtype=float)
    phase = 2.0 * pi * np.random.default_rng(seed).random(len(omega))
    noise = np.sqrt(0.5 * record.facts.spectrum(force).noise * record.fs * n) * np.exp(1j * phase)
    noise[0] = 0.0
    held = held_chain(plant, omega, 2.0 * pi * feedback_hz(choice))
    read = [one.key for one in plant.model.sensors if one.key in record.signals]
    lines = {one: answer * noise for one, answer in held.read(read, push).items()} | {force: noise}
    signals = {one: np.tile(np.fft.irfft(line, n), 2) for one, line in lines.items()}
    none = np.zeros(2 * n)
    return Record({one: signals.get(one, none) for one in record.signals}, record.fs, "noise"), n // factor
