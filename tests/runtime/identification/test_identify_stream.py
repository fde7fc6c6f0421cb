"""Records in chunks against `identify`, which has them whole."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, emps_rigid_asymmetric_qm
from modelgen import generate
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filter_choice.stretches import choose_from_stretches, stretches
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.identify_stream import identify_stream
from modelgen.runtime.least_squares.hac_covariance import (
    fixed_b_factor,
    joined_covariance,
    long_run_covariance,
    window_width,
)
from modelgen.runtime.least_squares.hac_covariance_chunks import MomentSums, ParzenSums, bandwidth_of
from modelgen.runtime.least_squares.triangle_fit import fit_factors, with_inverse
from modelgen.runtime.model.model import Model, model_from_module, model_from_text
from modelgen.runtime.records.channels import RecordChannels, read_continued
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.record_factors import record_factors
from modelgen.runtime.rows.record_rows import matched_rows
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, parse_spec

NOISE = {"q_m": 2e-5, "q_c": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}
SETTINGS: dict[str, Any] = {
    "cutoff_hz": 300.0,
    "filter_order": 4,
    "decimation": 6,
    "direction_cutoff_hz": 100.0,
}


def records(model: Model) -> list[Record]:
    noise = {key: NOISE[key] for key in model.channels if key in NOISE}
    truth = model.parameter_sets["table_2"]
    return [
        simulate(model, truth, kind, duration_s=2.0, noise=noise, oversample=8, seed=seed).record
        for seed, kind in enumerate(("chirp", "trapezoid"))
    ]


@pytest.fixture(scope="module", params=[emps300_qm_qc, emps300_qm_ac], ids=["qc", "ac"])
def case(request: pytest.FixtureRequest) -> tuple[Model, list[Record]]:
    model = model_from_module(request.param)
    return model, records(model)


def distance(a: Estimate, b: Estimate) -> float:
    """Largest difference of the parameters in standard deviations."""
    return max(abs(a.params[name] - b.params[name]) / b.bse[name] for name in b.params)


@pytest.mark.parametrize("settings", [SETTINGS, {}], ids=["given", "chosen"])
def test_it_is_the_estimate_of_identify(case: tuple[Model, list[Record]], settings: dict[str, Any]) -> None:
    model, given = case
    whole = identify(model, given, **settings)
    chunked = identify_stream(model, given, **settings)
    # the ends of a record are continued differently, which may move a reversal there by a sample
    assert abs(chunked.nobs - whole.nobs) <= 2
    assert list(chunked.params) == list(whole.params)
    assert list(chunked.physical) == list(whole.physical)
    assert list(chunked.not_identifiable) == list(whole.not_identifiable)
    assert chunked.filtering == whole.filtering
    for got, expected in zip(
        chunked.parameters + chunked.physical_parameters,
        whole.parameters + whole.physical_parameters,
        strict=True,
    ):
        assert abs(got.value - expected.value) < 1e-2 * expected.std
        for kind in ("std", "noise_std", "drift_std", "printed_std"):
            assert getattr(got, kind) == pytest.approx(getattr(expected, kind), rel=5e-3)
    assert chunked.sigma == pytest.approx(whole.sigma, rel=1e-3)
    assert chunked.relative_error == pytest.approx(whole.relative_error, rel=1e-3)
    assert chunked.condition_number == pytest.approx(whole.condition_number, rel=1e-3)
    for row, expected_row in zip(chunked.rows, whole.rows, strict=True):
        assert (row.record, row.row, row.unit) == (expected_row.record, expected_row.row, expected_row.unit)
        assert row.relative_error == pytest.approx(expected_row.relative_error, rel=1e-2)
    assert [step.removed for step in chunked.pruning.steps] == [step.removed for step in whole.pruning.steps]


def test_chunks_change_nothing(case: tuple[Model, list[Record]]) -> None:
    model, given = case
    whole = identify_stream(model, given, **SETTINGS)
    for samples in (800, 3777):
        chunked = identify_stream(model, given, chunk_samples=samples, **SETTINGS)
        assert chunked.nobs == whole.nobs
        assert distance(chunked, whole) < 1e-8
        for name in whole.params:
            assert chunked.bse[name] == pytest.approx(whole.bse[name], rel=1e-7)


def test_threads_change_nothing(case: tuple[Model, list[Record]]) -> None:
    model, given = case
    alone, *others = (
        identify_stream(model, given, chunk_samples=1600, threads=threads, **SETTINGS).to_json()
        for threads in (1, 2, 3, None)
    )
    assert others == [alone] * 3
    choice = FilterChoice(4, 300.0, 100.0, (6,), None, None, (), (), ())
    task = matched_rows(model, RecordChannels(given[0]), choice, 6, samples=1600)
    assert len(list(task.chunks())) > 3
    triangles = [[row.R for row in record_factors(task, threads).rows] for threads in (1, 2, 3)]
    for other in triangles[1:]:
        for found, expected in zip(other, triangles[0], strict=True):
            np.testing.assert_array_equal(found, expected)  # to the last bit
    for threads in (0, 1.5, True, "2"):
        with pytest.raises(DataError, match=f"threads: is {threads!r}"):
            identify_stream(model, given, threads=threads, **SETTINGS)


def test_filters_of_a_long_record_come_from_stretches(
    case: tuple[Model, list[Record]], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, given = case
    monkeypatch.setattr("modelgen.runtime.filter_choice.stretches.WHOLE", 8192)
    chirp = given[0]
    pieces = stretches(model, RecordChannels(chirp))
    assert [piece.name for piece in pieces] == [f"chirp from sample {k}" for k in (0, 2651, 5301, 7952)]
    assert {piece.n for piece in pieces} == {2048}
    np.testing.assert_array_equal(pieces[3].signals["q_m"], chirp.signals["q_m"][7952:])
    choice = choose_from_stretches(model, [pieces, stretches(model, RecordChannels(given[1]))])
    assert len(choice.decimation) == 2
    assert len(choice.bands) == 8
    # the chirp asks for the most where it is fastest
    whole = identify_stream(model, given)
    assert whole.filtering == choice
    truth = model.parameter_sets["table_2"]
    for entry in whole.parameters:
        assert abs(entry.value - truth[entry.name]) < 5.0 * entry.std


def test_the_report_of_a_stream_is_that_of_identify(case: tuple[Model, list[Record]]) -> None:
    model, given = case
    found = identify_stream(model, given, **SETTINGS)
    text = found.summary()
    assert text.startswith(f"emps300, sensors {model.sensor_set}: wls")
    assert f"Samples r = {found.nobs}, condition number" in text
    assert '"nobs": ' + str(found.nobs) in found.to_json()
    assert len(found.resid) == 0


def test_composites_give_physical_parameters() -> None:
    only_motor = '\n[sensors.qm]\nq_m = { body = "m", measures = "position" }\n'
    spec = parse_spec(catalog_path("emps300").read_text(encoding="utf-8") + only_motor, "emps300.toml")
    model = model_from_text(generate(spec, "qm"), "qm")
    truth = model.parameter_sets["table_2"]
    given = [
        simulate(model, truth, kind, duration_s=2.0, oversample=8, seed=seed).record
        for seed, kind in enumerate(("chirp", "trapezoid"))
    ]
    whole, chunked = identify(model, given), identify_stream(model, given)
    assert list(chunked.physical) == list(whole.physical)
    assert list(chunked.not_identifiable) == list(whole.not_identifiable)
    for got, expected in zip(chunked.physical_parameters, whole.physical_parameters, strict=True):
        assert abs(got.value - expected.value) < 1e-2 * expected.std


def test_asymmetric_friction_and_a_resting_channel() -> None:
    model = model_from_module(emps_rigid_asymmetric_qm)
    truth = next(iter(model.parameter_sets.values()))
    record = simulate(model, truth, "trapezoid", duration_s=4.0, fs=1000.0).record
    chunked = identify_stream(model, [record], cutoff_hz=40.0, direction_cutoff_hz=40.0, chunk_samples=1000)
    whole = identify(model, [record], cutoff_hz=40.0, direction_cutoff_hz=40.0, drift_check=False)
    for name, value in whole.params.items():
        assert chunked.params[name] == pytest.approx(value, rel=1e-4)
    still = Record({**record.signals, "q_m": np.full(record.n, 3.0)}, 1000.0)
    with pytest.raises(IdentifiabilityError):
        identify_stream(model, [still], cutoff_hz=40.0)


def test_the_banded_solution_gives_the_same_fit(case: tuple[Model, list[Record]]) -> None:
    model, given = case
    choice = FilterChoice(4, 300.0, 100.0, (6, 6), None, None, (), (), ())
    factors = [record_factors(matched_rows(model, RecordChannels(record), choice, 6)) for record in given]
    dense, banded = fit_factors(model, factors, banded=False), fit_factors(model, factors, banded=True)
    assert banded.inverse is None
    whole = with_inverse(factors, banded)
    assert whole.inverse is not None
    assert dense.inverse is not None
    np.testing.assert_allclose(whole.inverse, dense.inverse, rtol=1e-8)
    np.testing.assert_allclose(whole.x, dense.x, rtol=1e-9)
    assert whole.residual_norm == pytest.approx(dense.residual_norm, rel=1e-9)
    np.testing.assert_allclose(banded.x, dense.x, rtol=1e-9)
    np.testing.assert_allclose(banded.variance, dense.variance, rtol=1e-9)


@pytest.mark.parametrize("phi", [0.0, 0.6, 0.96])
@pytest.mark.parametrize("pieces", [1, 7, 40])
def test_moving_sums_are_the_parzen_kernel(phi: float, pieces: int) -> None:
    rng = np.random.default_rng(0)
    series = []
    for n in (400, 900):
        psi = rng.standard_normal((n, 3))
        for t in range(1, n):
            psi[t] += phi * psi[t - 1]
        series.append(psi * np.exp(-np.arange(n) / 40.0)[:, None])
    moments = []
    for psi in series:
        sums = MomentSums(3)
        for part in np.array_split(psi, pieces):
            sums.add(part)
        moments.append(sums.result())
    bandwidth = bandwidth_of(moments)
    sums = []
    for psi in series:
        squares = ParzenSums(3, bandwidth)
        for part in np.array_split(psi, pieces):
            squares.add(part)
        sums.append(squares.result())
    total = sums[0].total + sums[1].total
    box = np.ones(window_width(bandwidth))
    triangle = np.convolve(box, box)
    kernel = np.convolve(triangle, triangle)[len(triangle) - 1 :] / (triangle @ triangle)
    expected = np.zeros((3, 3))
    for psi in series:
        for lag, share in enumerate(kernel[: len(psi)]):
            product = share * psi[lag:].T @ psi[: len(psi) - lag]
            expected += product if lag == 0 else product + product.T
    np.testing.assert_allclose(total, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())
    whole = long_run_covariance(series)
    joined = joined_covariance(sums, bandwidth, 1300)
    np.testing.assert_allclose(joined, whole, rtol=1e-9, atol=1e-9 * whole[0, 0])
    # less than all instants count, in each of the two
    assert np.all(np.diag(whole) > 1.002 * fixed_b_factor(bandwidth, 1300) * np.diag(expected))


def test_a_sample_that_is_not_finite_is_named() -> None:
    class Broken(RecordChannels):
        def read(self, channel: str, start: int, stop: int) -> np.ndarray:
            samples = super().read(channel, start, stop).copy()
            if channel == "q_c" and start <= 4321 < stop:
                samples[4321 - start] = np.nan
            return samples

    model = model_from_module(emps300_qm_qc)
    record = Record(dict.fromkeys(model.channels, np.sin(np.arange(20_000) * 0.1)), 5000.0, "run")
    with pytest.raises(DataError, match="run: channel q_c, sample 4321: is nan"):
        identify_stream(model, [Broken(record)], **SETTINGS)


def test_a_record_is_continued_by_its_odd_mirror_image() -> None:
    source = RecordChannels(Record({"q": np.array([1.0, 2.0, 4.0, 8.0])}, 1.0))
    got = read_continued(source, "q", -2, 6)
    np.testing.assert_array_equal(got, [-2.0, 0.0, 1.0, 2.0, 4.0, 8.0, 12.0, 14.0])
    np.testing.assert_array_equal(read_continued(source, "q", 1, 3), [2.0, 4.0])


def test_wrong_settings_and_short_records_are_refused() -> None:
    model = model_from_module(emps300_qm_qc)
    record = Record(dict.fromkeys(model.channels, np.sin(np.arange(60) * 0.1)), 5000.0, "run")
    with pytest.raises(DataError, match=r"run: has 60 samples"):
        identify_stream(model, [record], **SETTINGS)
    with pytest.raises(DataError, match=r"cutoff_hz: is 2500"):
        identify_stream(model, [record], cutoff_hz=2500.0)
    with pytest.raises(DataError, match="there are none"):
        identify_stream(model, [], cutoff_hz=100.0)
    with pytest.raises(DataError, match="run: has no channel Gamma_m; give it; the model needs q_m, q_c"):
        identify_stream(model, [record.select(("q_m", "q_c"))])
