"""Elastic arms for tests, and their motion: exact, from a smooth motion of the links alone.

The links' motion gives the torques that they need, and with the rules of the graph their derivatives; these
say how far each spring is deflected, and so how the motors move and what they exert. Nothing is integrated.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.spec.arms.arm import INERTIAL, ArmSensor, ArmSpec
from modelgen.spec.arms.sensors import usual_sensors
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.drives import motor_coordinate
from modelgen.symbolic.arms.expressions.derivative import time_derivatives
from modelgen.symbolic.arms.expressions.evaluation import sampled
from modelgen.symbolic.arms.expressions.graph import Graph
from modelgen.symbolic.arms.row_parts import row_parts
from tests.symbolic.arms.made_arms import serial
from tests.symbolic.arms.regressor_samples import regressor_at

Motion = dict[tuple[str, int], FloatArray]
DRIVE = ("rotor_inertia", "viscous", "coulomb", "offset")
SPATIAL = [(0, 0, 0, 0.3), (-90, 0, 0, 0.1), (0, 0.4, 0, 0.05)]
PLANAR = [(90, 0, 0, 0), (0, 0.5, 0, 0)]


def elastic(spec: ArmSpec, joints: tuple[str, ...] | None = None, **parts: bool) -> ArmSpec:
    """Return the arm with springs in these joints, in all if none are named, and encoders on both sides."""
    chosen = [joint.name for joint in spec.moving] if joints is None else joints
    made = tuple(
        replace(
            j, stiffness=f"K{j.name}", **{part: f"{part}{j.name}" for part, there in parts.items() if there}
        )
        if j.name in chosen
        else j
        for j in spec.joints
    )
    spec = replace(spec, joints=made)
    return replace(spec, sensor_sets={"encoders": usual_sensors(spec)})


def geared(spec: ArmSpec) -> ArmSpec:
    """Return the arm with gears, one of them negative, and a motor that moves two joints."""
    count = range(len(spec.moving))
    ratios = [[Fraction((-40 if i == 1 else 30) * (i == k)) for k in count] for i in count]
    ratios[-1][-2] = Fraction(30)
    return replace(spec, transmission=tuple(map(tuple, ratios)))


def with_sensors(spec: ArmSpec, *sensors: tuple[str, str, str]) -> ArmSpec:
    """Return the arm with one sensor set "s": (joint, side, what it measures) of each sensor."""
    made = tuple(
        ArmSensor(f"{side}_{measures}_{joint}", joint, side, measures) for joint, side, measures in sensors
    )  # type: ignore[arg-type]
    return replace(spec, sensor_sets={**spec.sensor_sets, "s": made})


def values_of(spec: ArmSpec, rng: np.random.Generator) -> dict[str, float]:
    """Return parameters of which every spring is stiff enough for small deflections."""
    values = {name: float(rng.uniform(0.2, 1.0)) for name in arm_rows(spec).columns}
    for joint in spec.moving:
        if joint.stiffness:
            values[joint.stiffness] = float(rng.uniform(800.0, 2000.0))
    return {**values, **spec.known}


def smooth_motion(
    names: list[str], times: FloatArray, rng: np.random.Generator, orders: int = 6, tempo: float = 1.0
) -> Motion:
    """Return sums of sines and their derivatives."""
    motion: Motion = {}
    for name in names:
        parts = [(rng.uniform(0.2, 0.5), 2 * np.pi * f * tempo, rng.uniform(0, 6)) for f in (0.31, 0.83, 1.7)]
        for order in range(orders + 1):
            motion[name, order] = sum(
                a * w**order * np.sin(w * times + p + order * np.pi / 2) for a, w, p in parts
            )
    return motion


def exact_record(
    spec: ArmSpec, values: dict[str, float], times: FloatArray, rng: np.random.Generator, tempo: float = 1.0
) -> tuple[Motion, dict[str, FloatArray]]:
    """Return the motion of all coordinates, torques of joints and forces of motors, by "torque 1", "force 1".

    Springs are linear without damping: the deflection is then the torque that the link needs, over K.
    """
    graph, names = Graph(), [joint.name for joint in spec.moving]
    parts = row_parts(graph, spec, False)
    motion = smooth_motion(names, times, rng, tempo=tempo)
    loads: dict[str, list[FloatArray]] = {}
    for joint in spec.moving:
        refs = list(parts.links[joint.name].values())
        loads[joint.name] = []
        for _ in range(4):
            weights = [values[parts.columns[c]] for c in parts.links[joint.name]]
            loads[joint.name].append(sampled(graph, refs, motion, values) @ weights)
            refs = time_derivatives(graph, refs)
        if joint.elastic:
            for order in range(4):
                deflection = loads[joint.name][order] / values[joint.stiffness or ""]
                motion[motor_coordinate(joint), order] = motion[joint.name, order] + deflection
    found = {f"torque {name}": load[0] for name, load in loads.items()}
    found |= {f"torque {name} 1": load[1] for name, load in loads.items()}
    rows = arm_rows(replace(spec, joints=tuple(replace(j, gain=None) for j in spec.joints)), "motor")
    needed = regressor_at(rows, motion, {**values, **found}) @ [values[c] for c in rows.columns]
    driven = [name if name in rows.names else f"{name} spring" for name in names]
    forces = {f"force {n}": needed[:, rows.names.index(row)] for n, row in zip(names, driven, strict=True)}
    return motion, {**found, **forces}


def readings(
    spec: ArmSpec, motion: Motion, forces: dict[str, FloatArray], sensor_set: str
) -> dict[str, FloatArray]:
    """Return the signals that encoders, tachometers and torque sensors of a set give, and the motors' forces.

    They are by the keys of a module.
    """
    signals = {f"tau_{joint.name}": forces[f"force {joint.name}"] for joint in spec.moving}
    moving = [joint.name for joint in spec.moving]
    by_name = {joint.name: joint for joint in spec.moving}
    for sensor in spec.sensor_sets[sensor_set]:
        if sensor.measures in INERTIAL:
            continue
        first = {"velocity": 1, "acceleration": 2}.get(sensor.measures, 0)
        for order in range(4 - first):
            key = f"d{order}_{sensor.key}" if order else sensor.key
            if sensor.measures == "torque":
                if order < 2:
                    signals[key] = forces[f"torque {sensor.joint}" + (" 1" if order else "")]
                continue
            place = (sensor.joint, order + first)
            if sensor.side == "link":
                signals[key] = motion[place]
            elif sensor.side == "deflection":
                signals[key] = motion[motor_coordinate(by_name[sensor.joint]), order + first] - motion[place]
            else:
                ratios = spec.transmission[moving.index(sensor.joint)]
                signals[key] = sum(
                    float(ratio) * motion[motor_coordinate(by_name[name]), order + first]
                    for name, ratio in zip(moving, ratios, strict=True)
                )
    return signals


def two_link() -> ArmSpec:
    return elastic(serial(PLANAR, drive=True))


def spatial() -> ArmSpec:
    return elastic(serial(SPATIAL, drive=True))
