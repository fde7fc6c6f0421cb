"""`modelgen run` on records that are simulated: the same bytes again, and whatever changed in between."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from generated import emps_rigid_qm
from modelgen.cli.main import app
from modelgen.project.history import load_history
from modelgen.project.project_file import load_project
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate

ROOT = Path(__file__).resolve().parents[3]
MODEL = model_from_module(emps_rigid_qm)
VALUES = next(iter(MODEL.parameter_sets.values()))
HEAD = """\
spec = "emps_rigid"
sensors = "qm"
[data]
columns = { q_m = "theta" }
scales = { q_m = 0.001 }
[identify]
method = "wls"
[output]
estimate = "axis.estimate.json"
report = "axis.report.html"
"""
GROUP = '[[records]]\ndate = 2026-0{month}-28\nfiles = ["run{month}.csv"]\n'


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three records in mm, a month apart; the force is the model's own."""
    folder = tmp_path_factory.mktemp("bench")
    for month in (1, 2, 3):
        record = simulate(
            MODEL, VALUES, "chirp", fs=1000.0, duration_s=2.0, noise={"q_m": 1e-6}, seed=month
        ).record
        force = next(key for key in record.signals if key != "q_m")
        signals = {"theta": 1e3 * np.array(record.signals["q_m"]), force: record.signals[force]}
        write_record(folder / f"run{month}.csv", Record(signals, record.fs))
    return folder


