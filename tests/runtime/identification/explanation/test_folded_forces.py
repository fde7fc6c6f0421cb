"""What is folded into a force that bends: as large as theory says, and nothing where it does not bend."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.identification.explanation.explained import slope_of
from modelgen.runtime.identification.explanation.folded_forces import (
    bending_forces,
    folded_forces,
    forces_bend,
    white_moves,
)
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.companion_simulation import simulated_beside
from modelgen.runtime.iv.physical.physical_iv import fit_physical_iv
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.records.record import Record
from tests.runtime.iv.physical.test_composite_iv import model_of
from tests.runtime.iv.physical.test_near_an_estimate import motor_alone
from tests.runtime.two_mass_records import FS, SMALL, TRUTH

N, FINE = 2000, 16
CORNERS = (300, 320, 900, 920, 1500, 1520)


def bent(noise: float) -> tuple[FloatArray, FloatArray]:
    """Return a force with corners at samples, and what of it is folded, shape (N,) each."""
    t = np.arange(N * FINE) / FINE
    # begins and ends at zero
    force = np.interp(t, (0, *CORNERS, N), (0.0, 0.0, 8.0, 8.0, -4.0, -4.0, 0.0, 0.0))
    spectrum = np.fft.rfft(force)
    spectrum[N // 2 :] = 0.0
    folded = (force - np.fft.irfft(spectrum, N * FINE))[::FINE]
    return force[::FINE] + noise * np.random.default_rng(4).standard_normal(N), folded


def found(force: FloatArray) -> FloatArray:
    key = SMALL.actuators[0].key
    signals = {sensor.key: 1e-3 * np.sin(np.arange(N) / 50.0) for sensor in SMALL.sensors}
    record = Record({**signals, key: force}, FS, "run")
    assert forces_bend(SMALL, [record]) == bool(np.max(np.abs(force)) > 2.0)
    choice = choose_filter(SMALL, [record], cutoff_hz=0.05 * FS)
    simulated = simulated_beside(SMALL, TRUTH, record, choice)
    (effect,) = folded_forces(SMALL)
    return effect.changes(simulated).get(key, np.zeros(N))


def test_a_bend_at_a_sample_is_folded_as_theory_says() -> None:
    force, folded = bent(0.002)
    for cutoff in (0.03, 0.06):
        wanted = zero_phase(folded, 4, cutoff * FS, FS)
        left = zero_phase(found(force), 4, cutoff * FS, FS) - wanted
        assert np.linalg.norm(left) < 0.2 * np.linalg.norm(wanted)


def test_a_smooth_force_and_noise_have_nothing_folded() -> None:
    noise = 0.01 * np.random.default_rng(5).standard_normal(N)
    assert not found(np.sin(2.0 * np.pi * 0.02 * np.arange(N)) + noise).any()


def test_a_force_that_bends_at_every_sample_has_a_twelfth_of_its_curvature_too_much() -> None:
    t = np.arange(N)
    force = np.sin(2.0 * np.pi * 0.02 * t)
    key = SMALL.actuators[0].key
    signals = {sensor.key: 1e-3 * np.sin(t / 50.0) for sensor in SMALL.sensors}
    record = Record({**signals, key: force}, FS, "run")
    simulated = simulated_beside(SMALL, TRUTH, record, choose_filter(SMALL, [record], cutoff_hz=0.05 * FS))
    (effect,) = bending_forces(SMALL)
    found = effect.changes(simulated)[key]
    # straight between samples: (pi f / fs)^2 / 3 more of its spectrum
    np.testing.assert_allclose(found[1:-1], (np.pi * 0.02) ** 2 / 3.0 * force[1:-1], rtol=2e-3, atol=1e-12)


def test_white_rows_say_what_moves_in_physical_parameters() -> None:
    setting, rows = motor_alone()
    model = setting.model
    fit = fit_physical_iv(setting, rows, {}, dict(model.parameter_sets["light"]), settled=True).fit
    slope = slope_of(model, fit)
    assert slope is not None
    moved = white_moves(SimpleNamespace(choice=setting.choice, records=setting.records), fit, slope)  # type: ignore[arg-type]
    assert moved is not None
    # what the rows grow by if all parameters do is that
    more = slope @ (1e-3 * np.array([*fit.physical(model.parameters).values()]))  # type: ignore[union-attr]
    apart = moved([block.W @ more for block in fit.blocks]) - more
    assert np.all(np.abs(apart) < 1e-3 * np.sqrt(np.diag(hac_covariance(fit))))
    assert np.any(np.abs(more) > np.sqrt(np.diag(hac_covariance(fit))))
    assert white_moves(None, replace(fit, carried=None), slope) is None  # type: ignore[arg-type]


LOAD = """
chain = { name = "load", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", actuator = "T" },
    { name = "l", inertia = "J_l" },
]
links = [{ bodies = ["m", "l"], stiffness = "K", damping = "D" }]
[sensors.load]
q_l = { body = "l", measures = "position" }
"""
CHAIN = {"J_m": 1e-3, "F_vm": 9.4e-3, "J_l": 2e-3, "D": 3.35e-3, "K": 10.53}


def driven(seed: int, rate: float = 2000.0, loop_s: float = 3e-4, n: int = 16000) -> Record:
    """Return the record of a load whose motor's torque follows a command a sample behind a current loop."""
    from scipy.linalg import expm

    rng = np.random.default_rng(seed)
    j, v, k, d = CHAIN["J_m"], CHAIN["F_vm"], CHAIN["K"], CHAIN["D"]
    twist = np.array([-k, -d, k, d])
    A = np.zeros((6, 6))
    A[0, 1] = A[2, 3] = 1.0
    A[1, :4], A[3, :4] = (twist - np.array([0.0, v, 0.0, 0.0])) / j, -twist / CHAIN["J_l"]
    A[1, 4], A[4, 4], A[4, 5] = 1.0 / j, -1.0 / loop_s, 1.0 / loop_s
    step = expm(A / rate)
    t, lines = np.arange(n) / rate, np.geomspace(0.3, 60.0, 60)
    command = sum(
        np.cos(2.0 * np.pi * f * t + phase) for f, phase in zip(lines, rng.uniform(0, 6.28, 60), strict=True)
    )
    command *= 0.3 / np.max(np.abs(command))
    states, state = np.zeros((n, 6)), np.zeros(6)
    for i in range(n):
        state[5] = command[i]
        states[i] = state
        state = step @ state
    torque = np.round(states[:, 4] / 3e-4) * 3e-4
    return Record({"q_l": states[:, 2] + 1e-5 * rng.normal(size=n), "T": torque}, rate, f"r{seed}")


@pytest.mark.slow
def test_intervals_hold_what_a_current_loop_does_between_samples() -> None:
    model, far = model_of(LOAD, "load"), list[float]()
    for seed in (1, 3, 5):
        estimate = identify(model, [driven(seed), driven(seed + 1)])
        found = {one.name: one for one in estimate.parameters.identified}
        error = (found["D/K"].value - CHAIN["D"] / CHAIN["K"]) / found["D/K"].std
        far.append(abs(error))
        assert any("bends at every sample" in note for note in estimate.fit.notes)
    assert max(far) < 3.0
