"""The second stage of an elastic arm's excitation: small and fast, about the frequencies of its modes.

Large, slow motion shows gravity and friction; springs deflect visibly where links and motors swing against
each other. Every joint takes harmonics of its own, from below the lowest to above the highest mode with held
motors, with equal speeds and Schroeder's phases (1970), which keep the peaks low.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.arm_modes import arm_modes
from modelgen.runtime.planning.arms.workspace import Box, PlannedJoint, clearances, limits_of, worst_text
from modelgen.runtime.planning.thresholds import (
    BELOW_MODES,
    BEYOND_MODES,
    FAST_RANGE,
    FAST_SHARE,
    MOST_HARMONICS,
    SHRINKS,
)
from modelgen.runtime.simulation.arms.fourier_trajectory import Bounds, FourierTrajectory, at_rest


@dataclass(frozen=True)
class FastExcitation:
    """A small, fast motion about a posture, what it never exceeds, and its band in Hz."""

    trajectory: FourierTrajectory
    bounds: Bounds
    band_hz: tuple[float, float]


def fast_excitation(
    model: Model,
    values: Mapping[str, float],
    joints: Sequence[PlannedJoint],
    posture: FloatArray,
    period_s: float,
    boxes: Sequence[Box] = (),
) -> FastExcitation:
    """Return a motion about the modes at a posture, within the limits of the joints.

    Parameters
    ----------
    model : Model
        Of encoders at all motors and on all links.
    values : mapping of str to float
        Physical parameters (SI), roughly.
    joints : sequence of PlannedJoint
    posture : array, shape (joints,)
        Rad or m.
    period_s : float
    boxes : sequence of Box
        Kept, by a motion as small as they need.

    Raises
    ------
    DataError
        When a period is too short or too long for the band, or boxes leave no room.
    """
    moving = limits_of(joints)
    base = model.base_from_physical({name: values[name] for name in model.parameters})
    params = dict(zip(model.base_parameters, base.tolist(), strict=True))
    found = arm_modes(model, params, np.zeros((len(params), len(params))), posture[:, None])
    if not found.postures:
        raise DataError.at("parameters", found.notes[0], "give values of real links and springs")
    hertz = [one.frequency_hz.value for one in found.postures[0].held if one.frequency_hz is not None]
    band = BELOW_MODES * min(hertz), BEYOND_MODES * max(hertz)
    sines, cosines = _series(len(moving), band, period_s)
    unit = FourierTrajectory(period_s, np.zeros(len(moving)), sines, cosines)
    sizes = _sizes(unit, moving)
    for _ in range(SHRINKS):
        motion = FourierTrajectory(period_s, posture, sizes[:, None] * sines, sizes[:, None] * cosines)
        bounds = motion.bounds()
        kept = clearances(boxes, joints, motion, bounds)
        if min(kept, default=1.0) >= 0.0:
            return FastExcitation(motion, bounds, band)
        sizes = 0.5 * sizes
    what = f"leave no room for a fast motion: {worst_text(boxes, kept)}"
    raise DataError.at("boxes", what, "widen them")


def _series(count: int, band: tuple[float, float], period_s: float) -> tuple[FloatArray, FloatArray]:
    """Return coefficients of equal speeds, from rest to rest, every joint with harmonics of its own."""
    first, last = ceil(band[0] * period_s), floor(band[1] * period_s)
    if last - first + 1 < 4 * count:
        what = f"gives {max(last - first + 1, 0)} harmonics from {band[0]:.3g} to {band[1]:.3g} Hz"
        raise DataError.at("duration_s", what, f"give {4.2 * count / (band[1] - band[0]):.3g} s or more")
    if last > MOST_HARMONICS:
        what = f"gives harmonics up to the {last}th for modes up to {band[1] / BEYOND_MODES:.3g} Hz"
        raise DataError.at("duration_s", what, f"give at most {MOST_HARMONICS / band[1]:.3g} s")
    orders = np.arange(1, last + 1)
    used = np.array([(orders >= first) & (orders % count == joint) for joint in range(count)], dtype=float)
    places = np.cumsum(used, axis=1)
    phases = -pi * places * (places - 1.0) / places[:, -1:]
    return at_rest(used / orders * np.sin(phases), used / orders * np.cos(phases), used)


def _sizes(unit: FourierTrajectory, moving: Mapping[str, PlannedJoint]) -> FloatArray:
    """Return how often each joint's series fits into its limits, shape (joints,)."""
    free, found = unit.bounds(), []
    for k, joint in enumerate(moving.values()):
        low, high = joint.position or (0.0, 0.0)
        found.append(
            min(
                FAST_RANGE * (high - low) / (free.upper[k] - free.lower[k]),
                FAST_SHARE * (joint.speed or np.inf) / free.speed[k],
                FAST_SHARE * (joint.acceleration or np.inf) / free.acceleration[k],
            )
        )
    return np.array(found)
