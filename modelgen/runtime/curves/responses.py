"""Frequency response of a record and of the identified model, with coherence.

Measured: H1 = S_uy / S_uu by Welch's method. Modelled: C (j w I - A)^-1 B + D of the module's state space, in
which Coulomb friction and offsets have no part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.model.model import Model, Sensor
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate

ComplexArray = npt.NDArray[np.complex128]

SEGMENTS = 8  # with half overlap: of independent noises 95 % of the coherence lies below 0.36
LOWEST_BIN = 2
MOST_POINTS = 550  # no more than the plot has pixels
NEEDED = ("inertia", "stiffness", "damping")


@dataclass(frozen=True, eq=False)
class Response:
    """Reading over force of one sensor on one record; `modelled` is None where the model gives none."""

    record: str
    sensor: str
    force: str
    unit: str
    frequency_hz: FloatArray
    measured: ComplexArray
    coherence: FloatArray
    modelled: ComplexArray | None


def responses(model: Model, record: Record, estimate: Estimate) -> list[Response]:
    """Return the response of every sensor to the first actuator that is used."""
    forces = [actuator for actuator in model.actuators if actuator.key in record.signals]
    sensors = [sensor for sensor in model.sensors if sensor.key in record.signals]
    if not forces or float(np.std(record.signals[forces[0].key])) == 0.0:
        return []
    force = forces[0]
    found = []
    for sensor in sensors:
        f, H, coherence = _welch(record, force.key, sensor.key)
        keep = _spread(f)
        f, H, coherence = f[keep], H[keep], coherence[keep]
        modelled = _modelled(model, estimate, sensor, force.key, f)
        unit = f"({sensor.unit})/({force.unit})"
        found.append(Response(record.name, sensor.key, force.key, unit, f, H, coherence, modelled))
    return found


def missing_parameters(model: Model, estimate: Estimate) -> tuple[str, ...]:
    """Return the parameters without which there is no response, and the estimate does not give."""
    return tuple(n for n in _absent(model, estimate) if model.roles[n].role in NEEDED)


def taken_as_zero(model: Model, estimate: Estimate) -> tuple[str, ...]:
    """Return the parameters that bend the response at low frequencies only, and are taken as zero."""
    return tuple(n for n in _absent(model, estimate) if model.roles[n].role == "viscous")


def _absent(model: Model, estimate: Estimate) -> tuple[str, ...]:
    given = {*estimate.physical, *model.known, *estimate.params}
    return tuple(name for name in model.parameters if name not in given)


def _welch(record: Record, force: str, sensor: str) -> tuple[FloatArray, ComplexArray, FloatArray]:
    from scipy.signal import csd, welch

    u, y = record.signals[force], record.signals[sensor]
    options = {"fs": record.fs, "nperseg": max(16, 2 * record.n // (SEGMENTS + 1)), "detrend": "linear"}
    f, Suu = welch(u, **options)
    _, Syy = welch(y, **options)
    _, Suy = csd(u, y, **options)
    power = np.maximum(Suu * Syy, np.finfo(float).tiny)
    H = Suy / np.maximum(Suu, np.finfo(float).tiny)
    return f[LOWEST_BIN:], H[LOWEST_BIN:], np.clip(np.abs(Suy) ** 2 / power, 0.0, 1.0)[LOWEST_BIN:]


def _spread(f: FloatArray) -> IntArray:
    """Return places of at most MOST_POINTS frequencies, spread evenly over a logarithmic axis."""
    if f.size <= MOST_POINTS:
        return np.arange(f.size)
    wanted = np.geomspace(f[0], f[-1], MOST_POINTS)
    return np.unique(np.searchsorted(f, wanted).clip(0, f.size - 1))


def _modelled(
    model: Model, estimate: Estimate, sensor: Sensor, force: str, f: FloatArray
) -> ComplexArray | None:
    if missing_parameters(model, estimate):
        return None
    values = dict.fromkeys(model.parameters, 0.0)
    values |= {name: value for name, value in estimate.params.items() if name in values}
    values |= {name: value for name, value in estimate.physical.items() if name in values}
    forward = {entry.body: 1 for entry in model.friction if entry.asymmetric}
    try:
        space = model.state_space(values, forward or None)
    except (ZeroDivisionError, FloatingPointError):
        return None
    row = [entry.key for entry in model.sensors].index(sensor.key)
    column = [entry.key for entry in model.actuators].index(force)
    s = 2j * np.pi * f
    identity = np.eye(space.A.shape[0])
    x = np.linalg.solve(s[:, None, None] * identity - space.A, space.B[None, :, [column]])
    return np.asarray((space.C[[row]] @ x)[:, 0, 0] + space.D[row, column])
