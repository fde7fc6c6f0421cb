"""One estimate, wherever the samples are: in memory, in files, in chunks, in threads."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from generated import (
    emps300_qm_ac,
    emps300_qm_qc,
    emps_rigid_asymmetric_qm,
    emps_rigid_qm,
    three_mass_qa_qb_ac,
    tree_positions,
    two_mass_bench_qm_qc,
)
from modelgen import generate
from modelgen.errors import DataError, IdentifiabilityError, ModelgenError
from modelgen.runtime.files.npy_channels import NpyChannels, open_npy
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import Model, model_from_module, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, parse_spec

CHAINS: tuple[ModuleType, ...] = (
    emps300_qm_qc,
    emps300_qm_ac,
    emps_rigid_qm,
    emps_rigid_asymmetric_qm,
    three_mass_qa_qb_ac,
    tree_positions,
    two_mass_bench_qm_qc,
)
# of a sensor, as a share of how far it reads
FAINTEST_NOISE = 1e-7


def experiment(seed: int) -> tuple[Model, list[Record]]:
    """A chain, a sensor set and records, all drawn from a seed."""
    rng = np.random.default_rng(seed)
    model = model_from_module(CHAINS[int(rng.integers(len(CHAINS)))])
    truth = next(iter(model.parameter_sets.values()))
    kinds = [["chirp"], ["trapezoid"], ["chirp", "trapezoid"]][int(rng.integers(3))]
    noise = float(rng.choice([0.0, 1.0, 10.0, 100.0])) * FAINTEST_NOISE
    step = float(rng.choice([0.0, 0.0, 1e-4]))
    records = []
    for kind in kinds:
        record = simulate(model, truth, kind, duration_s=2.0, fs=2000.0, oversample=4).record
        signals = {}
        for key, samples in record.signals.items():
            span = float(np.ptp(samples))
            read = samples + noise * span * rng.standard_normal(record.n)
            if step and key.startswith("q"):
                read = np.round(read / (step * span)) * (step * span)
            if rng.random() < 0.15:  # samples that were lost and filled in by holding the last one
                first = int(rng.integers(record.n - 20))
                read[first : first + 15] = read[first]
            signals[key] = read
        records.append(Record(signals, record.fs, kind, kind))
    return model, records


def outcome(model: Model, records: Any, **options: Any) -> Estimate | str:
    """The estimate, or what the refusal says."""
    try:
        return identify(model, records, **values_of(**options))
    except ModelgenError as error:
        return str(error)


def same(found: Estimate | str, expected: Estimate | str, share: float = 1e-9) -> None:
    """`share` is that of a standard deviation by which values may differ."""
    if isinstance(found, str) or isinstance(expected, str):
        assert found == expected
        return
    assert found.not_identifiable == expected.not_identifiable
    null = [[one for one in e.checks.advice if one.kind == "null solution"] for e in (found, expected)]
    assert null[0] == null[1]
    if null[0]:  # a row that went to zero holds rounding, and so does what is said of it
        assert list(found.params) == list(expected.params)
        return
    assert found.checks.advice == expected.checks.advice
    assert found.fit.notes == expected.fit.notes
    assert found.fit.filtering == expected.fit.filtering
    assert found.nobs == expected.nobs
    for got, wanted in (
        (found.parameters.identified, expected.parameters.identified),
        (found.parameters.physical, expected.parameters.physical),
    ):
        assert [one.name for one in got] == [one.name for one in wanted]
        for one, other in zip(got, wanted, strict=True):
            assert abs(one.value - other.value) <= share * other.std + 1e-12 * abs(other.value)
            assert one.std == pytest.approx(other.std, rel=max(1e-7, share))
            # what other settings move is a difference of fits, each of them more uncertain than this one
            moved = share * other.std if share < 1e-8 else 1e-3 * other.std
            assert one.drift_std == pytest.approx(other.drift_std, rel=1e-6, abs=moved)


def in_files(record: Record, folder: Path) -> NpyChannels:
    folder.mkdir()
    for key, samples in record.signals.items():
        np.save(folder / f"{key}.npy", samples)
    return open_npy({key: folder / f"{key}.npy" for key in record.signals}, record.fs, record.name)


def in_all_files(records: list[Record], folder: Path) -> list[NpyChannels]:
    return [in_files(record, folder / record.name) for record in records]


def in_small_chunks(monkeypatch: pytest.MonkeyPatch, samples: int, threads: int) -> None:
    monkeypatch.setattr("modelgen.runtime.rows.chunk.CHUNK_SAMPLES", samples)
    monkeypatch.setattr("modelgen.runtime.rows.chunk.HALOS", 0)
    for module in ("records.channels", "records.period"):
        monkeypatch.setattr(f"modelgen.runtime.{module}.READ_SAMPLES", 4 * samples)
    monkeypatch.setattr("modelgen.runtime.numerics.threads.usable_threads", lambda: threads)


@pytest.mark.parametrize(
    "seed", [*range(8), *(pytest.param(k, marks=pytest.mark.slow) for k in range(8, 50))]
)
def test_files_chunks_and_threads_change_nothing(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, records = experiment(seed)
    expected, sources = outcome(model, records, method="wls"), in_all_files(records, tmp_path)
    same(outcome(model, sources, method="wls"), expected)
    same(in_chunks_and_threads(seed, model, sources, monkeypatch, "wls"), expected)


@pytest.mark.parametrize(
    "seed",
    [6, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 5, 7, 8, 9, 11, 12, 13, 14, 15, 16))],
)
def test_nor_do_they_change_the_default(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, records = experiment(seed)
    expected = outcome(model, records)
    # its rounds end within a tenth of a standard deviation of where they would come to rest: rounding shows
    same(
        in_chunks_and_threads(seed, model, in_all_files(records, tmp_path), monkeypatch, "auto"),
        expected,
        1e-6,
    )


def in_chunks_and_threads(
    seed: int, model: Model, sources: list[NpyChannels], monkeypatch: pytest.MonkeyPatch, method: str
) -> Estimate | str:
    in_small_chunks(monkeypatch, int(np.random.default_rng(seed).integers(200, 1500)), 1 + seed % 3)
    return outcome(model, sources, method=method)


def bench(seed: int = 0) -> tuple[Model, list[Record]]:
    model = model_from_module(emps300_qm_qc)
    noise = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}
    truth = model.parameter_sets["table_2"]
    return model, [
        simulate(model, truth, kind, duration_s=2.0, noise=noise, oversample=8, seed=seed + k).record
        for k, kind in enumerate(("chirp", "trapezoid"))
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"method": "iv"},
        {"method": "tls"},
        {"method": "pham2002"},
        {"delays": {"Gamma_m": 1e-4}, "held": ["Gamma_m"]},
        {"hold_out": 0.2},
        {"robust": "huber", "bounds": "physical"},
        {"delays": "estimate", "drift_check": False},
    ],
    ids=str,
)
def test_every_option_takes_files(tmp_path: Path, options: dict[str, Any]) -> None:
    model, records = bench()
    sources = in_all_files(records, tmp_path)
    same(outcome(model, sources, **options), outcome(model, records, **options))


@pytest.mark.slow
def test_long_records_are_looked_at_in_stretches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, records = bench()
    monkeypatch.setattr("modelgen.runtime.records.record_facts.WHOLE", 8192)
    estimate = identify(model, records)
    truth = model.parameter_sets["table_2"]
    for entry in estimate.parameters.identified:
        assert abs(entry.value - truth[entry.name]) < 5.0 * entry.std
    again = [Record(dict(record.signals), record.fs, record.name) for record in records]
    sources = in_all_files(again, tmp_path)
    same(identify(model, sources), estimate)


def test_asymmetric_friction_and_a_resting_channel() -> None:
    model = model_from_module(emps_rigid_asymmetric_qm)
    truth = next(iter(model.parameter_sets.values()))
    record = simulate(model, truth, "trapezoid", duration_s=4.0, fs=1000.0).record
    still = Record({**record.signals, "q_m": np.full(record.n, 3.0)}, 1000.0)
    for one in (still, still.edited({})):
        with pytest.raises(IdentifiabilityError):
            identify(model, Record.over(one), cutoff_hz=40.0)


@pytest.mark.slow
def test_wide_chains_hold_only_the_columns_that_a_row_touches(monkeypatch: pytest.MonkeyPatch) -> None:
    model, records = bench()
    expected = identify(model, records)
    monkeypatch.setattr("modelgen.runtime.rows.observation.WIDE", 1)
    same(identify(model, records), expected)
    for options in ({"method": "iv"}, {"robust": "huber"}, {"delays": "estimate", "drift_check": False}):
        wide = outcome(model, records, **options)
        monkeypatch.setattr("modelgen.runtime.rows.observation.WIDE", 40)
        same(wide, outcome(model, records, **options))
        monkeypatch.setattr("modelgen.runtime.rows.observation.WIDE", 1)


@pytest.mark.slow
def test_composites_give_physical_parameters(tmp_path: Path) -> None:
    only_motor = '\n[sensors.qm]\nq_m = { body = "m", measures = "position" }\n'
    spec = parse_spec(catalog_path("emps300").read_text(encoding="utf-8") + only_motor, "emps300.toml")
    model = model_from_text(generate(spec, "qm"), "qm")
    records = [Record({k: r.signals[k] for k in model.channels}, r.fs, r.name) for r in bench()[1]]
    same(outcome(model, in_all_files(records, tmp_path)), outcome(model, records))


def test_a_sample_that_is_not_finite_is_named(tmp_path: Path) -> None:
    model, records = bench()
    source = in_files(records[0], tmp_path / "chirp")
    samples = np.load(tmp_path / "chirp" / "q_c.npy")
    samples[4321] = np.nan
    np.save(tmp_path / "chirp" / "q_c.npy", samples)
    with pytest.raises(DataError, match="chirp: channel q_c, sample 4321: is nan"):
        identify(model, source)


def test_what_is_no_record_is_refused() -> None:
    model, records = bench()
    for given, message in (
        ([], "records: there are none"),
        ([records[0].signals], "records: hold a mappingproxy"),
        (5, "records: hold a int"),
    ):
        with pytest.raises(DataError, match=message):
            identify(model, given)  # type: ignore[arg-type]
    short = Record(dict.fromkeys(model.channels, np.sin(np.arange(60) * 0.1)), 5000.0, "run")
    with pytest.raises(DataError, match=r"run: has 60 samples"):
        identify(model, Record.over(short), cutoff_hz=300.0)


@pytest.mark.slow
def test_a_row_without_a_force_does_not_go_to_zero() -> None:
    # rounded to 1e-4 of its range, the trapezoid hides how the link bends
    model, records = experiment(7)
    truth = next(iter(model.parameter_sets.values()))
    found = identify(model, records)
    assert "go to zero" in found.fit.notes[0]
    for name, value in truth.items():
        assert abs(found.params[name] - value) < 3.0 * found.bse[name]
    with pytest.raises(IdentifiabilityError, match="row c go to zero"):
        identify(model, records, "iv")


@pytest.mark.slow
def test_friction_that_is_one_with_an_offset_does_not_lead_the_simulation_astray() -> None:
    model, records = experiment(32)
    estimate, truth = identify(model, records), next(iter(model.parameter_sets.values()))
    for name in ("Jm", "Jc", "K"):
        assert abs(estimate.params[name] - truth[name]) < 3.0 * estimate.bse[name]
        assert estimate.bse[name] < 0.05 * truth[name]
