"""What an arm carries in a record: its plant with that, and the forces that a motion needs with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant
from modelgen.runtime.simulation.arms.joint_motion import JointMotion


def loads_of(model: Model, record: Record) -> dict[str, FloatArray]:
    """Return which payloads a record carries at its samples, shape (n,) each; not those it never does."""
    said = {key: record.signals[key] for key in model.loads if key in record.keys}
    return {key: share for key, share in said.items() if share.any()}


def carrying(plant: ArmPlant, record: Record) -> ArmPlant:
    """Return a plant with the payloads that a record carries.

    Raises
    ------
    DataError
        When it takes one up on its way: what a hand does then is unknown.
    """
    loads = loads_of(plant.model, record)
    changing = [key for key, share in loads.items() if np.ptp(share) > 0.0]
    if changing:
        what = "changes within the record, and the closed loop is simulated with one payload at a time"
        raise DataError(*(Problem(f"{record.name}: {key}", what, "cut the record there") for key in changing))
    return replace(plant, carried={key: float(share[0]) for key, share in loads.items()})


def forces_of_motion(plant: ArmPlant, motion: JointMotion, record: Record) -> dict[str, FloatArray]:
    """Return what drives report along a motion, shape (n,) each, SI, with what a record carries.

    They are linear in what is carried.
    """
    empty = plant.driving_forces(motion.q, motion.v, motion.a)
    found = dict(empty)
    for key, share in loads_of(plant.model, record).items():
        loaded = replace(plant, carried={key: 1.0}).driving_forces(motion.q, motion.v, motion.a)
        found = {name: line + share * (loaded[name] - empty[name]) for name, line in found.items()}
    return found
