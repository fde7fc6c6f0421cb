"""Records of an arm with elastic joints along a motion of its links: exact, nothing is integrated.

The links' motion says which torques the springs carry, these how far the motors are ahead of the links, and
that what the motors exert. Identified, such records show what rows and
estimators do, without the errors of an integrator.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.filters.derivatives import central_difference, differentiate
from modelgen.runtime.model.arm_channels import moving_joints
from modelgen.runtime.model.model import Model
from modelgen.runtime.planning.arms.predicted_sets import USUAL_NOISE
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.arms.mounted_sensors import MountedSensor, felt_channels

# Differences exact up to degree 16; they are applied to positions, torques and positions of motors in turn.
STENCIL = central_difference(8)
EDGE = 64
_FIRST = ("position", "velocity", "acceleration")
# Terms of (1 + s D / K)^-1.
DAMPED = 3


@dataclass(frozen=True, eq=False)
class ElasticMotion:
    """Positions of links and of motors (seen from their joints), torques of springs and forces of motors.

    By the name of the joint, shape (N,) each; fs in Hz.
    """

    fs: float
    links: Mapping[str, FloatArray]
    motors: Mapping[str, FloatArray]
    torques: Mapping[str, FloatArray]
    forces: Mapping[str, FloatArray]


def elastic_motion(
    model: Model, values: Mapping[str, float], links: Mapping[str, FloatArray], fs: float
) -> ElasticMotion:
    """Return the motion of an arm whose links move as given.

    Parameters
    ----------
    model : Model
        That of an encoder at every motor and on every link.
    values : mapping of str to float
        All parameters (SI).
    links : mapping of str to array
        Position of every joint's link, shape (N,) each, smooth; the first and last `EDGE` samples are lost.
    fs : float
        Hz.

    Raises
    ------
    DataError
        If a joint has no motion, the model has other sensors, or a spring is cubic.
    """
    module = model.module
    moving = moving_joints(module)
    missing = [name for name in moving if name not in links]
    if missing:
        raise DataError.at("links", f"lack a motion of {missing[0]}", "give one of every joint that moves")
    keys = _encoders(model)
    springs = _springs(model, values)
    base = model.base_from_physical({name: values[name] for name in model.parameters})
    rigid = _signals(model, keys, links, links, fs)
    held = np.asarray(model.regressor(rigid)) @ base - model.measurement(rigid)
    rows = {row.name: place for place, row in enumerate(model.rows)}
    motors, torques = dict(links), {}
    for name in moving:
        if name not in springs:
            continue
        torques[name] = held[:, rows[f"{name} link"]]
        stiff, damped = springs[name]
        rates = (differentiate(torques[name], 1.0 / fs, k, STENCIL) for k in range(1, DAMPED + 1))
        total = torques[name] / stiff
        for order, rate in enumerate(rates, start=1):
            total = total + (-damped / stiff) ** order * rate / stiff
        motors[name] = links[name] + total
    moved = _signals(model, keys, links, motors, fs)
    needed = np.asarray(model.regressor(moved)) @ base - model.measurement(moved)
    driven = (f"{name} spring" if name in springs else name for name in moving)
    at_joints = np.array([needed[:, rows[name]] for name in driven])
    forces = np.linalg.solve(np.array(module.TRANSMISSION, dtype=float).T, at_joints)
    inside = slice(EDGE, -EDGE)
    return ElasticMotion(
        fs,
        {name: links[name][inside] for name in moving},
        {name: motors[name][inside] for name in moving},
        {name: value[inside] for name, value in torques.items()},
        {name: value[inside] for name, value in zip(moving, forces, strict=True)},
    )


def record_along(
    model: Model,
    motion: ElasticMotion,
    noise: Mapping[str, float] | None = None,
    seed: int = 0,
    mounted: Sequence[MountedSensor] = (),
) -> Record:
    """Return what the sensors of a model read along a motion.

    Parameters
    ----------
    model : Model
    motion : ElasticMotion
    noise : mapping of str to float, optional
        Standard deviation of the readings (SI) by channel, or by unit; `USUAL_NOISE` for the others.
    seed : int
    mounted : sequence of MountedSensor, optional
        Where gyros and accelerometers of the set are.
    """
    rng, level = np.random.default_rng(seed), {**USUAL_NOISE, **(noise or {})}
    units = {one.key: one.unit for one in model.sensors} | {one.key: one.unit for one in model.actuators}
    exact = {f"tau_{name}": force for name, force in motion.forces.items()}
    exact |= _felt(motion, [one for one in mounted if one.way])
    for sensor in model.module.SENSORS:
        if not exact.keys() >= {*sensor["channels"]}:
            exact |= {sensor["key"]: _read(model, sensor, motion)}
    return Record(
        {
            key: exact[key] + level.get(key, level[units[key]]) * rng.standard_normal(len(exact[key]))
            for key in model.channels
        },
        motion.fs,
        "prediction",
    )


def _encoders(model: Model) -> dict[str, tuple[str, str]]:
    """Return the channels of the position of each joint's link and motor."""
    found: dict[str, dict[str, str]] = {}
    for sensor in model.module.SENSORS:
        if sensor["measures"] == "position" and sensor["side"] in ("link", "motor"):
            found.setdefault(sensor["joint"], {})[sensor["side"]] = sensor["key"]
    elastic = {role.bodies[0] for role in model.roles.values() if role.role == "stiffness"}
    strange = [name for name in elastic if len(found.get(name, {})) < 2]
    if strange or hasattr(model.module, "ESTIMATED"):
        remedy = "give the model of an encoder at every motor and on every link"
        raise DataError.at(model.sensor_set, "does not measure both sides of every spring", remedy)
    return {name: (sides.get("link", ""), sides.get("motor", "")) for name, sides in found.items()}


