"""`modelgen fleet` from folders and files of several machines to estimates."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from generated import emps300_qm_qc
from modelgen.cli.commands.fleet import _folder
from modelgen.cli.main import app
from modelgen.errors import DataError
from modelgen.read_file import InputKind, read_text
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.simulate import simulate

MODULE = Path(str(emps300_qm_qc.__file__))
MODEL = model_from_module(emps300_qm_qc)

pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:Port .* is already in use:UserWarning"),
]


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of one cluster for all that do not ask how it is started: that takes seconds."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.slow
def test_every_machine_gets_its_estimate_and_a_corrupt_file_is_named(tmp_path: Path, scheduler: str) -> None:
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
    options = [
        "--model",
        str(MODULE),
        "--cutoff-hz",
        "300",
        "--fs",
        "5000",
        "--scheduler",
        scheduler,
        "--json",
    ]
    result = CliRunner().invoke(app, ["fleet", str(folder), str(whole), str(broken), *options])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert list(found["machines"]) == ["press", "crane"]
    assert [one["records"] for one in found["machines"].values()] == [[str(folder)], [str(whole)]]
    pooled = {one["name"]: one["value"] for one in found["pooled"]}
    for values in (*(estimate["params"] for estimate in found["machines"].values()), pooled):
        assert values["K"] == pytest.approx(truth["K"], rel=1e-3)
    assert list(found["failed"]) == [str(broken)]
    assert "is no readable HDF5 file" in found["failed"][str(broken)]


@pytest.mark.slow
def test_the_module_is_read_once_and_trusted_if_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    record = simulate(MODEL, MODEL.parameter_sets["table_2"], "chirp", duration_s=1.0, oversample=8).record
    folder = tmp_path / "press" / "run1"
    folder.mkdir(parents=True)
    for channel, samples in record.signals.items():
        np.save(folder / f"{channel}.npy", samples)
    module, reads = tmp_path / "edited.py", list[Path]()
    module.write_text(MODULE.read_text().replace("CHAIN = ", "CHAIN  = ", 1))

    def counted(path: Path, kind: InputKind) -> str:
        reads.append(Path(path))
        return read_text(path, kind)

    monkeypatch.setattr("modelgen.runtime.model.module_file.read_text", counted)
    options = ["--model", str(module), "--cutoff-hz", "300", "--fs", "5000", "--workers", "1", "--json"]
    result = CliRunner().invoke(app, ["fleet", str(folder), *options])
    assert result.exit_code == 2
    assert f"{module}: " in result.output
    assert "--trust" in result.output
    reads.clear()
    result = CliRunner().invoke(app, ["fleet", str(folder), *options, "--trust"])
    assert result.exit_code == 0, result.output
    assert reads == [module]


@pytest.mark.slow
def test_a_scheduler_is_asked_and_the_table_names_machines(tmp_path: Path, scheduler: str) -> None:
    truth = MODEL.parameter_sets["table_2"]
    for machine, kind in (("press", "chirp"), ("crane", "trapezoid")):
        record = simulate(MODEL, truth, kind, duration_s=2.0, oversample=8).record
        folder = tmp_path / machine / "run1"
        folder.mkdir(parents=True)
        for channel, samples in record.signals.items():
            np.save(folder / f"{channel}.npy", samples)
    files = [str(tmp_path / machine / "run1") for machine in ("press", "crane")]
    options = ["--model", str(MODULE), "--cutoff-hz", "300", "--fs", "5000"]
    asked = ["--scheduler", scheduler, "--report", str(tmp_path / "fleet.html")]
    result = CliRunner().invoke(app, ["fleet", *files, *options, *asked])
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    table = lines[: lines.index("")]
    assert [line.split()[0] for line in table] == ["J_m", "press", "crane", "all", "machines"]
    assert max(map(len, table)) <= 80
    assert "K [N m/rad]" in result.stdout
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert page.count("<svg") == len(MODEL.base_parameters) and "<td>crane</td>" in page


@pytest.mark.slow
def test_units_of_files_are_those_of_identify(tmp_path: Path, scheduler: str) -> None:
    """A file that states degrees gives the same by both commands, to the last digit."""
    record = simulate(MODEL, MODEL.parameter_sets["table_2"], "chirp", duration_s=2.0, oversample=8).record
    file = tmp_path / "press" / "run.csv"
    file.parent.mkdir()
    columns = [np.arange(record.n) / record.fs]
    columns += [np.degrees(record.signals[key]) for key in ("q_m", "q_c")] + [record.signals["Gamma_m"]]
    heads = "t [s],q_m [deg],q_c [deg],Gamma_m [N m]"
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=heads, comments="")
    options = ["--model", str(MODULE), "--method", "wls", "--json"]
    alone = json.loads(CliRunner().invoke(app, ["identify", str(file), *options]).stdout)
    fleet = CliRunner().invoke(app, ["fleet", str(file), *options, "--scheduler", scheduler])
    assert fleet.exit_code == 0, fleet.output
    found = json.loads(fleet.stdout)["machines"]["press"]
    assert found["params"] == alone["params"]
    assert found["bse"] == alone["bse"]
    assert found["params"]["K"] == pytest.approx(MODEL.parameter_sets["table_2"]["K"], rel=1e-2)


def test_files_that_are_not_there_are_said_before_workers_start(tmp_path: Path) -> None:
    absent = [str(tmp_path / f"{k}.csv") for k in range(5)]
    result = CliRunner().invoke(app, ["fleet", *absent, "--model", str(MODULE)])
    assert result.exit_code == 2
    assert f"DATA: there is no {absent[0]}, {absent[1]}, {absent[2]}, ...; check the paths" in result.stderr
    assert "workers" not in result.stderr


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    command = ["fleet", str(tmp_path), "--model", str(MODULE), "--cutoff-hz", "300"]
    np.save(tmp_path / "q_m.npy", np.zeros(9))
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 2
    assert "need --fs" in result.stderr
    (tmp_path / "q_m.npy").rename(tmp_path / "run.npz")  # a folder of other files is none of arrays
    assert "is a folder; give a file in it: run.npz" in CliRunner().invoke(app, command).stderr


def test_readings_of_a_folder_are_mended_as_those_of_a_file_are(tmp_path: Path) -> None:
    t = np.arange(2000) / 1000.0
    channels = {"q_m": np.sin(9.0 * t), "Gamma_m": np.cos(31.0 * t)}
    for channel, samples in channels.items():
        np.save(tmp_path / f"{channel}.npy", samples[np.arange(t.size) // 4 * 4])
    how = {"needed": ("q_m", "Gamma_m"), "mapping": {}, "scales": {}, "fs": 1000.0, "units": {}, "mend": ()}
    held = _folder(tmp_path, how, "run")
    mended = _folder(tmp_path, {**how, "mend": ("repeats=q_m",)}, "run")
    wrong = [np.abs(one.read("q_m", 20, 1980) - channels["q_m"][20:1980]).max() for one in (held, mended)]
    assert wrong[0] > 0.02 > 1e-5 > wrong[1]
    assert np.array_equal(mended.read("Gamma_m", 0, 2000), held.read("Gamma_m", 0, 2000))
    with pytest.raises(DataError, match="mends times, and the record has none"):
        _folder(tmp_path, {**how, "mend": ("duplicates",)}, "run")
    channels["q_m"][700] = np.nan
    np.save(tmp_path / "q_m.npy", channels["q_m"])
    filled = _folder(tmp_path, {**how, "mend": ("fill",)}, "run")
    assert filled.n == 2000 and abs(filled.signals["q_m"][700] - np.sin(9.0 * t[700])) < 1e-4
    assert _folder(tmp_path, {**how, "mend": ("gaps",)}, "run").n == 1299
