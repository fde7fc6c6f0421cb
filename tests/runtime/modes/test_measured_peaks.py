"""Peaks of measured responses lie at the modes; where the force excites nothing there are none."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from generated import three_mass_qa_qb_qc
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.modes.find_modes import modes_at
from modelgen.runtime.modes.measured_peaks import with_peaks
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate

MODEL = model_from_module(three_mass_qa_qb_qc)
TRUTH = MODEL.parameter_sets["nominal"]
NOISE = {"q_a": 1e-6, "q_b": 1e-6, "q_c": 1e-6, "Gamma_a": 1e-5}


def record(kind: str) -> Record:
    return simulate(MODEL, TRUTH, kind, duration_s=4.0, fs=2000.0, noise=NOISE, seed=1).record


def test_a_chirp_shows_the_modes_that_it_passes() -> None:
    modes = modes_at(MODEL, TRUTH)
    found = with_peaks(modes, MODEL, [record("chirp")])
    assert found[0].measured is None
    seen = [mode for mode in found if mode.measured]
    assert seen
    for mode in seen:
        away = abs(mode.measured.frequency_hz - mode.frequency_hz.value)
        assert away < 1.5 * mode.measured.resolution_hz + 0.03 * mode.frequency_hz.value
    assert "peak Hz" in str(found)
    assert found.to_dict()["modes"][-1]["measured"] is not None


def test_a_well_damped_mode_has_a_wide_peak() -> None:
    damped = {name: 8.0 * value if name.startswith("F_d") else value for name, value in TRUTH.items()}
    modes = modes_at(MODEL, damped)
    (last,) = modes[-1:]
    assert last.damping_ratio.value > 0.1
    chirp = simulate(MODEL, damped, "chirp", duration_s=4.0, fs=2000.0, noise=NOISE, seed=1).record
    peak = with_peaks(modes, MODEL, [chirp])[-1].measured
    assert peak is not None
    assert abs(peak.frequency_hz - last.frequency_hz.value) < 0.05 * last.frequency_hz.value


@pytest.mark.parametrize("seed", range(4))
def test_noise_and_what_leaks_make_no_peaks(seed: int) -> None:
    modes = modes_at(MODEL, TRUTH)
    rng = np.random.default_rng(seed)
    noise = Record({key: level * rng.normal(size=8000) for key, level in NOISE.items()}, 2000.0)
    assert with_peaks(modes, MODEL, [noise]) == modes
    slow = record("trapezoid")
    found = with_peaks(modes, MODEL, [slow.part(0, slow.n - 100 * seed, "slow")])
    assert all(
        mode.measured is None for mode in found if mode.frequency_hz and mode.frequency_hz.value > 50.0
    )
    still = Record({key: np.zeros(8000) for key in NOISE}, 2000.0)
    assert with_peaks(modes, MODEL, [still]) == modes


def test_an_estimate_takes_its_peaks_along() -> None:
    estimate = identify(MODEL, record("chirp"), "wls")
    assert any(mode.measured for mode in estimate.modes())
    fresh = identify(MODEL, record("chirp"), "wls")
    back = pickle.loads(pickle.dumps(fresh))
    assert back.source is None
    assert back.modes() == estimate.modes()
    assert Estimate.from_json(fresh.to_json()).modes() == estimate.modes()
