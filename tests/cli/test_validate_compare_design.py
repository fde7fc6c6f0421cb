"""`validate`, `compare` and `design` as a user types them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
QC, AC = (str(ROOT / "generated" / f"emps300_{name}.py") for name in ("qm_qc", "qm_ac"))
CONTROLLER = "[controller]\nkp = 0.19\nkv = 1.7e-3\n"
CANDIDATES = """
[sensors.q_m]
body = "m"
measures = "position"
noise = 2e-5
price = 100.0

[sensors.a_c]
body = "c"
measures = "acceleration"
noise = 2.0
price = 40.0

[actuators.Gamma_m]
noise = 1e-4
"""
DEAR = """
[sensors.twist]
deflection = ["m", "c"]
measures = "position"
noise = 1e-6
price = 900.0
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == code, result.output
    return result.output


def run_json(*arguments: str) -> Any:
    return json.loads(CliRunner().invoke(app, [*arguments, "--json"]).stdout)


def simulated(here: Path, kind: str) -> str:
    """Write a record together with its reference."""
    from generated import emps300_qm_ac
    from modelgen.runtime.model.model import model_from_module
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.records.write_record import write_record
    from modelgen.runtime.simulation.closed_loop import PositionVelocityController
    from modelgen.runtime.simulation.simulate import simulate

    model = model_from_module(emps300_qm_ac)
    found = simulate(
        model, model.parameter_sets["light"], kind, controller=PositionVelocityController(0.19, 1.7e-3),
        noise={"q_m": 1e-7, "a_c": 0.1},
    )  # fmt: skip
    extra = {
        key: getattr(found.reference, key)[:: found.settings.oversample]
        for key in ("reference", "reference_rate", "feedforward")
    }
    write_record(here / f"{kind}.csv", Record({**found.record.signals, **extra}, 5000.0, kind))
    return f"{kind}.csv"


@pytest.mark.slow
def test_identify_then_validate_on_a_record_held_out(here: Path) -> None:
    chirp, trapezoid = simulated(here, "chirp"), simulated(here, "trapezoid")
    run("identify", chirp, trapezoid, "--model", AC, "-o", "estimate.json")
    (here / "loop.toml").write_text(CONTROLLER)
    common = ("--model", AC, "--estimate", "estimate.json", "--controller", "loop.toml")
    common += ("--map", "feedforward=feedforward", "--map", "reference_rate=reference_rate")
    found = run_json("validate", chirp, *common, "--hold-out", "0.6")
    assert [(r["record"], r["held_out"]) for r in found["records"]] == [
        ("chirp", False),
        ("chirp_rest", True),
    ]
    for record in found["records"][:1]:
        by_name = {(s["channel"], s["signal"]): s for s in record["signals"]}
        assert by_name["q_m", "position"]["relative_error_percent"] < 0.1
        assert by_name["a_c", "acceleration"]["fit_percent"] > 95.0
    text = run("validate", trapezoid, *common)
    assert "trapezoid, used" in text
    assert "q_m: tracking error" in text


@pytest.mark.slow
def test_without_a_controller_it_is_open_loop_or_some_samples_ahead(here: Path) -> None:
    chirp, trapezoid = simulated(here, "chirp"), simulated(here, "trapezoid")
    run("identify", chirp, trapezoid, "--model", AC, "--method", "wls", "-o", "estimate.json")
    common = ("--model", AC, "--estimate", "estimate.json")
    for horizon, kind in (((), "open loop"), (("--horizon", "10"), "10 samples ahead")):
        (record,) = run_json("validate", chirp, *common, *horizon)["records"]
        assert (record["comparison"], record["held_out"]) == (kind, False)
        assert [s["channel"] for s in record["signals"]] == ["q_m", "a_c"]
        assert record["signals"][0]["fit_percent"] > 90.0
        assert f"chirp, used; {kind}" in run("validate", chirp, *common, *horizon)
    (here / "moved.csv").write_text((here / trapezoid).read_text().replace('"trapezoid"', '"moved"', 1))
    (record,) = run_json("validate", "moved.csv", *common)["records"]
    assert (record["record"], record["held_out"]) == ("moved", False)
    rest = run_json("validate", chirp, *common, "--hold-out", "0.5")["records"][1]
    assert (rest["record"], rest["held_out"], rest["comparison"]) == ("chirp_rest", True, "open loop")
    (here / "loop.toml").write_text(CONTROLLER)
    refused = run("validate", chirp, *common, "--controller", "loop.toml", "--horizon", "3", code=2)
    assert "--horizon: predicts without a loop" in refused
    assert "are settings of a closed loop" in run("validate", chirp, *common, "--oversample", "4", code=2)
    assert "horizon: is 0" in run("validate", chirp, *common, "--horizon", "0", code=2)


