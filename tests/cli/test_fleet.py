"""`modelgen fleet` from folders and files of several machines to estimates."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from generated import emps300_qm_qc
from modelgen.cli.main import app
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.simulate import simulate

MODULE = Path(str(emps300_qm_qc.__file__))
MODEL = model_from_module(emps300_qm_qc)

pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:Port .* is already in use:UserWarning"),
]


def test_every_machine_gets_its_estimate_and_a_corrupt_file_is_named(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    h5py = pytest.importorskip("h5py")
    truth = MODEL.parameter_sets["table_2"]
    record, other = (
        simulate(MODEL, truth, "chirp", duration_s=seconds, oversample=8).record for seconds in (2.0, 2.5)
    )
    folder = tmp_path / "press" / "run1"
    folder.mkdir(parents=True)
    for channel, samples in other.signals.items():
        np.save(folder / f"{channel}.npy", samples)
    (tmp_path / "crane").mkdir()
    whole, broken = tmp_path / "crane" / "run.h5", tmp_path / "crane" / "broken.h5"
    with h5py.File(whole, "w") as file:
        for channel, samples in record.signals.items():
            file[channel] = samples
    broken.write_bytes(whole.read_bytes()[:300])
    options = ["--model", str(MODULE), "--cutoff-hz", "300", "--fs", "5000", "--workers", "1", "--json"]
    result = CliRunner().invoke(app, ["fleet", str(folder), str(whole), str(broken), *options])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert list(found["machines"]) == ["press", "crane"]
    assert list(found["records"]) == [str(folder.resolve()), str(whole.resolve())]
    assert len(found["pooled"]["cov_params"]) == len(found["pooled"]["params"])
    for estimate in (*found["machines"].values(), found["pooled"]):
        assert estimate["params"]["K"] == pytest.approx(truth["K"], rel=1e-3)
    assert list(found["failed"]) == [str(broken)]
    assert "is no readable HDF5 file" in found["failed"][str(broken)]


@pytest.mark.slow
def test_a_scheduler_is_asked_and_the_table_names_machines(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    truth = MODEL.parameter_sets["table_2"]
    for machine, kind in (("press", "chirp"), ("crane", "trapezoid")):
        record = simulate(MODEL, truth, kind, duration_s=2.0, oversample=8).record
        folder = tmp_path / machine / "run1"
        folder.mkdir(parents=True)
        for channel, samples in record.signals.items():
            np.save(folder / f"{channel}.npy", samples)
    files = [str(tmp_path / machine / "run1") for machine in ("press", "crane")]
    options = ["--model", str(MODULE), "--cutoff-hz", "300", "--fs", "5000"]
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        asked = ["--scheduler", cluster.scheduler_address]
        result = CliRunner().invoke(app, ["fleet", *files, *options, *asked])
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    titles = [line.split(":")[0] for line in lines if not line.startswith(" ")]
    assert titles == ["press", "crane", "pooled"]
    assert sum(line.split()[0] == "K" for line in lines if line.startswith(" ")) == 3


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["fleet", str(tmp_path), "--model", str(MODULE), "--cutoff-hz", "300"])
    assert result.exit_code == 2
    assert "need --fs" in result.stderr
