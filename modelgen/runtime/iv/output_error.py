"""Output error: parameters whose simulated response comes closest to the measured one; a yardstick.

The chain is simulated under the measured forces. Alone it would drift away from the record, as any free axis
does, so a weak position and velocity controller ties it to the measured motion of the first actuator's body;
what that controller has to add to its force is an error like any other. Everything is compared unfiltered,
each signal weighted by its own residual. Friction is true stick and slip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, ModelgenError
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.iv.thresholds import (
    BETWEEN,
    FAR,
    FINEST,
    MOST_EVALUATIONS,
    RELATIVE_STEP,
    WEIGHTING_ROUNDS,
)
from modelgen.runtime.least_squares.hac_covariance import long_run_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import (
    PositionVelocityController,
    closed_loop,
    default_controller,
)
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.plant import Plant, make_plant, measured_forces
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.simulation.thresholds import CUTOFF_SHARE, FILTER_ORDER
from modelgen.runtime.simulation.validate import initial_state
from modelgen.runtime.stick_slip.hybrid_system import refinement


@dataclass(frozen=True, eq=False)
class Response:
    """Parameters found by a yardstick: `covariance` in the order of `names` (SI)."""

    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray


def fit_response(
    model: Model, records: Sequence[Record], start: Mapping[str, float], tolerance: float = 1e-8
) -> Response:
    """Fit all physical parameters by nonlinear least squares, from a start (SI).

    The search ends when the squared error falls by less than the share `tolerance`.

    Raises
    ------
    DataError
        When the driven body has no encoder, or the start does not suit the model.
    """
    from scipy.optimize import least_squares

    plant = make_plant(model, start)
    driven = plant.bodies[plant.driven]
    encoder = next((s.key for s in model.sensors if (s.body, s.measures) == (driven, "position")), None)
    if encoder is None:
        remedy = "use another method"
        raise DataError.at("output error", f"body {driven} has no position sensor to follow", remedy)
    names = model.parameters
    scale = np.array([abs(plant.parameters[name]) or 1.0 for name in names])
    loop = default_controller(plant)
    followed = [_follow(record, encoder, plant) for record in records]
    finest = max(FINEST, 2 * max(_parts(plant, loop, one) for one in followed))
    weights = [1.0] * (len(model.sensors) + 1)
    count = sum(record.n for record in records)
    far = np.full(count * len(weights), FAR)

    def residual(x: FloatArray) -> FloatArray:
        values = {**plant.parameters, **dict(zip(names, (x * scale).tolist(), strict=True))}
        try:
            trial = make_plant(model, values)
            if max(_parts(trial, loop, one) for one in followed) > finest:
                return far
            parts = [_errors(trial, r, f, loop) for r, f in zip(records, followed, strict=True)]
        except ModelgenError:
            return far
        joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
        return np.concatenate([w * e for w, e in zip(weights, joined, strict=True)])

    x = np.array([plant.parameters[name] for name in names]) / scale
    for _ in range(WEIGHTING_ROUNDS):
        weights = [1.0] * len(weights)
        each = residual(x).reshape(len(weights), count)
        weights = [1.0 / max(float(np.sqrt(np.mean(e**2))), 1e-300) for e in each]
        found = least_squares(
            residual,
            x,
            diff_step=RELATIVE_STEP,
            max_nfev=MOST_EVALUATIONS,
            x_scale="jac",
            ftol=tolerance,
        )
        x = np.asarray(found.x)
    return Response(names, x * scale, _covariance(found, len(weights), records) * np.outer(scale, scale))


def _covariance(found: Any, signals: int, records: Sequence[Record]) -> FloatArray:
    """Return the sandwich covariance: noise of the force makes residuals that last for many samples.

    What each instant contributes to the error is summed over the signals; its long-run covariance counts.
    """
    inverse = np.linalg.pinv(found.jac.T @ found.jac)
    by_signal = (found.jac * found.fun[:, None]).reshape(signals, -1, len(inverse))
    ends = np.cumsum([record.n for record in records])[:-1]
    freedom = len(found.fun) / (len(found.fun) - len(inverse))
    return long_run_covariance(np.split(by_signal.sum(axis=0) @ inverse, ends)) * freedom


def _follow(record: Record, encoder: str, plant: Plant) -> Excitation:
    """Return the measured motion of the driven body as reference, with the measured forces."""
    from scipy.interpolate import make_interp_spline

    position = record.signals[encoder]
    smooth = zero_phase(position, FILTER_ORDER, CUTOFF_SHARE * record.fs, record.fs)
    force, further = measured_forces(plant, record)
    nodes = np.arange((record.n - 1) * BETWEEN + 1) / BETWEEN
    r, rate, forward, *others = (
        np.asarray(make_interp_spline(np.arange(record.n), array)(nodes))
        for array in (smooth, differentiate(smooth, record.dt), force, *further.values())
    )
    forces = dict(zip(further, others, strict=True))
    return Excitation(r, rate, forward, BETWEEN * record.fs, record.name, forces)


def _parts(plant: Plant, loop: PositionVelocityController, followed: Excitation) -> int:
    """Return into how many parts the simulation divides a step."""
    return refinement(closed_loop(plant, loop, inf), 1.0 / followed.rate_hz)


def _errors(
    plant: Plant, record: Record, followed: Excitation, loop: PositionVelocityController
) -> list[FloatArray]:
    """Return measured minus simulated of every sensor, and of the force."""
    model = plant.model
    state = initial_state(plant, record, CUTOFF_SHARE * record.fs)
    found = simulate(
        model, plant.parameters, followed, fs=record.fs, controller=loop, initial_state=state
    ).true
    keys = [sensor.key for sensor in model.sensors] + [model.actuators[plant.actuator].key]
    return [record.signals[key] - found[key] for key in keys]
