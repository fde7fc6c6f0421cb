"""What must not change an estimate: chunks, order of rows and records, threads, hash seed, another run."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.simulation.simulate import simulate

ROOT = Path(__file__).resolve().parents[1]
SETTINGS: dict[str, Any] = {
    "cutoff_hz": 300.0,
    "filter_order": 6,
    "decimation": 6,
    "direction_cutoff_hz": 100.0,
}
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}
SAME = 1e-9  # of a standard deviation


@pytest.fixture(scope="module", params=[emps300_qm_qc, emps300_qm_ac], ids=["qm_qc", "qm_ac"])
def case(request: pytest.FixtureRequest) -> tuple[Model, tuple[Record, ...]]:
    model = model_from_module(request.param)
    noise = {key: NOISE[key] for key in model.channels if key in NOISE}
    truth = model.parameter_sets["table_2"]
    return model, tuple(
        simulate(model, truth, kind, duration_s=2.0, noise=noise, oversample=8, seed=seed).record
        for seed, kind in enumerate(("chirp", "trapezoid"))
    )


def apart(found: Estimate, expected: Estimate) -> float:
    """Return the largest difference of two estimates in standard deviations."""
    assert list(found.params) == list(expected.params)
    return max(
        abs(found.params[name] - expected.params[name]) / expected.bse[name] for name in expected.params
    )


@pytest.mark.slow
@pytest.mark.parametrize("samples", [700, 1024, 3777, 9999, 10_000, 1_000_000])
def test_chunks_change_nothing(
    case: tuple[Model, tuple[Record, ...]], samples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, records = case
    whole = identify(model, records, **values_of(drift_check=False, **SETTINGS))
    monkeypatch.setattr("modelgen.runtime.rows.chunk.CHUNK_SAMPLES", samples)
    monkeypatch.setattr("modelgen.runtime.rows.chunk.HALOS", 0)
    chunked = identify(model, records, **values_of(drift_check=False, **SETTINGS))
    assert apart(chunked, whole) < SAME
    assert chunked.nobs == whole.nobs


@pytest.mark.parametrize("method", ["wls", "pham2002"])
def test_the_order_of_records_changes_nothing(case: tuple[Model, tuple[Record, ...]], method: str) -> None:
    model, records = case
    given = {**SETTINGS, "method": method, "drift_check": False}
    assert (
        apart(
            identify(model, records[::-1], **values_of(**given)),
            identify(model, records, **values_of(**given)),
        )
        < SAME
    )


def test_the_order_of_rows_changes_nothing(case: tuple[Model, tuple[Record, ...]]) -> None:
    model, records = case
    job = Job(model, records, choose_filter(model, records, **SETTINGS))
    observation, fit = METHODS["wls"].run(job)
    std = np.sqrt(np.diag(hac_covariance(fit)))
    random = np.random.default_rng(0)

    def shuffled(block: RowBlock) -> RowBlock:
        order = random.permutation(len(block.Y))
        return replace(block, Y=block.Y[order], W=block.W[order])

    for _ in range(3):
        blocks = tuple(shuffled(block) for block in random.permutation(np.array(observation.blocks)))
        moved = fit_matched(Observation(observation.columns, blocks))
        assert moved.columns == fit.columns
        assert np.max(np.abs(moved.solution.x - fit.solution.x) / std) < SAME


def run(folder: Path, **environment: str) -> str:
    """Identify from the command line in a process of its own; return its JSON."""
    module = ROOT / "generated" / "emps300_qm_qc.py"
    command = [
        sys.executable,
        "-m",
        "modelgen",
        "identify",
        "a.csv",
        "b.csv",
        "--model",
        str(module),
        "--json",
    ]
    given = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run(command, cwd=folder, env=given, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    model = model_from_module(emps300_qm_qc)
    truth = model.parameter_sets["table_2"]
    path = tmp_path_factory.mktemp("runs")
    for name, kind in (("a", "chirp"), ("b", "trapezoid")):
        record = simulate(model, truth, kind, duration_s=2.0, noise={"q_m": 2e-5, "q_c": 2e-5}).record
        write_record(path / f"{name}.csv", record)
    return path


@pytest.mark.slow
def test_two_runs_give_the_same_bytes(folder: Path) -> None:
    first = run(folder, PYTHONHASHSEED="1", TZ="UTC", LC_ALL="C")
    assert first == run(folder, PYTHONHASHSEED="2", TZ="Asia/Tokyo", LC_ALL="C.UTF-8")
    assert json.loads(first)["params"]


@pytest.mark.slow
def test_the_number_of_threads_changes_nothing(folder: Path) -> None:
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    one, several = (json.loads(run(folder, **dict.fromkeys(names, str(count)))) for count in (1, 4))
    for name, value in one["params"].items():
        assert abs(several["params"][name] - value) < SAME * one["bse"][name]
