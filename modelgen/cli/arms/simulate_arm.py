"""`modelgen simulate` of an arm: a record of its joints in closed loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.cli.arguments import amounts, parameter_values
from modelgen.cli.output import note
from modelgen.errors import DataError
from modelgen.spec.arms.arm import ArmSpec

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.simulation.arms.joint_reference import JointReference
    from modelgen.runtime.simulation.arms.mounted_sensors import MountedSensor

# what an arm can be without: its file says nothing of them
NOTHING = ("inertia", "viscous", "coulomb", "offset", "damping", "stiffness3")


def simulated_arm(arm: ArmSpec, given: Mapping[str, Any]) -> Record:
    """Return the record of a simulation with the options of the command.

    Raises
    ------
    DataError
        For options that do not fit the arm.
    """
    from modelgen.runtime.simulation.arms.joint_controller import load_joint_controller
    from modelgen.runtime.simulation.arms.simulate_arm import record_with_joint_references, simulate_arm

    sensors = recorded_set(arm, given["sensors"])
    model = arm_model(arm)
    values, zero = with_zeros(arm, model, parameter_values(arm, given["parameters"]))
    if zero:
        note([f"taken as zero: {', '.join(zero)}"])
    result = simulate_arm(
        model,
        values,
        _reference(model, given["excitation"], given["fs_hz"]),
        fs=given["fs_hz"] or 1000.0,
        duration_s=given["duration_s"],
        noise=amounts("--noise", given["noise"] or ()),
        resolution=amounts("--resolution", given["resolution"] or ()),
        bias=amounts("--bias", given["bias"] or ()),
        seed=given["seed"],
        controller=load_joint_controller(given["controller"]) if given["controller"] else None,
        limits=_limits(arm),
        sensors=None if sensors is None else mounted(arm, sensors),
        payloads=given["payload"] or (),
    )
    return record_with_joint_references(result) if given["with_reference"] else result.record


def recorded_set(arm: ArmSpec, asked: str | None) -> str | None:
    """Return the sensor set that records; None where the joints of a rigid arm do.

    Raises
    ------
    DataError
        When an arm has none of that name, or an elastic one several to choose from.
    """
    if asked is None and (len(arm.sensor_sets) == 1 or not arm.elastic):
        return next(iter(arm.sensor_sets)) if arm.elastic else None
    choice = f"choose one of {', '.join(arm.sensor_sets)}"
    if asked is None:
        raise DataError.at("--sensors", "is missing", choice)
    if asked not in arm.sensor_sets:
        remedy = choice if arm.sensor_sets else "leave it out: joints and drives are recorded"
        raise DataError.at("--sensors", f'"{asked}" is no sensor set of {arm.source}', remedy)
    return asked


def mounted(arm: ArmSpec, sensor_set: str) -> tuple[MountedSensor, ...]:
    """Return the sensors of a set, those with three axes with their way from the base."""
    from modelgen.runtime.simulation.arms.mounted_sensors import INERTIAL, MountedSensor
    from modelgen.runtime.simulation.arms.placed_joint import PlacedJoint
    from modelgen.spec.arms.poses import pose_of

    joints = {one.name: one for one in arm.joints}
    found = []
    for sensor in arm.sensor_sets[sensor_set]:
        way, name = [], sensor.joint if sensor.measures in INERTIAL else None
        if name is not None:
            way.append(PlacedJoint("", "fixed", pose_of(sensor.mounting, arm.lengths)))
        while name is not None:
            joint = joints[name]
            way.insert(0, PlacedJoint(name, joint.kind, pose_of(joint.placement, arm.lengths)))
            name = joint.parent
        gravity = tuple(float(one) for one in arm.gravity)
        found.append(
            MountedSensor(
                sensor.key, sensor.joint, sensor.side, sensor.measures, sensor.channels, tuple(way), gravity
            )
        )
    return tuple(found)


def arm_model(arm: ArmSpec) -> Model:
    """Return the model that an arm is moved with: of joints, or of encoders on both sides of its springs."""
    from modelgen.render.arms.arm_writer import arm_module
    from modelgen.runtime.model.model import model_from_text
    from modelgen.spec.arms.sensors import USUAL_SET, usual_sensors
    from modelgen.symbolic.arms.arm_rows import arm_rows
    from modelgen.symbolic.arms.base_parameters import arm_base_model

    usual = {USUAL_SET: usual_sensors(arm)} if arm.elastic else {}
    rows = arm_rows(replace(arm, sensor_sets=usual), sensor_set=USUAL_SET if arm.elastic else "")
    return model_from_text(arm_module(arm_base_model(rows)), arm.name)


def with_zeros(arm: ArmSpec, model: Model, given: Mapping[str, float]) -> tuple[dict[str, float], list[str]]:
    """Return parameters with zeros where an arm can be without them, and the names of these.

    Without friction and offset; a link that is symmetric has its first moments and products of inertia zero,
    one that does not move by itself may weigh nothing, and what no motion shows may be anything.
    """
    from modelgen.runtime.parameters.parameter import may_be_zero
    from modelgen.spec.arms.parameters import link_names

    columns = model.base_jacobian(dict.fromkeys(model.parameters, 1.0)).T
    absent = {name for name, column in zip(model.parameters, columns, strict=True) if not column.any()}
    moving = {joint.name for joint in arm.moving}
    for joint in arm.joints:
        names = link_names(joint.name)
        bare = joint.name not in moving and not set(names) & set(given)
        absent |= {name for name in names if bare or may_be_zero(name, "link")}
    absent |= {name for name in model.parameters if model.roles[name].role in NOTHING}
    zero = [name for name in model.parameters if name in absent and name not in given]
    return {**given, **dict.fromkeys(zero, 0.0)}, zero


def _reference(model: Model, text: str, fs_hz: float | None) -> str | JointReference:
    if text == "fourier":
        return text
    if not Path(text).suffix:
        remedy = "give fourier, or a data file with columns q_NAME of the joints"
        raise DataError.at("--excitation", f"{text!r} is none of an arm", remedy)
    from modelgen.runtime.records.read_record import read_record
    from modelgen.runtime.simulation.arms.joint_reference import reference_from_record

    record = read_record(text)
    if fs_hz is not None and fs_hz != record.fs:
        what = f"is {fs_hz:g} Hz, and {text} has {record.fs:g} Hz"
        raise DataError.at("--fs", what, "leave it out")
    return reference_from_record(model, record)


def _limits(arm: ArmSpec) -> dict[str, Any]:
    from modelgen.runtime.simulation.arms.joint_reference import JointLimits

    return {
        joint.name: JointLimits(joint.position_limits, joint.speed_limit, joint.acceleration_limit)
        for joint in arm.moving
    }