def _springs(model: Model, values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return stiffness and damping of every spring, by its joint."""
    every = {**values, **model.known}
    found: dict[str, tuple[float, float]] = {}
    for name, role in model.roles.items():
        joint = role.bodies[0]
        stiff, damped = found.get(joint, (0.0, 0.0))
        if role.role == "stiffness":
            found[joint] = (every[name], damped)
        elif role.role == "damping":
            found[joint] = (stiff, every[name])
        elif role.role == "stiffness3":
            remedy = "leave out stiffness3"
            raise DataError.at(name, "is a cubic stiffness, which is not solved for", remedy)
    return found


def _signals(
    model: Model,
    keys: Mapping[str, tuple[str, str]],
    links: Mapping[str, FloatArray],
    motors: Mapping[str, FloatArray],
    fs: float,
) -> dict[str, FloatArray]:
    """Return the signals of a module, forces zero."""
    moving = moving_joints(model.module)
    positions: dict[str, FloatArray] = {}
    for name, (link, motor) in keys.items():
        positions[link] = links[name]
        positions[motor] = _turned(model, moving, name, motors)
    found = {}
    for signal in model.module.SIGNALS:
        front, _, rest = signal.partition("_")
        order = int(front[1:]) if front in ("d1", "d2", "d3") else 0
        channel = rest if order else signal
        if channel in positions:
            found[signal] = differentiate(positions[channel], 1.0 / fs, order, STENCIL)
        else:
            found[signal] = np.zeros(len(links[moving[0]]))
    return found


def _turned(model: Model, moving: Sequence[str], joint: str, motors: Mapping[str, FloatArray]) -> FloatArray:
    """Return the position of a motor itself, in front of its gear."""
    ratios = model.module.TRANSMISSION[moving.index(joint)]
    total = np.zeros(len(motors[joint]))
    for ratio, name in zip(ratios, moving, strict=True):
        total += ratio * motors[name]
    return total


def _felt(motion: ElasticMotion, sensors: Sequence[MountedSensor]) -> dict[str, FloatArray]:
    """Return what gyros and accelerometers read."""
    links = np.array([*motion.links.values()])
    q, v, a = (
        np.array([differentiate(one, 1.0 / motion.fs, order, STENCIL) for one in links]) for order in range(3)
    )
    names = [*motion.links]
    return {key: line for one in sensors for key, line in felt_channels(one, names, q, v, a).items()}


def _read(model: Model, sensor: Mapping[str, Any], motion: ElasticMotion) -> FloatArray:
    """Return what an encoder, a tachometer or a torque sensor reads.

    Raises
    ------
    DataError
        For a gyro or an accelerometer that is not among those that are mounted.
    """
    moving = moving_joints(model.module)
    joint, side, measures = sensor["joint"], sensor["side"], sensor["measures"]
    if measures == "torque":
        return motion.torques[joint]
    if measures not in _FIRST:
        raise DataError.at(sensor["key"], f"is a {measures}", "say in mounted where it is")
    position = motion.links[joint]
    if side == "deflection":
        position = motion.motors[joint] - motion.links[joint]
    elif side == "motor":
        position = _turned(model, moving, joint, motion.motors)
    return differentiate(position, 1.0 / motion.fs, _FIRST.index(measures), STENCIL)
