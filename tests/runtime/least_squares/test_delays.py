from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.delays import advanced, fit_with_delays
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.known_delays import aligned
from modelgen.runtime.least_squares.time_shifts import hold, shift
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.simulation.simulate import simulate

QC = model_from_module(emps300_qm_qc)
FS = 5000.0


def late(delay_s: float) -> list[Record]:
    """A noisy chirp and trapezoid with a force record late by a quarter of a sample or a multiple of it."""
    rng = np.random.default_rng(5)
    records = []
    for kind in ("chirp", "trapezoid"):
        truth = QC.parameter_sets["light"]
        fine = simulate(QC, truth, kind, fs=4.0 * FS, duration_s=2.0, oversample=8).record
        by = round(4.0 * FS * delay_s)
        start, stop = 400, fine.n - 400
        signals = {key: samples[start:stop:4] for key, samples in fine.signals.items()}
        signals["Gamma_m"] = fine.signals["Gamma_m"][start - by : stop - by : 4]
        noise = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}
        noisy = {key: s + noise[key] * rng.standard_normal(s.size) for key, s in signals.items()}
        records.append(Record(noisy, FS, kind, kind))
    return records


def test_a_shift_is_exact_for_polynomials_and_good_for_slow_waves() -> None:
    k = np.arange(80.0)
    inside = slice(32, 48)
    np.testing.assert_allclose(shift("F", 0.3).whole(k**5)[inside], (k + 0.3)[inside] ** 5, rtol=1e-11)
    wave = np.sin(0.2 * np.pi * np.arange(200.0))
    moved = np.sin(0.2 * np.pi * (np.arange(200.0) - 2.5))
    np.testing.assert_allclose(shift("F", -2.5).whole(wave)[40:-40], moved[40:-40], atol=1e-10)
    # of a force up to a quarter of the sampling frequency a delay makes no low-pass
    fast, moved = (np.sin(0.5 * np.pi * (np.arange(200.0) - late)) for late in (0.0, 0.5))
    np.testing.assert_allclose(shift("F", -0.5).whole(fast)[40:-40], moved[40:-40], atol=1e-5)
    np.testing.assert_array_equal(shift("F", 1.0).whole(wave)[10:-10], wave[11:-9])


def test_a_held_command_is_half_a_sample_late_and_a_little_weaker() -> None:
    omega = 0.3
    wave = np.sin(omega * np.arange(300.0))
    # the average over one sample is sin(omega / 2) / (omega / 2)
    expected = np.sin(omega * (np.arange(300.0) - 0.5)) * np.sin(omega / 2.0) / (omega / 2.0)
    np.testing.assert_allclose(hold("F").whole(wave)[70:-70], expected[70:-70], atol=1e-7)


def test_advanced_moves_only_what_is_named() -> None:
    record = Record({"q_m": np.arange(80.0), "F": np.arange(80.0)}, 10.0, "run")
    moved = advanced(record, {"F": 0.05})
    np.testing.assert_array_equal(moved.signals["q_m"], record.signals["q_m"])
    np.testing.assert_allclose(moved.signals["F"][20:60], np.arange(20.5, 60.0))
    assert advanced(record, {"F": 0.0}) is record


@pytest.mark.slow
@pytest.mark.parametrize("samples", [0.5, -2.25])
def test_a_delay_is_found_with_its_standard_deviation_and_compensated(samples: float) -> None:
    records = late(samples / FS)
    estimate = identify(QC, records, **values_of("iv", drift_check=False))
    error = estimate.delays["Gamma_m"] - samples / FS
    assert abs(error) < 3.0 * estimate.delay_std["Gamma_m"]
    assert estimate.delay_std["Gamma_m"] < 0.01 / FS
    for name, value in QC.parameter_sets["light"].items():
        assert abs(estimate.params[name] - value) < 3.0 * estimate.bse[name]
    assert "Delay of Gamma_m" in estimate.summary()
    # not compensated, the load's parameters are far off
    wrong = identify(QC, records, **values_of("iv", delays="none", drift_check=False))
    assert abs(wrong.params["J_c"] / QC.parameter_sets["light"]["J_c"] - 1.0) > 0.01
    assert not wrong.delays


def test_a_delay_that_is_known_is_compensated_without_being_estimated() -> None:
    estimate = identify(QC, late(0.5 / FS), **values_of(delays={"Gamma_m": 0.5 / FS}, drift_check=False))
    assert estimate.params["J_c"] == pytest.approx(QC.parameter_sets["light"]["J_c"], rel=5e-3)
    assert not estimate.delays


def test_channels_and_words_that_do_not_exist_are_named() -> None:
    record = Record({key: np.arange(30.0) for key in QC.channels}, FS)
    with pytest.raises(DataError, match="Gamma"):
        aligned(QC, [record], {"Gamma": 1.0}, (), True)
    with pytest.raises(DataError, match="held"):
        aligned(QC, [record], None, ("q_m",), True)
    with pytest.raises(DataError, match="is 'guess'"):
        aligned(QC, [record], "guess", (), True)


def test_a_force_that_never_changes_has_no_delay_to_be_found() -> None:
    signals = {key: np.arange(30.0) for key in QC.channels}
    moving, still = Record(signals, FS), Record(signals | {"Gamma_m": np.full(30, 2.0)}, FS)
    assert aligned(QC, [still, moving], None, (), True)[1] == ("Gamma_m",)
    assert aligned(QC, [still], None, (), True)[1] == ()
    assert aligned(QC, [still], "estimate", (), False)[1] == ()


def test_rows_in_which_delays_are_looked_for_are_not_made_again() -> None:
    records, asked = (late(0.0)[0],), list[tuple[Record, ...]]()
    job = Job(QC, records, choose_filter(QC, records), late=("Gamma_m",))

    def run(these: tuple[Record, ...], _: Fit | None) -> tuple[Observation, Fit]:
        asked.append(these)
        observation = job.observed(these)
        return observation, fit_matched(observation)

    fit_with_delays(records, job.late, run, job.rates, lambda _: {"Gamma_m": 0.0})
    assert len({tuple(map(id, these)) for these in asked}) == len(asked) > 1
