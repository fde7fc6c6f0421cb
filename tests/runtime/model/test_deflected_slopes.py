"""What parameters move rows by through positions of damped springs, against differences of rows."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.model.deflected_kernel import DeflectedKernel, slope_key
from modelgen.runtime.model.given_directions import Succession
from modelgen.runtime.model.model import Model
from tests.runtime.made_arm_records import catalogued, model_of
from tests.symbolic.arms.elastic_arms import with_sensors
from tests.symbolic.arms.test_elastic_rows import both

FS = 1000.0


def lagging_arm(lag: float) -> tuple[Model, DeflectedKernel]:
    """Return two joints of which only the motors are seen, about a point whose springs lag by so many s."""
    arm = catalogued("elastic_two_link")
    values = dict(arm.parameter_sets["nominal"])
    values |= {f"D_{k}": lag * values[f"K_{k}"] for k in (1, 2)}
    model = model_of(with_sensors(arm, *both()), sensor_set="s")
    assert isinstance(model.kernel, DeflectedKernel)
    return model, model.kernel.at(model.base_from_physical({name: values[name] for name in model.parameters}))


def held(kernel: DeflectedKernel, at: DeflectedKernel, read: dict[tuple[str, int], np.ndarray]) -> np.ndarray:
    """Return what rows hold, (rows, N): entries where springs are as `at` says, times the kernel's point."""
    lines, rows = (
        at.lines(read, Succession(FS, None)),
        np.zeros((max(kernel.rows) + 1, len(read["tau_1", 0]))),
    )
    for key, (row, column) in kernel.places.items():
        rows[row] += (-1.0 if column is None else kernel.point[column]) * lines[key]
    return rows


@pytest.mark.parametrize("lag", [5e-4, 4e-3, 1.5e-2])
def test_springs_and_dampers_move_rows_as_columns_say(lag: float) -> None:
    """A series in the lag, as for noise, is half of a damper's column off where it lags much."""
    model, kernel = lagging_arm(lag)
    t = np.arange(0.0, 4.0, 1.0 / FS)
    rng, read = np.random.default_rng(3), dict[tuple[str, int], np.ndarray]()
    tones = {
        key: [(f, rng.uniform(0, 6)) for f in (1.0, 2.5, 8.0)] for key in sorted({k for k, _ in kernel.reads})
    }
    for key, order in (*kernel.reads, ("tau_1", 0)):
        size, rates = (60.0 if key.startswith("tau") else 0.5), [2.0 * np.pi * f for f, _ in tones[key]]
        waves = (
            size / f * (2j * np.pi * f) ** order * np.exp(1j * (w * t + phase))
            for w, (f, phase) in zip(rates, tones[key], strict=True)
        )
        read[key, order] = np.real(sum(waves, np.zeros(len(t), dtype=complex)))
    lines, inside = kernel.lines(read, Succession(FS, None)), slice(1000, -1000)
    for name in ("K_1", "D_1", "K_2", "D_2"):
        column = model.base_parameters.index(name)
        step = np.zeros(len(kernel.point))
        step[column] = 1e-4 * kernel.point[column]
        ahead, behind = (held(kernel, kernel.at(kernel.point + sign * step), read) for sign in (1.0, -1.0))
        change = (ahead - behind) / (2.0 * step[column])
        for row in kernel.rows:
            off = lines[slope_key(row, column)] - change[row]
            assert np.linalg.norm(off[inside]) < 5e-3 * np.linalg.norm(change[:, inside])