def test_simulate_adds_the_bias_of_an_accelerometer(here: Path) -> None:
    from modelgen.runtime.records.read_record import read_record

    common = ("simulate", "emps300", "--sensors", "qm_ac", "--parameters", "light", "--excitation", "chirp")
    run(*common, "--duration-s", "0.4", "-o", "right.csv")
    run(*common, "--duration-s", "0.4", "--bias", "a_c=-3", "-o", "biased.csv")
    right, biased = (read_record(name).signals for name in ("right.csv", "biased.csv"))
    assert biased["a_c"] - right["a_c"] == pytest.approx(-3.0, abs=1e-9)
    assert (biased["q_m"] == right["q_m"]).all()


def test_validate_needs_all_parameters(here: Path) -> None:
    chirp = simulated(here, "chirp")
    (here / "loop.toml").write_text(CONTROLLER)
    saved = {"format": "modelgen estimate", "chain": "emps300", "physical": {"K": 0.3}, "records": []}
    (here / "e.json").write_text(json.dumps(saved))
    options = ("--model", AC, "--estimate", "e.json", "--controller", "loop.toml")
    text = run("validate", chirp, *options, code=2)
    assert "parameters: J_m: is missing" in text
    assert "--map: has no channel speed" in run("validate", chirp, *options, "--map", "speed=x", code=2)
    (here / "e.json").write_text("[]")
    assert "e.json: is no saved estimate" in run("validate", chirp, *options, code=2)


@pytest.mark.slow
def test_compare_of_modules_and_records(here: Path) -> None:
    found = run_json("compare", "emps300")
    assert [m["model"] for m in found["models"]] == ["emps300_qm_qc", "emps300_qm_ac"]
    assert [m["order"] for m in found["models"]] == [2, 4]
    assert found["regressors"][0]["verdict"] == "different"
    same = run_json("compare", QC, AC, "--parameters", "light")
    assert same["regressors"] == found["regressors"]
    assert same["models"][0]["condition_number"] > 1.0
    from modelgen.runtime.records.read_record import read_record
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.records.write_record import write_record

    # one record with both sensors
    common = ("simulate", "emps300", "--parameters", "light", "--overwrite")
    for kind in ("chirp", "trapezoid"):
        for name in ("qc", "ac"):
            run(*common, "--sensors", f"qm_{name}", "--excitation", kind, "-o", f"{name}.csv")
        both = {**read_record("qc.csv").signals, **read_record("ac.csv").signals}
        write_record(here / f"{kind}.csv", Record(both, 5000.0, kind))
    text = run("compare", QC, AC, "--method", "wls", "--data", "chirp.csv", "--data", "trapezoid.csv")
    assert "Estimates, 95 % intervals" in text
    assert "emps300_qm_qc and emps300_qm_ac: consistent" in text


@pytest.mark.slow
def test_compare_pairs_rows_with_records_by_their_tags(here: Path) -> None:
    common = ("simulate", "emps300", "--parameters", "light", "--sensors", "qm_ac")
    for kind in ("chirp", "trapezoid"):
        run(*common, "--excitation", kind, "-o", f"{kind}.csv")
    (here / "again.py").write_text(Path(AC).read_text())
    files = ("--data", "chirp.csv", "--data", "trapezoid.csv")
    chosen = ("compare", AC, "again.py", "--method", "wls", *files)
    tags, pairing = ("--tag", "chirp=up", "--tag", "trapezoid=down"), ("--pairing", "pham2002")
    found = [run_json(*chosen, *more)["estimates"]["parameters"] for more in ((), tags, pairing)]
    assert found[0] == found[1]  # by themselves tags pair nothing
    assert found[0] != found[2]
    assert "no record has the tag 'chirp'" in run(*chosen, *pairing, *tags, code=2)
    assert "--tag: has no record chir; did you mean chirp?" in run(*chosen, "--tag", "chir=up", code=2)
    for lonely in (tags, pairing):
        assert "--data: is missing" in run("compare", "emps300", *lonely, code=2)


