"""Noise and resolution of instruments."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from generated import emps300_qm_qc
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.sensor_readings import (
    checked_levels,
    instrument_keys,
    readings,
)

EMPS = model_from_module(emps300_qm_qc)
TRUE = {"q_m": np.linspace(-1.0, 1.0, 20001), "q_c": np.zeros(20001), "Gamma_m": np.ones(20001)}


def test_instruments_are_sensors_then_actuators() -> None:
    assert instrument_keys(EMPS) == ("q_m", "q_c", "Gamma_m")


def test_perfect_instruments_read_the_truth() -> None:
    measured = readings(EMPS, TRUE, {}, {}, seed=3)
    assert list(measured) == ["q_m", "q_c", "Gamma_m"]
    for key, values in TRUE.items():
        np.testing.assert_array_equal(measured[key], values)


def test_noise_is_white_with_the_given_standard_deviation() -> None:
    noise = readings(EMPS, TRUE, {"q_c": 2e-5}, {}, seed=3)["q_c"]
    assert noise.std() == pytest.approx(2e-5, rel=0.02)
    assert abs(noise.mean()) < 4.0 * 2e-5 / 20001**0.5
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 4.0 / 20001**0.5


def test_a_seed_gives_the_same_noise_channel_by_channel() -> None:
    alone = readings(EMPS, TRUE, {"Gamma_m": 1e-3}, {}, seed=3)
    together = readings(EMPS, TRUE, {"Gamma_m": 1e-3, "q_m": 1e-3}, {}, seed=3)
    np.testing.assert_array_equal(alone["Gamma_m"], together["Gamma_m"])
    other = readings(EMPS, TRUE, {"Gamma_m": 1e-3}, {}, seed=4)
    assert not np.any(other["Gamma_m"] == alone["Gamma_m"])
    in_common = np.corrcoef(together["Gamma_m"] - 1.0, together["q_m"] - TRUE["q_m"])[0, 1]
    assert abs(in_common) < 4.0 / 20001**0.5


@pytest.mark.slow
@given(
    st.integers(0, 2**70),
    st.lists(st.tuples(st.text(max_size=5), st.integers(4000, 4003)), min_size=2, max_size=4, unique=True),
)
def test_motions_of_one_seed_share_no_noise(seed: int, motions: list[tuple[str, int]]) -> None:
    drawn = []
    for motion, n in motions:
        true = {key: np.zeros(n) for key in TRUE}
        read = readings(EMPS, true, dict.fromkeys(TRUE, 1.0), {}, seed, motion=motion)
        again = readings(EMPS, true, dict.fromkeys(TRUE, 1.0), {}, seed, motion=motion)
        assert all(np.array_equal(read[key], again[key]) for key in TRUE)
        drawn += [read[key][:4000] for key in TRUE]
    # whichever the motion and whichever the channel
    common = np.corrcoef(drawn) - np.eye(len(drawn))
    assert np.abs(common).max() < 6.0 / np.sqrt(4000)


def test_readings_are_rounded_to_the_resolution() -> None:
    step = 2.0 * np.pi / 400
    q = readings(EMPS, TRUE, {}, {"q_m": step}, seed=0)["q_m"]
    counts = q / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert len(np.unique(np.round(counts))) == 2 * round(1.0 / step) + 1
    assert np.abs(q - TRUE["q_m"]).max() == pytest.approx(step / 2.0, rel=0.01)


def test_every_wrong_level_is_named() -> None:
    with pytest.raises(DataError) as caught:
        noise = {"q_n": 1.0, "q_c": -1.0, "Gamma_m": float("nan")}
        checked_levels(instrument_keys(EMPS), noise, None, None, 0)
    where = [(problem.where, problem.what) for problem in caught.value.problems]
    assert where == [("noise", "has no channel q_n"), ("noise: q_c", "is -1.0"), ("noise: Gamma_m", "is nan")]
