"""Effects estimated from the start on, of motion in which every sample feels a reversal."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import cont2discrete, lfilter

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.explanation import explain_stretches
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.thresholds import SEARCHED
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.identification.explanation.test_simulated_directions import PLACES, servo
from tests.runtime.iv.physical.swinging_servo import FS, TRUTH, swung
from tests.runtime.iv.physical.test_composite_iv import model_of
from tests.runtime.iv.physical.test_zeros import CHAIN
from tests.runtime.iv.physical.test_zeros import NOISE as UNSEEN_NOISE
from tests.runtime.iv.physical.test_zeros import TRUTH as UNSEEN_TRUTH
from tests.runtime.iv.shapes.chains import KNOWN, TWO

Signals = Mapping[str, FloatArray]
NOISE = {"q_m": 1e-6, "q_l": 1e-6}
MOTOR_ALONE = '[sensors.s]\nq_m = { body = "m", measures = "position" }\n'


def lagging(samples: FloatArray, samples_late: float) -> FloatArray:
    """Return samples behind a first-order low-pass, of the smooth motion that they are of, shape (n,)."""
    fine, places = 20, np.arange(len(samples))
    between = np.arange((len(samples) - 1) * fine + 1) / fine
    smooth = make_interp_spline(places, samples, k=5)(between) - samples[0]
    over, under, _ = cont2discrete(([1.0], [fine * samples_late, 1.0]), 1.0, "foh")
    return np.asarray(lfilter(over.ravel(), under, smooth)[::fine] + samples[0])


@pytest.mark.slow(begins="first")
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


def misread(
    model: Model, truth: dict[str, float], read: Callable[[Signals], Signals], duration_s: float = 2.0
) -> list[Record]:
    """Return a chirp and a trapezoid at 2 kHz each, with noise, of channels that are read wrongly."""
    levels, found = {"T": 2e-3, "q_m": 3e-6, "a_c": 0.3}, []
    for motion in ("chirp", "trapezoid"):
        clean = simulate(model, truth, motion, fs=2000.0, duration_s=duration_s, oversample=40).record.signals
        signals = read({key: np.asarray(clean[key]) for key in levels if key in clean})
        rng = np.random.default_rng(len(found))
        noisy = {key: line + levels[key] * rng.standard_normal(len(line)) for key, line in signals.items()}
        found.append(Record(noisy, 2000.0, motion))
    return found


@pytest.mark.slow
def test_a_force_behind_a_lag_is_told_from_the_motor_alone() -> None:
    """Its delay is found, and the lag is taken for inertia where it is not estimated."""
    over, under, _ = cont2discrete(([1.0], [0.8, 1.0]), 1.0, "foh")

    def commanded(signals: Signals) -> Signals:
        first = signals["T"][0]
        return {**signals, "T": np.asarray(lfilter(under, over.ravel(), signals["T"] - first) + first)}

    model = model_of(TWO + MOTOR_ALONE, "s")
    found = identify(model, misread(model, KNOWN, commanded))
    assert any("T acts behind a lag" in one.what for one in found.checks.advice)
    for entry in found.parameters.physical:
        assert abs(entry.value - KNOWN[entry.name]) < 3.0 * entry.std
    assert found.physical["J_m"] == pytest.approx(KNOWN["J_m"], rel=0.01)


@pytest.mark.slow(begins="first")
def test_a_sensor_that_is_late_is_found_with_physical_parameters() -> None:
    """Rows of an accelerometer and a motor's encoder hold composites of more parameters than they have."""
    chain = TWO.replace('inertia = "J_c"', 'inertia = "J_c"\nviscous = "F_vc"')
    model = model_of(chain + MOTOR_ALONE + 'a_c = { body = "c", measures = "acceleration" }\n', "s")
    truth = {**KNOWN, "F_vc": 0.01}

    def late(signals: Signals) -> Signals:
        t = np.arange(len(signals["a_c"]))
        return {**signals, "a_c": CubicSpline(t, signals["a_c"])(t - 0.6)}

    found = identify(model, misread(model, truth, late, 1.0))
    assert found.fit.notes[0] == "method iv, in the physical parameters"
    # the same but for the delay of the force, which is estimated as well
    said = ("a_c is late by 300 us", "q_m is early by 300 us")
    assert any(words in one.what for one in found.checks.advice for words in said)
    for entry in found.parameters.physical:
        assert abs(entry.value - truth[entry.name]) < 3.0 * entry.std
    assert found.parameters.physical[-1].name == "K"
    assert found.parameters.physical[-1].std < 1e-3 * KNOWN["K"]