@pytest.mark.slow
def test_compare_tells_two_versions_of_one_model_by_their_files(here: Path) -> None:
    text = Path(AC).read_text()
    for folder in ("old", "new"):
        (here / folder).mkdir()
        (here / folder / "axis.py").write_text(text)
    found = run_json("compare", "old/axis.py", "new/axis.py")
    assert [m["model"] for m in found["models"]] == ["axis", "axis (new/axis.py)"]
    assert [r["verdict"] for r in found["regressors"]] == ["equal"]


def test_compare_needs_two_models() -> None:
    assert "names 1 model; give two or more" in run("compare", QC, code=2)


@pytest.mark.slow(begins="first")
def test_design_ranks_what_candidates_can_do(here: Path) -> None:
    (here / "shop.toml").write_text(CANDIDATES + DEAR)
    options = ("emps300", "--parameters", "table_2", "--candidates", "shop.toml", "--method", "wls")
    found = run_json("design", *options, "--wanted-percent", "0.2")
    names = [entry["sensor_set"] for entry in found["sets"]]
    assert set(names) | set(found["refused"]) == {"q_m", "a_c", "twist", "q_m+a_c", "q_m+twist", "a_c+twist"}
    # the dear sensor is not worth its price here
    assert found["cheapest"] == "q_m+a_c"
    worst = [entry["worst_percent"] or float("inf") for entry in found["sets"]]
    assert worst == sorted(worst)


@pytest.mark.slow
def test_design_optimises_and_confirms(here: Path) -> None:
    noise = ("--noise", "q_m=2e-5", "--noise", "q_c=2e-5", "--noise", "Gamma_m=1e-4")
    options = ("emps300", "--sensors", "qm_qc", "--parameters", "table_2", "--method", "wls", *noise)
    wanted = ("--limit", "velocity=80", "--wanted-percent", "1e-6")
    text = run("design", *options, "--optimise", "best.csv", "--rounds", "1", *wanted, "--monte-carlo", "5")
    assert "no set reaches 1e-06 %" in text
    assert "of 80" in text
    assert "Monte Carlo: 5 experiments" in text
    assert "times better" in text
    assert (here / "best_1.csv").exists()
    played = ("--parameters", "table_2", "--excitation", "best_2.csv", "-o", "played.csv")
    run("simulate", "emps300", "--sensors", "qm_qc", *played)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "instruments: are all perfect; give --candidates FILE.toml"),
        (("--noise", "q_x=1"), "--noise: has no channel q_x"),
        (("--noise", "q_m=1e-5", "--method", "magic"), "--method: 'magic' is unknown"),
        (("--candidates", "bad.toml"), "bad.toml: sensors.q_m.measures: is 'speed'; choose from position"),
        (("--candidates", "bad.toml"), "bad.toml: sensors.q_m: does not say what it is on"),
        (
            ("--candidates", "bad.toml"),
            "bad.toml: sensors.q_m.noise: is 'low'; give zero or a positive number",
        ),
        (("--candidates", "bad.toml"), "bad.toml: actuators.T: is no actuator of the chain"),
    ],
)
def test_wrong_designs_are_explained(here: Path, arguments: tuple[str, ...], message: str) -> None:
    (here / "bad.toml").write_text(
        '[sensors.q_m]\nbody = "x"\nmeasures = "speed"\nnoise = "low"\n[actuators.T]\nnoise = 1.0\n'
    )
    assert message in run("design", "emps300", "--parameters", "table_2", *arguments, code=2)
