"""The options of `modelgen identify` that guard, test and compare an estimate."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from modelgen.cli.arguments import cutoffs_from, hold_out_from, period_from
from modelgen.cli.main import app
from modelgen.errors import DataError
from modelgen.runtime.records.write_record import write_record
from tests.runtime.rigid_motion import rigid_record


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("records")
    paths = []
    for seed, name in enumerate(("one", "two")):
        path = folder / f"{name}.npz"
        write_record(path, rigid_record(seed=seed, name=name, n=15000))
        paths.append(str(path))
    return paths


def run(*arguments: str, code: int = 0) -> str:
    root = Path(__file__).resolve().parents[2]
    model = str(root / "generated" / "emps_rigid_qm.py")
    settings = ("--cutoff-hz", "40", "--direction-cutoff-hz", "10")
    result = CliRunner().invoke(app, ["identify", *arguments, "--model", model, *settings])
    assert result.exit_code == code, result.output
    return result.output


def checks(output: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(output[output.index("{") :])["checks"]
    return found


def test_every_option_reaches_the_estimate(records: list[str]) -> None:
    options = ("--hold-out", "two", "--scan-cutoffs", "30,50", "--robust", "huber", "--bounds", "physical")
    found = checks(run(*records, *options, "--keep", "Fv", "--period-s", "none", "--json"))
    assert found["held_out"]["records"] == ["two"]
    assert [point["cutoff_hz"] for point in found["scan"]["points"]] == [30.0, 40.0, 50.0]
    assert found["bounds"]["bounded"] == ["M", "Fv", "Fc"]
    assert found["kept"] == ["Fv"]
    assert found["periods"] is None


def test_what_was_found_in_a_file_is_said_where_nothing_comes_out(tmp_path: Path) -> None:
    root, path = Path(__file__).resolve().parents[2], tmp_path / "still.csv"
    lines = [f"{0.001 * k},{1e-4 * (k == 900)},{5.0 + 1e-4 * (k == 900)},{k % 7}" for k in range(2000)]
    path.write_text("\n".join(["t,q_m,q_c,Gamma_m", *lines]), encoding="utf-8")
    model = str(root / "generated" / "emps300_qm_qc.py")
    result = CliRunner().invoke(app, ["identify", str(path), "--model", model])
    assert result.exit_code == 1
    assert "found: q_c starts 5 rad from q_m" in result.output
    assert result.output.index("found:") < result.output.index("error:")


@pytest.mark.slow
def test_a_share_can_be_held_out(records: list[str]) -> None:
    found = checks(run(*records, "--hold-out", "0.3", "--json"))
    assert found["held_out"]["records"] == ["one (held out)", "two (held out)"]
    text = run(*records, "--hold-out", "0.3", "--details")
    assert "Held-out records:" in text


def test_total_least_squares_is_a_method(records: list[str]) -> None:
    assert "total least squares, for comparison" in run(records[0], "--method", "tls", "--details")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--period-s", "7"), "fewer than 4 periods"),
        (("--period-s", "three=1"), "has no record three"),
        (("--hold-out", "three"), "has no record three"),
        (("--scan-cutoffs", "10;20"), "frequencies in Hz with commas"),
        (("--scan-cutoffs", "900"), "half the sampling frequency"),
        (("--keep", "Fx"), "has no parameter Fx"),
        (("--method", "pham2002", "--robust", "huber"), "does not go with method pham2002"),
    ],
)
def test_a_mistake_is_one_line_and_code_2(records: list[str], arguments: tuple[str, ...], said: str) -> None:
    output = run(*records, *arguments, code=2)
    assert said in output
    assert "Traceback" not in output


def test_a_mapping_file_may_declare_the_period(records: list[str], tmp_path: Path) -> None:
    path = tmp_path / "run.map.toml"
    channels = "".join(f'[channels.{key}]\ncolumn = "{key}"\n' for key in ("q_m", "F"))
    path.write_text(f"[time]\nperiod_s = 7.0\n{channels}")
    assert "fewer than 4 periods" in run(*records, "--map-file", str(path), code=2)
    # what the command line says goes before it
    assert checks(run(*records, "--map-file", str(path), "--period-s", "none", "--json"))["periods"] is None
    path.write_text(f"[time]\nperiod_s = -1.0\n{channels}")
    assert "time.period_s: is -1.0" in run(*records, "--map-file", str(path), code=2)


def test_words_become_values() -> None:
    assert period_from([]) is None
    assert period_from(["none"]) == "none"
    assert period_from(["0.5"]) == 0.5
    assert period_from(["a=0.5", "b=1"]) == {"a": 0.5, "b": 1.0}
    assert hold_out_from([]) is None
    assert hold_out_from(["0.25"]) == 0.25
    assert hold_out_from(["a", "b"]) == ("a", "b")
    assert hold_out_from(["chirp"]) == ("chirp",)
    assert cutoffs_from(None) is None
    assert cutoffs_from("auto") == "auto"
    assert cutoffs_from("100,200.5") == (100.0, 200.5)
    with pytest.raises(DataError):
        cutoffs_from("100,x")