@pytest.fixture
def here(bench: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "axis"
    shutil.copytree(bench, folder)
    write(folder, 1, 2)
    return folder


def write(folder: Path, *months: int, head: str = HEAD) -> None:
    text = head + "".join(GROUP.format(month=month) for month in months)
    (folder / "axis.project.toml").write_text(text)


def run(folder: Path, *options: str, code: int = 0) -> Any:
    done = CliRunner().invoke(app, ["run", str(folder / "axis.project.toml"), *options])
    assert done.exit_code == code, done.output
    return done


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.mark.slow
def test_the_same_bytes_again_wherever_it_is_run(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = json.loads(run(here, "--json").stdout)
    assert [entry["added"] for entry in told["entries"]] == [True, True]
    first = contents(here)
    assert {"axis.estimate.json", "axis.report.html", "axis.history.jsonl", "axis.project.lock"} <= set(first)
    monkeypatch.chdir(here)
    again = CliRunner().invoke(app, ["run", "axis.project.toml", "--json"])
    assert again.exit_code == 0, again.output
    assert [entry["added"] for entry in json.loads(again.stdout)["entries"]] == [False, False]
    assert contents(here) == first
    estimate = Estimate.load(here / "axis.estimate.json")
    newest = load_history(here / "axis.history.jsonl")[-1]
    assert newest.estimate.to_json() == estimate.to_json()
    assert newest.label == "2026-02-28"
    assert estimate.params["M"] == pytest.approx(VALUES["M"], rel=0.05)


def test_a_further_group_is_one_further_line(here: Path) -> None:
    run(here)
    before = (here / "axis.history.jsonl").read_bytes()
    write(here, 1, 2, 3)
    done = run(here)
    assert "locked run3.csv" in done.stderr
    after = (here / "axis.history.jsonl").read_bytes()
    assert after.startswith(before)
    assert len(after.splitlines()) == 3


@pytest.mark.slow
def test_a_record_that_has_changed_is_refused_with_both_hashes(here: Path) -> None:
    run(here)
    before = contents(here)
    lock = json.loads((here / "axis.project.lock").read_text())
    path = here / "run1.csv"
    path.write_text(path.read_text().rstrip("\n").rpartition("\n")[0] + "\n")  # a sample less
    done = run(here, code=2)
    assert str(path) in done.stderr
    assert lock["records"]["run1.csv"] in done.stderr
    assert "--lock" in done.stderr
    assert (here / "axis.history.jsonl").read_bytes() == before["axis.history.jsonl"]
    run(here, "--lock")
    assert len(load_history(here / "axis.history.jsonl")) == 3  # the records differ


def test_what_somebody_else_wrote_is_not_written_over(here: Path) -> None:
    (here / "axis.estimate.json").write_text("mine")
    assert "is not what modelgen run wrote there" in run(here, code=2).stderr
    assert (here / "axis.estimate.json").read_text() == "mine"
    run(here, "--overwrite")
    (here / "axis.report.html").write_text("edited")
    run(here, code=2)
    assert (here / "axis.report.html").read_text() == "edited"


@pytest.mark.slow
def test_other_options_are_another_estimate_of_the_same_records(here: Path) -> None:
    run(here)
    write(here, 1, 2, head=HEAD.replace('"wls"', '"wls"\ncutoff_hz = 60.0'))
    run(here)
    assert len(load_history(here / "axis.history.jsonl")) == 4


def test_held_parameters_are_those_of_the_spec(here: Path) -> None:
    mass = VALUES["M"]
    write(here, 1, head=HEAD.replace("[data]", f"[known]\nM = {mass!r}\n[data]"))
    run(here)
    held = Estimate.load(here / "axis.estimate.json")
    assert "M" not in held.params
    write(here, 1, head=HEAD.replace("[data]", "[known]\nM = -1.0\nMM = 2.0\n[data]"))
    refused = run(here, code=2).stderr
    assert "known.M: is -1" in refused and "known.MM: is not a parameter" in refused


def test_a_module_in_place_of_the_spec_and_what_is_wrong_with_a_group(here: Path) -> None:
    shutil.copy(ROOT / "generated" / "emps_rigid_qm.py", here / "axis.py")
    head = HEAD.replace('spec = "emps_rigid"\nsensors = "qm"\n', 'model = "axis.py"\n')
    write(here, 1, head=head)
    run(here)
    write(here, 2, head=head.replace("theta", "phi"))
    refused = run(here, code=2).stderr
    assert "records of 2026-02-28" in refused and "phi" in refused
    write(here, 2, head=head)
    path = here / "axis.project.toml"
    path.write_text(path.read_text() + 'tags = { walk = "chirp" }\n')
    assert "walk" in run(here, code=2).stderr
    assert len(load_history(here / "axis.history.jsonl")) == 1


def test_new_writes_a_project_that_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["new", "axis", "--project"])
    assert done.exit_code == 0, done.output
    (tmp_path / "run1.csv").write_text("a\n1\n")
    text = (tmp_path / "axis.project.toml").read_text()
    project = load_project(tmp_path / "axis.project.toml")
    assert (project.table.spec, project.table.sensors) == ("axis.toml", "qm_qc")
    # every line that is a comment can be made a key
    keys = ("name", "map_file", "columns", "scales", "fs_hz", "mend", "directions", "method", "cutoff_hz")
    for key in (*keys, "delay", "hold_out", "date", "tags"):
        assert f"\n# {key} = " in text
        text = text.replace(f"\n# {key} = ", f"\n{key} = ")
    (tmp_path / "axis.project.toml").write_text(text)
    assert load_project(tmp_path / "axis.project.toml").table.identify.cutoff_hz == 200.0
    again = CliRunner().invoke(app, ["new", "axis", "--project"])
    assert again.exit_code == 2 and "exists already" in again.output


def test_identify_saves_what_was_typed_as_a_project(
    bench: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(bench, tmp_path / "data")
    (tmp_path / "jobs").mkdir()
    module = str(ROOT / "generated" / "emps_rigid_qm.py")
    typed = ["--map", "q_m=theta", "--scale", "q_m=0.001", "--method", "wls", "--cutoff-hz", "50"]
    typed += ["--hold-out", "0.3", "--keep", "M", "--delay", "none", "--period-s", "none", "--drop", "5"]
    typed += ["--tag", "record=chirp", "-o", "jobs/e.json", "--report", "jobs/e.html"]
    given = ["identify", "data/run1.csv", "--model", module, *typed, "--save-project", "jobs/a.project.toml"]
    done = CliRunner().invoke(app, given)
    assert done.exit_code == 0, done.output
    first = (tmp_path / "jobs" / "e.json").read_bytes()
    again = CliRunner().invoke(app, ["run", "jobs/a.project.toml"])
    assert again.exit_code == 0, again.output
    assert (tmp_path / "jobs" / "e.json").read_bytes() == first
    assert again.stdout == done.stdout
    refused = CliRunner().invoke(app, given)
    assert refused.exit_code == 2
    assert "exists already" in refused.stderr


@pytest.mark.slow
def test_a_month_without_an_answer_does_not_cost_the_others(here: Path) -> None:
    rest = np.zeros(2000)
    force = next(actuator.key for actuator in MODEL.actuators)
    write_record(here / "run1.csv", Record({"theta [mm]": rest, force: rest}, 1000.0), overwrite=True)
    done = run(here, code=2)
    assert "records of 2026-01-28" in done.stderr
    assert "run1.csv: took: line" in done.stderr  # which may be why
    assert json.loads(run(here, "--json", code=2).stdout)["failed"]
    assert [entry.label for entry in load_history(here / "axis.history.jsonl")] == ["2026-02-28"]
    write(here, 1)
    assert not run(here, code=2).stdout
