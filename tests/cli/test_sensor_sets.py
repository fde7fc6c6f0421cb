"""Records of different sensors through the commands; pages of what commands print."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from modelgen.cli.candidates import spec_model
from modelgen.cli.data_arguments import DataOptions
from modelgen.cli.main import app
from modelgen.cli.sensor_sets.read_by_sensors import read_by_sensors
from modelgen.runtime.results.estimate import Estimate
from modelgen.spec.load import parse_spec
from tests.runtime.joining.test_identify_jointly import TOWER

SETS = ("low", "ends")


def run(*arguments: str, code: int = 0) -> str:
    done = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert done.exit_code == code, done.output
    return str(done.stdout if code == 0 else done.output)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tower")
    (folder / "tower.toml").write_text(TOWER, encoding="utf-8")
    for seed, name in enumerate((*SETS, "all")):
        given = ("simulate", str(folder / "tower.toml"), "--sensors", name, "--excitation", "chirp")
        noise = ("--noise", "q_1=1e-7", "--noise", "F=1e-3", "--seed", str(seed))
        run(*given, "--fs", "1000", "--duration-s", "3", *noise, "-o", str(folder / f"{name}.csv"))
    return folder


@pytest.fixture(scope="module")
def answer(folder: Path) -> str:
    files = [str(folder / f"{name}.csv") for name in SETS]
    chosen = [word for name in SETS for word in ("--sensors", name)]
    outputs = [
        "-o",
        str(folder / "j.json"),
        "--report",
        str(folder / "j.html"),
        "--figure",
        str(folder / "j.svg"),
    ]
    project = ["--save-project", str(folder / "j.project.toml")]
    return run(
        "identify",
        *files,
        "--spec",
        str(folder / "tower.toml"),
        *chosen,
        "--method",
        "wls",
        *outputs,
        *project,
    )


@pytest.mark.slow
def test_each_file_is_for_the_sensors_it_has(folder: Path, answer: str) -> None:
    assert "tower, sensors low + ends" in answer
    saved = Estimate.load(folder / "j.json")
    assert saved.model.joined == SETS
    assert {*saved.physical} >= {"M_1", "M_2", "M_3", "K_1"}
    page = (folder / "j.html").read_text(encoding="utf-8")
    assert "all sensor sets and each alone" in page and page.count("<svg") >= 3 and "<script src" not in page
    # a panel each record and row that holds a force, of each set with its own estimate
    assert (folder / "j.svg").read_text(encoding="utf-8").count('<g id="axes_') >= len(SETS)


@pytest.mark.slow
def test_the_project_says_the_same(folder: Path, answer: str) -> None:
    found = json.loads(run("run", str(folder / "j.project.toml"), "--json"))["estimate"]
    assert found["params"] == dict(Estimate.load(folder / "j.json").params)


@pytest.mark.slow
def test_a_joined_estimate_is_validated_with_a_page(folder: Path, answer: str) -> None:
    run("generate", str(folder / "tower.toml"), "--sensors", "all", "-o", str(folder))
    given = ("--model", str(folder / "tower_all.py"), "--estimate", str(folder / "j.json"))
    run("validate", str(folder / "all.csv"), *given, "--report", str(folder / "v.html"))
    page = (folder / "v.html").read_text(encoding="utf-8")
    assert "open loop" in page and page.count("<canvas") == 3 and "fit %" in page
    again = run("validate", str(folder / "all.csv"), *given, "--report", str(folder / "v.html"), code=2)
    assert "exists already" in again


def test_compare_writes_a_page(folder: Path, answer: str) -> None:
    run(
        "compare",
        str(folder / "j.json"),
        str(folder / "j.json").replace("j.json", "./j.json"),
        "--report",
        str(folder / "c.html"),
    )
    page = (folder / "c.html").read_text(encoding="utf-8")
    assert "95 % intervals" in page and "<svg" in page and "chi2" in page


@pytest.mark.slow
def test_what_fits_no_set_or_two_is_explained(folder: Path) -> None:
    spec = str(folder / "tower.toml")
    told = run(
        "identify", str(folder / "low.csv"), "--spec", spec, "--sensors", "ends", "--sensors", "all", code=2
    )
    assert "q_3" in told and "Traceback" not in told
    both = run(
        "identify", str(folder / "all.csv"), "--spec", spec, "--sensors", "low", "--sensors", "ends", code=2
    )
    assert "has the channels of low, ends" in both and "--sensors all=low" in both
    chosen = ("--spec", spec, "--sensors", "all=low", "--method", "wls", "--json")
    assert json.loads(run("identify", str(folder / "all.csv"), *chosen))["sensor_set"] == "low"
    none = run("identify", str(folder / "all.csv"), "--spec", spec, "--sensors", "al=low", code=2)
    assert "sensors of al" in none and "name one of all" in none
    missing = run("identify", str(folder / "all.csv"), code=2)
    assert "--model" in missing and "--spec" in missing


@pytest.mark.slow
def test_records_of_several_sets_are_simulated_in_closed_loop(folder: Path, tmp_path: Path) -> None:
    spec, loop = str(folder / "tower.toml"), tmp_path / "loop.toml"
    loop.write_text("[controller]\nkp = 20000.0\nkv = 500.0\n", encoding="utf-8")
    wanted = [word for name in SETS for word in ("--sensors", name)]
    for name in SETS:
        given = ("simulate", spec, "--sensors", name, "--excitation", "chirp", "--with-reference")
        rate = ("--fs", "1000", "--duration-s", "3", "--noise", "F=1e-3", "--controller", str(loop))
        run(*given, *rate, "-o", str(tmp_path / f"{name}.csv"))
    files = [str(tmp_path / f"{name}.csv") for name in SETS]
    page = ("--controller", str(loop), "--method", "wls", "--report", str(tmp_path / "r.html"))
    run("identify", *files, "--spec", spec, *wanted, *page)
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert text.count("closed loop") >= 2 and "<canvas" in text and "Closed loop: Not made" not in text
    lacking = run("identify", *(str(folder / f"{name}.csv") for name in SETS), "--spec", spec, *wanted,
                  "--controller", str(loop), "--report", str(tmp_path / "s.html"), code=2)  # fmt: skip
    assert "reference" in lacking


def test_a_direction_that_one_set_asks_for_is_not_asked_of_another(tmp_path: Path) -> None:
    spec = parse_spec(
        'chain = { name = "axis", motion = "rotation" }\n'
        'bodies = [{ name = "m", inertia = "J_m", actuator = "T" },\n'
        '    { name = "c", inertia = "J_c", coulomb = "F_sc" }]\n'
        'links = [{ bodies = ["m", "c"], stiffness = "K" }]\n'
        'sensors.both.q_m = { body = "m", measures = "position" }\n'
        'sensors.both.q_c = { body = "c", measures = "position" }\n'
        'sensors.motor.q_m = { body = "m", measures = "position" }\n',
        "axis.toml",
    )
    models = {name: spec_model(spec, name) for name in ("both", "motor")}
    assert "sign_c" in models["motor"].channels and "sign_c" not in models["both"].channels
    columns = {"both": ("q_m", "q_c", "T"), "motor": ("q_m", "sign_c", "T")}
    for name, keys in columns.items():
        lines = [",".join(("t", *keys)), *(f"{k / 1e3},{k}.5,1,{k}.25" for k in range(40))]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines), encoding="utf-8")
    found = read_by_sensors([tmp_path / f"{name}.csv" for name in columns], models, DataOptions())
    assert [title for title, _ in found] == ["both", "motor"]
