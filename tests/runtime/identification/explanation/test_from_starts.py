"""Effects estimated from the start on, of motion in which every sample feels a reversal."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.explanation import explain_stretches
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.thresholds import SEARCHED
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.identification.explanation.test_simulated_directions import PLACES, servo
from tests.runtime.iv.physical.swinging_servo import FS, TRUTH, swung
from tests.runtime.iv.physical.test_composite_iv import model_of
from tests.runtime.iv.physical.test_zeros import CHAIN
from tests.runtime.iv.physical.test_zeros import NOISE as UNSEEN_NOISE
from tests.runtime.iv.physical.test_zeros import TRUTH as UNSEEN_TRUTH

NOISE = {"q_m": 1e-6, "q_l": 1e-6}


def lagging(samples: FloatArray, samples_late: float) -> FloatArray:
    """Return samples behind a first-order low-pass, exact for what is straight between them, shape (n,)."""
    over, under, _ = cont2discrete(([1.0], [samples_late, 1.0]), 1.0, "foh")
    return np.asarray(lfilter(over.ravel(), under, samples - samples[0]) + samples[0])


@pytest.mark.slow
@pytest.mark.parametrize("samples_late", [1.5, 2.5])
def test_directions_are_simulated_of_records_whose_low_pass_is_undone(samples_late: float) -> None:
    clean = swung(servo(), TRUTH, PLACES, 5)
    rng = np.random.default_rng(7)
    read = {**clean.signals, "q_l": lagging(clean.signals["q_l"], samples_late)}
    noise = {**NOISE, "T": 0.01 * float(np.std(clean.signals["T"]))}
    read = {key: read[key] + level * rng.standard_normal(clean.n) for key, level in noise.items()}
    found = identify(servo(), Record(read, FS, "swing"))
    assert any("q_l is read through a low-pass" in one.what for one in found.checks.advice)
    for entry in found.parameters.physical:
        assert abs(entry.value - TRUTH[entry.name]) < 3.0 * entry.std
    # with directions of the low-passed reading: F_sm to 57 %, K to 1.3 and 3 %
    spread = {entry.name: entry.std / TRUTH[entry.name] for entry in found.parameters.physical}
    assert spread["F_sm"] < 0.05
    assert spread["K"] < 0.002


@pytest.mark.slow
@pytest.mark.parametrize("searched", [SEARCHED, 6000])
def test_a_constant_force_behind_an_unseen_body_is_estimated_with_the_parameters(
    searched: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # of records that are longer, stretches decide
    monkeypatch.setattr(explain_stretches, "SEARCHED", searched)
    loaded = model_of(CHAIN.replace('inertia = "J_l"', 'inertia = "J_l", offset = "F_0"'), "ends")
    truth = {**UNSEEN_TRUTH, "F_0": 0.3}
    records = [
        simulate(loaded, truth, motion, fs=5000.0, duration_s=2.0, noise=UNSEEN_NOISE, seed=seed).record
        for seed, motion in enumerate(("chirp", "trapezoid"))
    ]
    estimate = identify(model_of(CHAIN, "ends"), records)
    assert any("a constant force (offset) acts on" in one.what for one in estimate.checks.advice)
    spread = {one.name: one.std / UNSEEN_TRUTH[one.name] for one in estimate.parameters.physical}
    for one in estimate.parameters.physical:
        assert abs(one.value - UNSEEN_TRUTH[one.name]) < 3.0 * one.std
    # where the intervals only hold what it moves: F_sm to 1.3 %, F_vm to 2.5 %, D_2 to 0.12 %
    assert spread["F_sm"] < 1e-3
    assert spread["F_vm"] < 3e-3
    assert spread["D_2"] < 5e-4
