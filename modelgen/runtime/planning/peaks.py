"""The largest travel, velocity, force and deflection of simulated experiments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modelgen.runtime.simulation.closed_loop import vibration
from modelgen.runtime.simulation.plant import Plant
from modelgen.runtime.simulation.simulate import Simulation

LIMITS = ("position", "velocity", "force", "deflection")


def peaks_of(plant: Plant, simulations: Sequence[Simulation]) -> dict[str, float]:
    """Return the largest travel, velocity, force and deflection of the simulations (SI)."""
    gears = vibration(plant).lowest
    key = plant.model.actuators[plant.actuator].key
    peaks = dict.fromkeys(LIMITS, 0.0)
    links = [
        role.bodies
        for role in plant.model.roles.values()
        if role.role == "stiffness" and len(role.bodies) == 2
    ]
    for found in simulations:
        q = {body: found.true[f"q_{body}"] for body in plant.bodies}
        travel = {body: array - array[0] for body, array in q.items()}
        rigid = {body: travel[body] / gears[i] for i, body in enumerate(plant.bodies) if gears[i]}
        reached = {
            "position": max(float(np.abs(array).max()) for array in travel.values()),
            "velocity": max(float(np.abs(found.true[f"v_{body}"]).max()) for body in plant.bodies),
            "force": float(np.abs(found.true[key]).max()),
            "deflection": max(
                (float(np.abs(rigid[a] - rigid[b]).max()) for a, b in links if a in rigid and b in rigid),
                default=0.0,
            ),
        }
        peaks = {name: max(peaks[name], reached[name]) for name in LIMITS}
    return peaks
