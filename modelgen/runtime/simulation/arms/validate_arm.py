"""An arm validated: its closed loop along the records' references, measured and simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, listed
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, refuse_lacking
from modelgen.runtime.records.same_data import is_held_out, refuse_same_data
from modelgen.runtime.simulation.arms.arm_coordinates import joint_units
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant, arm_plant
from modelgen.runtime.simulation.arms.carried_payloads import carrying
from modelgen.runtime.simulation.arms.followed_reference import followed, nodes_a_sample, true_signals
from modelgen.runtime.simulation.arms.joint_controller import JointController
from modelgen.runtime.simulation.arms.joint_motion import JointMotion, motion_of
from modelgen.runtime.simulation.arms.joint_reference import JointReference
from modelgen.runtime.simulation.arms.measured_motion import measured_motion
from modelgen.runtime.simulation.thresholds import CUTOFF_SHARE, FILTER_ORDER
from modelgen.runtime.simulation.validation import SignalCheck, Validation

REFERENCES = ("reference", "reference_rate", "reference_acceleration")


def base_values(model: Model, parameters: Mapping[str, float]) -> tuple[FloatArray, tuple[str, ...]]:
    """Return base parameters, shape (columns,), SI, from values by name, and the names that are absent.

    All physical parameters will do as well; what is absent counts as zero.

    Raises
    ------
    DataError
        When no value is of the model.
    """
    if all(name in parameters for name in model.parameters):
        return model.base_from_physical({name: parameters[name] for name in model.parameters}), ()
    found = np.array([parameters.get(name, 0.0) for name in model.base_parameters], dtype=float)
    absent = tuple(name for name in model.base_parameters if name not in parameters)
    if len(absent) == len(model.base_parameters):
        remedy = f"give base parameters: {listed(model.base_parameters)}"
        raise DataError.at("parameters", "hold none of the model", remedy)
    return found, absent


def taken_as_zero(absent: Sequence[str]) -> tuple[str, ...]:
    """Return what a validation says of parameters without a number."""
    return (f"taken as zero: {listed(absent)}",) if absent else ()


def validate_arm(
    model: Model,
    parameters: Mapping[str, float],
    records: Sequence[Record],
    controller: JointController,
    *,
    used: Sequence[str] = (),
) -> tuple[Validation, ...]:
    """Simulate every record's references in closed loop and compare positions, errors and forces.

    Parameters
    ----------
    model : Model
    parameters : mapping of str to float
        Base parameters by name (`Estimate.params`), or all physical ones (SI); what is absent counts as zero.
    records : sequence of Record
        With the channels of the model and ``reference_NAME`` of every joint; without
        ``reference_rate_NAME`` and ``reference_acceleration_NAME`` of all, these are those of splines.
    controller : JointController
        The loop in which the records were made.
    used : sequence of str
        Records that the parameters were identified from, `Estimate.identified_from`: their contents, or their
        names; the others are held out.

    Raises
    ------
    DataError
        When a channel is missing, records hold the same data, the motion runs away, or a payload is taken up
        within a record.
    """
    needed = (*model.channels, *(f"reference_{name}" for name in joint_units(model)))
    needed = tuple(key for key in needed if key not in model.derived)
    refuse_lacking(records, needed, model.channel_units)
    refuse_same_data(records, model.channels)
    base, absent = base_values(model, parameters)
    plant = arm_plant(model, base, tame=True)
    return tuple(
        _validated(
            plant, record, controller, is_held_out(record, model.channels, used), taken_as_zero(absent)
        )
        for record in records
    )


def _validated(
    plant: ArmPlant, record: Record, controller: JointController, held_out: bool, notes: tuple[str, ...]
) -> Validation:
    model, given, plant = plant.model, record.signals, carrying(plant, record)
    reference = JointReference(reference_motion(plant, record), record.name)
    start = first_state(plant, record, CUTOFF_SHARE * record.fs)
    factor = nodes_a_sample(plant, controller, reference.motion)
    found = true_signals(plant, followed(plant, reference, controller, start, factor), factor)
    checks = []
    own, sensors = plant.coordinates, {one.key: one for one in model.sensors}
    for key, wanted in zip(own.channels, own.reads @ own.stiff @ reference.motion.q, strict=True):
        unit = sensors[key].unit
        checks.append(SignalCheck(key, "position", unit, False, 0, given[key], found[key]))
        pair = (wanted - given[key], wanted - found[key])
        if wanted.any():
            checks.append(SignalCheck(key, "tracking error", unit, False, 0, *pair))
    for one in model.actuators:
        if one.key in given:
            checks.append(SignalCheck(one.key, "force", one.unit, False, 0, given[one.key], found[one.key]))
    return Validation(record.name, held_out, record.fs, 0.0, tuple(checks), "closed loop", notes)


def reference_motion(plant: ArmPlant, record: Record) -> JointMotion:
    """Return the references in a record; rates and accelerations that it lacks are those of splines."""
    lines = [[record.signals.get(f"{word}_{name}") for name in plant.joints] for word in REFERENCES]
    q = np.array(lines[0], dtype=float)
    if any(line is None for lines_of in lines for line in lines_of):
        return motion_of(q, record.fs)
    return JointMotion(q, np.array(lines[1], dtype=float), np.array(lines[2], dtype=float), record.fs)


def first_state(plant: ArmPlant, record: Record, cutoff_hz: float) -> FloatArray:
    """Return positions, then speeds, at the first sample of a record, shape (2 coordinates,), SI."""
    motion = measured_motion(plant.coordinates, record, FILTER_ORDER, cutoff_hz)
    return np.concatenate((motion.q[:, 0], motion.v[:, 0]))
