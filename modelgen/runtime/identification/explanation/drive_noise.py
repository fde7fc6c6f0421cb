"""How far noise of measured forces pulls instruments, which these forces drive in their simulation.

What noise n of a force moves in the simulation, Z holds and W does not: E[Z^T Y] is too large by E[dZ^T n].
A chain takes power from any force, so its friction comes out too large, by as much in long records as in
short ones. Z moves as the chain at rest does, which a weak feedback holds (`HeldChain`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.diagnostics.noise_ways import NoiseWays, noise_ways
from modelgen.runtime.diagnostics.row_noise import noise_band, row_noise
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.iv.companion_simulation import possible
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.held_chain import HeldChain, held_chain
from modelgen.runtime.simulation.plant import make_plant

# Frequencies between which a resonance is not to fall.
LINES = 1 << 14


def drive_bias(model: Model, records: Sequence[Record], choice: FilterChoice, fit: Fit) -> FloatArray:
    """Return by how much noise of the forces shifts an estimate by instruments of a chain, shape (c,).

    (Z^T W)^-1 E[dZ^T n], with (W^T P_Z W)^-1 for the inverse: too much by the share of Z that is noise. The
    noises are those of `noise_floor`, white, and no more than each row leaves.
    """
    place = np.full(len(model.base_parameters), -1)
    place[[model.base_parameters.index(name) for name in fit.columns]] = np.arange(len(fit.columns))
    x = fit.all_parameters(model.base_parameters)
    plant = make_plant(model, possible(model, simulation_parameters(model, fit)))
    pushes = plant.space(tuple(1 for _ in plant.sticking)).B[len(plant.bodies) :] * plant.inertia[:, None]
    crossed, held = np.zeros(len(fit.columns)), dict[int, HeldChain]()
    for index, (block, weight) in enumerate(zip(fit.blocks, fit.weights, strict=True)):
        record, factor = records[block.record], choice.decimation[block.record]
        frequency_hz, power = noise_band(record, choice, LINES)
        if block.record not in held:
            held[block.record] = held_chain(plant, 2.0 * np.pi * frequency_hz)
        ways = noise_ways(model, record, choice, factor)[block.row]
        expected = row_noise(model, record, choice, factor, block.row, x)
        most = min(1.0, (fit.rms(index) / expected) ** 2) if expected else 0.0
        for actuator, push in zip(model.actuators, pushes.T, strict=True):
            if actuator.key in ways.slopes:
                along = _along(ways, held[block.record], actuator.key, push, power)
                own = np.flatnonzero(place[ways.columns] >= 0)
                noise = most * weight**2 * block.count * record.facts.spectrum(actuator.key).noise
                crossed[place[ways.columns[own]]] += noise * along[own]
    return np.asarray(fit.solution.inverse @ crossed)


def _along(ways: NoiseWays, held: HeldChain, key: str, push: FloatArray, power: FloatArray) -> FloatArray:
    """Return E[dZ n] of each column of a row, shape (c,), per unit of the density of a force's noise."""
    moved = {one: slopes for one, slopes in ways.slopes.items() if one in held.readings and one != key}
    answers, s, total = held.read(moved, push), 1j * held.omega, np.zeros(len(ways.columns))
    left = {order: float(slope[-1].mean()) for order, slope in ways.slopes[key].items()}
    felt = sum(slope * s**order for order, slope in left.items())
    for channel, slopes in moved.items():
        for order, slope in slopes.items():
            total += slope[:-1].mean(axis=1) * float(
                np.real(np.conj(felt) * s**order * answers[channel]) @ power
            )
    return np.asarray(total)
