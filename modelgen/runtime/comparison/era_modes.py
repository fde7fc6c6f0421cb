"""Elastic modes by a realization of the impulse response (ERA, from the library `control`); a yardstick.

Juang and Pappa 1985: Markov parameters by least squares, a balanced realization of their Hankel matrix, its
eigenvalues. It does not use the model of the chain and gives modes only: frequencies and damping ratios.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from modelgen.errors import DataError
from modelgen.runtime.comparison.thresholds import (
    EXTRA_ORDER,
    FILTER_ORDER,
    MARKOV,
    MOST_DAMPED,
    SAMPLES_A_PERIOD,
)
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.find_modes import modes_at
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.plant import body_order


@dataclass(frozen=True)
class EraMode:
    """An elastic mode."""

    frequency_hz: float
    damping_ratio: float


def modes_of_parameters(model: Model, parameters: Mapping[str, float]) -> tuple[EraMode, ...]:
    """Return the elastic modes of the chain with these parameters (SI), lowest first."""
    return tuple(
        EraMode(one.frequency_hz.value, one.damping_ratio.value)
        for one in modes_at(model, parameters)
        if one.frequency_hz and one.damping_ratio and abs(one.damping_ratio.value) < MOST_DAMPED
    )


def modes_of_record(model: Model, record: Record, highest_hz: float) -> tuple[EraMode, ...]:
    """Return the modes up to a frequency (Hz) that explain the sensors' velocities by the force.

    Raises
    ------
    DataError
        When the library is absent.
    """
    try:
        from control import TimeResponseData, eigensys_realization, markov
    except ImportError as error:
        remedy = "get it with: pip install 'modelgen[control]'"
        raise DataError.at("subspace method", "needs the library control", remedy) from error
    factor = max(1, int(record.fs / (SAMPLES_A_PERIOD * highest_hz)))
    cutoff = 0.4 * record.fs / factor
    outputs = []
    for sensor in model.sensors:
        order = sensor.order
        smooth = zero_phase(record.signals[sensor.key], FILTER_ORDER, cutoff, record.fs)
        # accelerations: their impulse response decays even with a rigid mode
        outputs.append(differentiate(smooth, record.dt, 2 - order)[::factor])
    u = zero_phase(record.signals[model.actuators[0].key], FILTER_ORDER, cutoff, record.fs)[::factor]
    scaled = [y / max(float(np.std(y)), 1e-300) for y in outputs]
    dt = factor * record.dt
    data = TimeResponseData(np.arange(u.size) * dt, np.array(scaled), inputs=u[None], issiso=False)
    impulse = np.atleast_3d(markov(data, MARKOV, dt=dt, truncate=True))
    bodies = len(body_order(model))
    system, _ = eigensys_realization(impulse, 2 * (bodies - 1) + EXTRA_ORDER, dt=dt)
    z = np.linalg.eigvals(system.A).astype(complex)
    return tuple(m for m in _modes(np.log(z) / dt) if m.frequency_hz < highest_hz and m.damping_ratio > 0.0)


def _modes(poles: npt.NDArray[np.complex128]) -> tuple[EraMode, ...]:
    found = [
        EraMode(float(abs(p)) / (2.0 * np.pi), float(-p.real / abs(p)))
        for p in poles
        if p.imag > 0.0 and abs(p.real) < MOST_DAMPED * abs(p)
    ]
    return tuple(sorted(found, key=lambda mode: mode.frequency_hz))
