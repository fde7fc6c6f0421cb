"""--set holds a parameter wherever records are identified, and what was held goes along."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.render.writer import generate
from modelgen.spec.load import catalog_path, load_spec

HELD = ("--set", "K=0.3795", "--set", "F_vm=2e-5")


def run(*arguments: str) -> str:
    done = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return str(done.stdout)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("held")
    text = generate(load_spec(catalog_path("emps300")), "qm_qc")
    (folder / "axis.py").write_text(text, encoding="utf-8")
    simulated = ("simulate", "emps300", "--sensors", "qm_qc", "--parameters", "light", "--fs", "2000")
    run(*simulated, "--excitation", "trapezoid", "-o", str(folder / "run.csv"), "--noise", "q_m=1e-6")
    return folder


@pytest.mark.slow
def test_what_is_held_goes_through_every_command(folder: Path) -> None:
    model, record = ("--model", str(folder / "axis.py")), str(folder / "run.csv")
    saved, project = str(folder / "e.json"), folder / "axis.project.toml"
    told = run("identify", record, *model, *HELD, "-o", saved, "--save-project", str(project))
    assert "known, not estimated: K = 0.3795, F_vm = 2e-05" in told
    document = json.loads(Path(saved).read_text(encoding="utf-8"))
    assert document["known"] == {"K": 0.3795, "F_vm": 2e-05}
    assert not {"K", "F_vm"} & {*document["params"], *document["physical"]}
    assert "position" in run("validate", record, *model, "--estimate", saved)
    run("export", saved, *model, "--to", "matlab", "-o", str(folder / "axis.m"))
    assert "'K', 0.3795" in (folder / "axis.m").read_text(encoding="utf-8")
    again = json.loads(run("run", str(project), "--json"))["estimate"]
    assert again["params"] == document["params"]
    compared = (
        "compare",
        str(folder / "axis.py"),
        saved,
        "--data",
        record,
        "--method",
        "wls",
        *HELD,
        "--json",
    )
    assert "K" not in json.loads(run(*compared))["estimates"]["parameters"]["axis"]


@pytest.mark.parametrize("command", ["identify", "compare", "fleet"])
def test_a_wrong_name_is_said_before_the_work(folder: Path, command: str) -> None:
    model, record = str(folder / "axis.py"), str(folder / "run.csv")
    given = [command, model, "--yardsticks", "--data", record] if command == "compare" else []
    given = given or [command, record, "--model", model]
    done = CliRunner().invoke(app, [*given, "--set", "KK=1"])
    assert done.exit_code == 2
    assert "--set" in done.output and "KK" in done.output and "parameter" in done.output
