"""Sensors that count the other way round: two positions (or velocities) that move against each other."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.mechanical_parts import Sensor
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.mapping_file import Proposed
from modelgen.runtime.simulation.closed_loop import rigid_motion

# Means of so many stretches show the slow motion, in which a chain moves as a rigid one: above a resonance
# its bodies do move against each other.
STRETCHES = 50
LEAST_SLOW = 0.05  # of the whole range: less slow motion than this shows nothing
AGAINST = -0.98  # correlation


def with_reversed(
    proposed: Sequence[Proposed], model: Model | None, columns: Mapping[str, FloatArray]
) -> tuple[Proposed, ...]:
    """Return the proposal with `negate` set for sensors that move against the one on the driven body.

    Parameters
    ----------
    proposed : sequence of Proposed
    model : Model, optional
        Says which way a rigid chain turns; nothing is reversed without one.
    columns : mapping of str to ndarray, shape (n,)
        The samples of the file.
    """
    moves = rigid_motion(model) if model else {}
    if not model or not moves:
        return tuple(proposed)
    entries = {entry.key: entry for entry in proposed}
    for first, sensor in _pairs(model, moves, entries, columns):
        one, other = (columns[str(entries[s.key].column)] for s in (first, sensor))
        sign = np.sign(moves[str(first.body)] * moves[str(sensor.body)])
        together = sign * _slow_correlation(one, other)
        if together < AGAINST:
            entry = entries[sensor.key]
            why = f"it moves against {first.key} (correlation {together:.4f}), so negate it"
            why = f"{entry.why}; {why}: --map {shlex.quote(f'{entry.key}=-{entry.column}')}"
            entries[sensor.key] = replace(entry, negate=True, why=why)
    return tuple(entries[entry.key] for entry in proposed)


def _pairs(
    model: Model,
    moves: Mapping[str, float],
    entries: Mapping[str, Proposed],
    columns: Mapping[str, FloatArray],
) -> list[tuple[Sensor, Sensor]]:
    """Return pairs of sensors of one kind and as many samples, the one on the driven body first."""
    driven = model.actuators[0].body
    found = []
    for kind in ("position", "velocity"):
        sensors = [
            sensor
            for sensor in model.sensors
            if sensor.measures == kind
            and moves.get(sensor.body or "")
            and sensor.key in entries
            and entries[sensor.key].column in columns
        ]
        sensors.sort(key=lambda sensor: sensor.body != driven)
        found += [(sensors[0], sensor) for sensor in sensors[1:]]
    size = {key: columns[str(entry.column)].size for key, entry in entries.items() if entry.column in columns}
    return [(one, other) for one, other in found if size[one.key] == size[other.key]]


def _slow_correlation(one: FloatArray, other: FloatArray) -> float:
    """Return the correlation of the slow parts, or 0 where there is hardly one."""
    if one.size < 2 * STRETCHES or not (np.isfinite(one).all() and np.isfinite(other).all()):
        return 0.0
    slow = [np.array([part.mean() for part in np.array_split(array, STRETCHES)]) for array in (one, other)]
    ranges = [np.ptp(array) for array in (one, other)]
    if any(np.ptp(part) <= LEAST_SLOW * whole for part, whole in zip(slow, ranges, strict=True)):
        return 0.0
    a, b = (part / whole - np.mean(part / whole) for part, whole in zip(slow, ranges, strict=True))
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))
