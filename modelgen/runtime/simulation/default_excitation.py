"""An excitation that suits a chain, with levels that follow from its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite, pi
from typing import TypedDict, Unpack

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.keyword_options import with_defaults
from modelgen.runtime.model.model import Model
from modelgen.runtime.simulation.closed_loop import (
    PositionVelocityController,
    bandwidth_hz,
    closed_loop,
    default_controller,
    vibration,
)
from modelgen.runtime.simulation.excitation import Excitation, check_band, chirp, trapezoid
from modelgen.runtime.simulation.plant import Plant, make_plant
from modelgen.runtime.simulation.thresholds import (
    BAND,
    FORCE_OVER_COULOMB,
    FREE_ACCELERATION,
    HIGHEST_PART_OF_FS,
    REVERSAL_MARGIN,
    SHORTEST_DWELL_S,
    SPEED_LEVELS,
)


class ExcitationOptions(TypedDict, total=False):
    """The keyword options of `default_excitation`, which describes them."""

    band_hz: tuple[float, float] | None
    force: float | None
    controller: PositionVelocityController | None
    actuator: str | None
    oversample: int


def default_excitation(
    kind: str,
    model: Model,
    parameters: Mapping[str, float],
    fs: float = 5000.0,
    *,
    duration_s: float = 2.0,
    **options: Unpack[ExcitationOptions],
) -> Excitation:
    """Return a chirp or a trapezoid with levels chosen from the chain's parameters.

    Parameters
    ----------
    kind : str
        "chirp" or "trapezoid".
    model, parameters, actuator, controller
        As in `modelgen.simulate`; the velocity under the chirp depends on the controller.
    fs, duration_s, oversample
        Sampling frequency in Hz, duration in s, internal steps per sample (by default 32).
    band_hz : pair of float, optional
        Band of the chirp in Hz; by default 0.2 times the lowest to 1.8 times the highest elastic frequency.
    force : float, optional
        Force at hand, in N m or N: the chirp's amplitude, and twice what the trapezoid's flanks need.

    Raises
    ------
    DataError
        For an unknown kind, and for parameters that do not suit the model.
    """
    given = with_defaults("default_excitation", options, ExcitationOptions, ExcitationOptions(oversample=32))
    plant = make_plant(model, parameters, given["actuator"])
    amplitude = default_force(plant) if given["force"] is None else given["force"]
    if kind == "chirp":
        loop = given["controller"] or default_controller(plant)
        return _chirp(plant, loop, amplitude, given["band_hz"], duration_s, fs, given["oversample"])
    if kind == "trapezoid":
        return _trapezoid(plant, amplitude, duration_s, fs, given["oversample"])
    raise DataError.at(
        "excitation", f"there is no kind {kind!r}", "choose chirp or trapezoid, or give an Excitation"
    )


def default_force(plant: Plant) -> float:
    """Return a force that overcomes all Coulomb friction by far, or else gives a sensible acceleration."""
    n = len(plant.bodies)
    gears = np.abs(vibration(plant).lowest)
    coulomb = sum(max(body.plus, body.minus) * gears[body.velocity - n] for body in plant.coulomb_bodies)
    if coulomb > 0.0:
        return float(FORCE_OVER_COULOMB * coulomb)
    unit = plant.model.actuators[plant.actuator].unit
    return FREE_ACCELERATION.get(unit, 1.0) * vibration(plant).drive_inertia


def _chirp(
    plant: Plant,
    controller: PositionVelocityController,
    force: float,
    band_hz: tuple[float, float] | None,
    duration_s: float,
    fs: float,
    oversample: int,
) -> Excitation:
    modes = vibration(plant)
    low, high = band_hz or _band_hz(modes.elastic_hz, bandwidth_hz(modes), fs)
    check_band(low, high, fs)
    # a chain that is held by a spring cannot go on and on: it has to reverse
    velocity = 0.0
    if not isfinite(modes.compliance):
        velocity = REVERSAL_MARGIN * force * _largest_velocity(plant, controller, low, high)
    phase_s = min(2.0 / bandwidth_hz(modes), duration_s / 10.0)
    return chirp(
        low,
        high,
        duration_s,
        fs,
        force=force,
        velocity=velocity,
        ramp_s=phase_s,
        settle_s=phase_s,
        oversample=oversample,
    )


def _band_hz(elastic_hz: FloatArray, bandwidth: float, fs: float) -> tuple[float, float]:
    low, high = (elastic_hz[0], elastic_hz[-1]) if elastic_hz.size else (bandwidth, 5.0 * bandwidth)
    high = min(BAND[1] * high, HIGHEST_PART_OF_FS * fs)
    return float(min(BAND[0] * low, 0.1 * high)), float(high)


def _largest_velocity(plant: Plant, controller: PositionVelocityController, low: float, high: float) -> float:
    """Return the largest velocity of any body per unit of feedforward, at the worst frequency of the band."""
    system = closed_loop(plant, controller)
    A = system.matrix((1,) * len(plant.sticking))
    frequencies = 2j * pi * np.geomspace(low, high, 400)
    response = np.linalg.solve(frequencies[:, None, None] * np.eye(len(A)) - A, system.B)
    return float(np.abs(response[:, len(A) // 2 :]).max())


def _trapezoid(plant: Plant, force: float, duration_s: float, fs: float, oversample: int) -> Excitation:
    """Half the force accelerates to the top speed within one period of the loop's bandwidth."""
    modes = vibration(plant)
    # at one speed, forward and backward take ten phases: flank, twice as long a cruise, flank, dwell
    phase_s = max(min(1.0 / bandwidth_hz(modes), duration_s / 10.0), SHORTEST_DWELL_S)
    acceleration = 0.5 * force / modes.drive_inertia
    # a chain that is held by a spring gets no farther than the force can push it, and must be pushed there
    acceleration = min(acceleration, 0.5 * force * modes.compliance / (3.0 * phase_s**2))
    top = acceleration * phase_s
    motion = trapezoid(
        [level * top for level in SPEED_LEVELS],
        acceleration,
        duration_s,
        fs,
        cruise_s=2.0 * phase_s,
        dwell_s=phase_s,
        oversample=oversample,
    )
    return replace(motion, feedforward=motion.reference / modes.compliance)
