"""References of all joints: from a record's columns, or a Fourier series from rest to rest within limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.magnitudes import is_usable
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, refuse_lacking
from modelgen.runtime.simulation.arms.arm_coordinates import joint_units
from modelgen.runtime.simulation.arms.fourier_trajectory import FourierTrajectory, at_rest
from modelgen.runtime.simulation.arms.joint_motion import JointMotion, motion_of
from modelgen.runtime.simulation.arms.thresholds import ACCELERATION, HARMONICS, POSITION, SPEED, USED
from modelgen.runtime.simulation.excitation import check_fs
from modelgen.runtime.simulation.thresholds import MOST_STEPS


@dataclass(frozen=True)
class JointLimits:
    """Limits of a joint in rad or m, and per s, s^2; None where there is none."""

    position: tuple[float, float] | None = None
    speed: float | None = None
    acceleration: float | None = None


@dataclass(frozen=True, eq=False)
class JointReference:
    """What the joints are to do: a motion, a name, and forces that are added to what the controller asks for.

    `forces` are those of drives, by key, shape (N,), in N m or N.
    """

    motion: JointMotion
    name: str = "reference"
    forces: Mapping[str, FloatArray] = field(default_factory=dict)


def reference_from_record(model: Model, record: Record) -> JointReference:
    """Return the reference in a record: columns q_NAME, and d1_q_NAME, d2_q_NAME where they are there.

    What `modelgen design --optimise` writes, or a measured record. Without speeds and accelerations of all
    joints, these are those of splines through the positions.

    Raises
    ------
    DataError
        With one problem per joint without a position, and for fewer than four samples.
    """
    joints, given = joint_units(model), record.signals
    refuse_lacking([record], [f"q_{name}" for name in joints])
    if record.n < 4:
        raise DataError.at(record.name, f"has {record.n} samples", "give four or more")
    q = np.array([given[f"q_{name}"] for name in joints])
    rates = [[given.get(f"{order}_q_{name}") for name in joints] for order in ("d1", "d2")]
    if any(one is None for line in rates for one in line):
        return JointReference(motion_of(q, record.fs), record.name)
    v, a = (np.array(line, dtype=float) for line in rates)
    return JointReference(JointMotion(q, v, a, record.fs), record.name)


def fourier_reference(
    model: Model,
    duration_s: float,
    fs: float,
    limits: Mapping[str, JointLimits] | None = None,
    seed: int = 0,
) -> JointReference:
    """Return a Fourier series of every joint, from rest to rest, as large as the limits allow.

    Five harmonics of the duration with random coefficients. Where a joint has no limit it moves within
    1.2 rad or 0.2 m to both sides of zero, at 2 rad/s or 0.5 m/s and 10 rad/s^2 or 3 m/s^2 at most.

    Raises
    ------
    DataError
        For a duration or a sampling frequency that gives no motion.
    """
    check_fs(fs)
    if not (is_usable(duration_s) and 10 * HARMONICS <= duration_s * fs <= MOST_STEPS):
        what = f"is {duration_s:g} s, which gives {duration_s * fs:.6g} samples"
        raise DataError.at("duration_s", what, f"give {10 * HARMONICS} to {MOST_STEPS:g} samples")
    samples, joints = round(duration_s * fs), joint_units(model)
    period_s, rng = samples / fs, np.random.default_rng([seed, len(joints)])
    tilt = 1.0 / np.arange(1, HARMONICS + 1)
    sines, cosines = at_rest(*(rng.standard_normal((2, len(joints), HARMONICS)) * tilt))
    unit = FourierTrajectory(period_s, np.zeros(len(joints)), sines, cosines)
    bounds = unit.bounds()
    offsets, sizes = np.zeros(len(joints)), np.zeros(len(joints))
    for k, (name, kind) in enumerate(joints.items()):
        limit = (limits or {}).get(name, JointLimits())
        low, high = limit.position or (-POSITION[kind], POSITION[kind])
        # joints that can go round and round need not
        half = min(0.5 * (high - low), pi if kind == "rad" else np.inf)
        asked = (
            USED * half / (0.5 * (bounds.upper[k] - bounds.lower[k])),
            USED * (limit.speed or SPEED[kind]) / bounds.speed[k],
            USED * (limit.acceleration or ACCELERATION[kind]) / bounds.acceleration[k],
        )
        sizes[k] = min(asked)
        offsets[k] = 0.5 * (low + high) - sizes[k] * 0.5 * (bounds.upper[k] + bounds.lower[k])
    found = FourierTrajectory(period_s, offsets, sizes[:, None] * sines, sizes[:, None] * cosines)
    return JointReference(JointMotion(*found.at(np.arange(samples + 1) / fs), fs), "fourier")
