"""Sensors of an arm: by joint and side, or the deflection of a spring; contradictions are reported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from modelgen.documents import Document
from modelgen.errors import Problem
from modelgen.spec.arms.angles import read_angle
from modelgen.spec.arms.arm import INERTIAL, ArmMeasures, ArmSensor, ArmSpec, Joint, Side
from modelgen.spec.arms.lengths import read_length
from modelgen.spec.arms.parameters import arm_parameters, mounting_parameters
from modelgen.spec.arms.placements import origin_placement
from modelgen.spec.references import derived_problem
from modelgen.spec.words import identifier_problem, path, shown, suggest

#: The sensor set of an arm with elastic joints whose file says nothing of sensors.
USUAL_SET = "encoders"
#: What sensors of one side, or of both, measure.
_MOTION = ("position", "velocity", "acceleration")
_EXAMPLE = 'qm_1 = { joint = "1", side = "motor", measures = "position" }'


def draft_sensors(document: Document, spec: ArmSpec) -> dict[str, tuple[ArmSensor, ...]]:
    """Return the sensor sets of a file, as far as they are readable.

    An arm with elastic joints whose file has none has encoders at every motor and on every link.
    """
    given = document.get("sensors")
    if given is None:
        return {USUAL_SET: usual_sensors(spec)} if spec.elastic else {}
    return {
        name: tuple(_sensor(key, table or {}) for key, table in (sensors or {}).items())
        for name, sensors in given.items()
    }


def usual_sensors(spec: ArmSpec) -> tuple[ArmSensor, ...]:
    """Return an encoder on every link, and one at the motor of every elastic joint."""
    motors = [ArmSensor(f"qm_{j.name}", j.name, "motor", "position") for j in spec.moving if j.elastic]
    return (*motors, *(ArmSensor(f"q_{joint.name}", joint.name, "link", "position") for joint in spec.moving))


def without_springs(spec: ArmSpec) -> ArmSpec:
    """Return the arm as it is in slow motion: every motor moves with its link, and no sensor is said."""
    rigid = (replace(joint, stiffness=None, damping=None, stiffness3=None) for joint in spec.joints)
    return replace(spec, joints=tuple(rigid), sensor_sets={})


def _sensor(key: str, table: Document) -> ArmSensor:
    measures: ArmMeasures = table.get("measures") or "position"
    side: Side = "deflection" if table.get("deflection") else table.get("side") or "link"
    mounting = origin_placement(
        [read_length(0 if value is None else value) for value in table.get("xyz") or ()],
        [read_angle(0 if value is None else value) for value in table.get("rpy") or ()],
    )
    joint = table.get("deflection") or table.get("joint") or ""
    side = "between" if measures == "torque" else side
    return ArmSensor(key, joint, side, measures, mounting, table.get("mounting") == "estimated")


def check_sensors(document: Document, spec: ArmSpec, joints: Mapping[str, Joint] | None) -> Iterator[Problem]:
    """Yield what is wrong with sensors; `joints` is None where names may be missing."""
    given = document.get("sensors") or {}
    if document.get("sensors", None) == {}:
        yield Problem("sensors", "is empty", f"write a table, [sensors.encoders], with {_EXAMPLE}")
    taken = _taken(spec)
    for name, tables in given.items():
        problem = identifier_problem(name)
        if problem:
            yield Problem(path("sensors", name), *problem)
        if tables == {}:
            yield Problem(path("sensors", name), "is empty", f"add a sensor: {_EXAMPLE}")
        channels: dict[str, str] = {}
        for sensor in spec.sensor_sets.get(name, ()):
            where, table = path("sensors", name, sensor.key), (tables or {}).get(sensor.key)
            yield from _check_key(where, sensor, taken, channels)
            if table is not None:
                yield from _check_sensor(where, sensor, table, joints)


def _taken(spec: ArmSpec) -> dict[str, str]:
    """Return the names that no sensor may have, and what they are."""
    forces = {
        f"tau_{joint.name}": f"the force or torque of the motor of joint {joint.name}"
        for joint in spec.moving
    }
    named = {parameter.name: "a parameter" for parameter in arm_parameters(spec)}
    return {**forces, **named, **dict.fromkeys(spec.lengths, "a length")}


def _check_key(
    where: str, sensor: ArmSensor, taken: Mapping[str, str], channels: dict[str, str]
) -> Iterator[Problem]:
    problem = identifier_problem(sensor.key) or derived_problem(sensor.key)
    if problem:
        yield Problem(where, *problem)
    for name in (*sensor.channels, *(one.name for one in mounting_parameters(sensor))):
        if name in taken:
            yield Problem(where, f'"{name}" is {taken[name]}', "rename the sensor")
        other = channels.setdefault(name, sensor.key)
        if other != sensor.key:
            yield Problem(where, f'gives "{name}", as {other} does', "rename one of them")


def _check_sensor(
    where: str, sensor: ArmSensor, table: Document, joints: Mapping[str, Joint] | None
) -> Iterator[Problem]:
    measures, side = table.get("measures"), table.get("side")
    key = "deflection" if "deflection" in table else "joint"
    if {"joint", "deflection"} <= table.keys():
        yield Problem(where, "has both joint and deflection", "keep one of them")
    elif not {"joint", "deflection"} & table.keys():
        yield Problem(where, "has neither joint nor deflection", 'add joint = "1"')
    else:
        yield from _check_joint(f"{where}.{key}", sensor, joints)
    if key == "deflection" and measures not in (*_MOTION, None):
        remedy = 'write "position", "velocity" or "acceleration"'
        yield Problem(f"{where}.measures", f"is {shown(measures)}, of a deflection", remedy)
    elif measures == "torque" and "side" in table:
        yield Problem(f"{where}.side", "is of a torque, which acts between both sides", "leave it out")
    elif measures in INERTIAL and side == "motor":
        yield Problem(f"{where}.side", f"has a motor with {_an(measures)}", 'write side = "link"')
    elif key == "deflection" and "side" in table:
        yield Problem(f"{where}.side", "is of a deflection, which has two sides", "leave it out")
    elif measures in (*_MOTION, *INERTIAL) and key == "joint" and "side" not in table:
        either = '"link"' if measures in INERTIAL else '"motor" or "link"'
        yield Problem(f"{where}.side", "is missing", f"write side = {either}")
    for mounted in ("xyz", "rpy", "mounting"):
        if mounted in table and measures not in (*INERTIAL, None):
            yield Problem(
                f"{where}.{mounted}", "is the mounting of a gyro or an accelerometer", "leave it out"
            )


def _check_joint(where: str, sensor: ArmSensor, joints: Mapping[str, Joint] | None) -> Iterator[Problem]:
    if joints is None or not sensor.joint:
        return
    joint = joints.get(sensor.joint)
    if joint is None:
        yield Problem(where, f"{shown(sensor.joint)} is not a joint", suggest(sensor.joint, joints, "joints"))
    elif joint.kind == "fixed" and sensor.measures not in INERTIAL:
        yield Problem(where, f"{shown(sensor.joint)} is fixed", "name a joint that moves")
    elif sensor.side == "deflection" and not joint.elastic:
        remedy = f"write stiffness = true into the table of joint {joint.name}, or leave the sensor out"
        yield Problem(where, f"{shown(sensor.joint)} has no stiffness, so nothing deflects", remedy)


def _an(measures: str) -> str:
    return f"{'an' if measures[0] == 'a' else 'a'} {measures}"
