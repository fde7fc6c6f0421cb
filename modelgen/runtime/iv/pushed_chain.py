"""What a further force changes in the readings of a chain, and how the bodies feel a link.

The chain is linear between reversals: the change is worked out at all frequencies at once. A feedback holds
the chain; rows do not feel it, as the force that it takes is one of the readings.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.thresholds import HOLDING_SHARE
from modelgen.runtime.simulation.closed_loop import vibration
from modelgen.runtime.simulation.plant import Plant, felt_accelerations


def deflection_of(plant: Plant, stiffness: str) -> FloatArray:
    """Return the deflection of the link of a stiffness per motion of each body, shape (bodies,).

    From the direct model: A falls by (lever / inertia) lever^T per unit of stiffness.
    """
    n = len(plant.bodies)
    mode = tuple(1 for _ in plant.sticking)
    more = Plant(plant.model, {**plant.parameters, stiffness: plant.parameters[stiffness] + 1.0},
                 plant.bodies, plant.inertia, plant.actuator, plant.driven)  # fmt: skip
    square = -plant.inertia[:, None] * (more.space(mode).A - plant.space(mode).A)[n:, :n]
    size = np.sqrt(np.maximum(np.diag(square), 0.0))
    first = int(np.argmax(size))
    return np.asarray(square[first] / (size[first] or 1.0))


def pushed(simulated: Simulated, push: FloatArray, force: FloatArray) -> Mapping[str, FloatArray]:
    """Return what a further force changes in the channels.

    Parameters
    ----------
    push : array, shape (bodies,)
        How it acts on the bodies.
    force : array, shape (n,)
        In N m or N.

    Returns
    -------
    mapping of str to array, shape (n,)
    """
    plant, record = simulated.plant, simulated.record
    n, size = len(plant.bodies), quick_length(record.n)
    padded = np.concatenate([force, np.linspace(force[-1], force[0], size - record.n + 2)[1:-1]])
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(size, record.dt), dtype=float)
    space = plant.space(tuple(1 for _ in plant.sticking))
    at = tuple(push.tolist())
    if at not in simulated.response:
        simulated.response.clear()  # it is as long as the record: one of them is kept
        simulated.response[at] = _held_response(plant, space, push, omega)
    states, held = simulated.response[at]
    spectrum = np.fft.rfft(padded)
    # accelerations are what velocities change by
    rates = 1j * omega[:, None] * states[:, n:]
    felt = felt_accelerations(plant.model)
    found = {}
    for place, sensor in enumerate(plant.model.sensors):
        way = rates @ felt[place] if sensor.order == 2 else states @ space.C[place]
        found[sensor.key] = np.fft.irfft(way * spectrum, size)[: record.n]
    found[plant.force] = np.fft.irfft(held * spectrum, size)[: record.n]
    return {key: samples for key, samples in found.items() if key in record.signals}


def _held_response(
    plant: Plant, space: Any, push: FloatArray, omega: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return states, shape (frequencies, 2 bodies), and the holding force, per unit of a force `push`."""
    n = len(plant.bodies)
    A, B = space.A, space.B[:, plant.actuator]
    modes = vibration(plant)
    rate = (
        HOLDING_SHARE * 2.0 * np.pi * float(modes.elastic_hz[0] if modes.elastic_hz.size else 1.0 / omega[1])
    )
    gains = np.zeros(2 * n)
    gains[plant.driven] = modes.drive_inertia * rate**2
    gains[n + plant.driven] = 2.0 * modes.drive_inertia * rate
    drive = np.r_[np.zeros(n), push / plant.inertia]
    held = A - np.outer(B, gains)
    values, vectors = np.linalg.eig(held)
    modal = np.linalg.solve(vectors, drive)
    states = (modal / (1j * omega[:, None] - values)) @ vectors.T
    return states, -(states @ gains)
