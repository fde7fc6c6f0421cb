"""A chain simulated under the measured forces alone, from the state that suits the record best.

Nothing ties it to the record: a chain that turns freely drifts with what the force or the friction lacks. The
state at the beginning is estimated from all of the record, as MATLAB's compare does (Gauss-Newton, in modes).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.prediction.thresholds import ROUNDS, SETTLED, STEP
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.motion import move, readings
from modelgen.runtime.simulation.plant import Plant, measured_forces

NO_FEEDBACK = PositionVelocityController(0.0, 0.0)


def open_loop_readings(
    plant: Plant, record: Record, start: FloatArray
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the state at the beginning, and what the sensors would read under the measured forces.

    Parameters
    ----------
    plant : Plant
    record : Record
        With the forces of all actuators, and at least one sensor.
    start : array, shape (2 bodies,)
        Positions, then velocities, from which the state at the beginning is looked for.

    Returns
    -------
    start : array, shape (2 bodies,)
    readings : mapping of str to array, shape (n,)
        Sensor to its reading in SI.

    Raises
    ------
    DataError
        When the record lacks a force, or the motion grows without bound.
    """
    force, further = measured_forces(plant, record)
    still = np.zeros(record.n)
    excitation = Excitation(still, still, force, record.fs, record.name, further)

    def simulated(x0: FloatArray) -> dict[str, FloatArray]:
        return readings(plant, move(plant, NO_FEEDBACK, Drive(), excitation, x0, 1))

    found = simulated(start)
    keys = [s.key for s in plant.model.sensors if s.key in record.signals]
    weight = {key: 1.0 / (float(np.std(record.signals[key])) or 1.0) for key in keys}

    def stacked(signals: Mapping[str, FloatArray]) -> FloatArray:
        return np.concatenate([weight[key] * signals[key] for key in keys])

    measured, directions = stacked(record.signals), _directions(plant, record, force)
    error = measured - stacked(found)
    if not np.isfinite(error).all():
        raise DataError.at(record.name, "cannot be simulated: the motion grows without bound",
                           "check the signs of force and sensors")  # fmt: skip
    for _ in range(ROUNDS):
        base = stacked(found)
        slopes = np.column_stack([stacked(simulated(start + d)) - base for d in directions.T])
        step = np.linalg.lstsq(slopes, error, rcond=1e-10)[0]
        tried = start + directions @ step
        after = simulated(tried)
        new = measured - stacked(after)
        if not new @ new < error @ error:
            break
        fell = 1.0 - float(new @ new) / float(error @ error)
        start, found, error = tried, after, new
        if fell < SETTLED:
            break
    return start, {key: found[key] for key in keys}


def _directions(plant: Plant, record: Record, force: FloatArray) -> FloatArray:
    """Return small steps of the state along each mode, positions then velocities, shape (states, states)."""
    n, root = len(plant.bodies), np.sqrt(plant.inertia)
    A = plant.space((1,) * len(plant.sticking)).A
    symmetric = -root[:, None] * A[n:, :n] / root
    squares, shapes = np.linalg.eigh(0.5 * (symmetric + symmetric.T))
    shapes = shapes / root[:, None]
    slowest = (2.0 * pi / record.duration_s) ** 2
    squares = np.maximum(squares, slowest)
    # how far the force moves each mode, at rest or over the record
    size = np.abs(shapes[plant.driven]) * float(np.sqrt(np.mean(force**2))) / squares
    size = np.maximum(size, 1e-6 * size.max()) if size.max() else np.ones(n)
    steps = np.zeros((2 * n, 2 * n))
    steps[:n, :n] = STEP * shapes * size
    steps[n:, n:] = STEP * shapes * (size * np.sqrt(squares))
    return steps
