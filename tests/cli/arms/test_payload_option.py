"""`--payload`: which record carries what, and its mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from tests.runtime.made_arm_records import model_of, of_bodies, record_of, values_of, written

ARM = """
[arm]
name = "two"
gravity = [0, -9.81, 0]
drive = ["viscous"]
[[joints]]
name = "1"
[[joints]]
name = "2"
d = 0.4
"""
PAYLOAD = """
[payload.disc]
mass = 2.0
"""


def run(*arguments: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["identify", *map(str, arguments)])
    return result.exit_code, result.output


@pytest.fixture
def files(tmp_path: Path) -> list[str | Path]:
    """The options for two records, of which the second was taken with the disc, and for the arm's spec."""
    model = model_of(written(ARM + PAYLOAD))
    for seed, (name, carried) in enumerate({"empty": (), "full": ("disc",)}.items()):
        record = record_of(model, values_of(model), 10.0, seed, carried=carried)
        signals = {key: value for key, value in record.signals.items() if key not in model.loads}
        np.savez(tmp_path / f"{name}.npz", t=np.arange(record.n) / record.fs, **signals)
    (tmp_path / "two.toml").write_text(ARM + PAYLOAD)
    return [tmp_path / "empty.npz", tmp_path / "full.npz", "--spec", tmp_path / "two.toml"]


def test_a_record_carries_what_the_option_says(files: list[str | Path]) -> None:
    code, text = run(*files, "--payload", "full=disc")
    assert code == 0, text
    assert "mx_disc" in text
    code, text = run(*files)
    # nothing carried it
    assert "No number for mx_disc" in text or "mx_disc" not in text.split("No number")[0]


@pytest.mark.parametrize(
    ("option", "what"),
    [("none=disc", "has no record none"), ("full=dics", "did you mean disc"), ("tool", "available: disc")],
)
def test_mistakes_are_told(files: list[str | Path], option: str, what: str) -> None:
    code, text = run(*files, "--payload", option)
    assert code == 2
    assert what in text


def test_an_arm_without_payloads_says_how_to_name_one(files: list[str | Path]) -> None:
    Path(files[-1]).write_text(ARM)
    code, text = run(*files, "--payload", "full=disc")
    assert code == 2
    assert "write a table [payload.NAME]" in " ".join(text.split())


@pytest.mark.slow
def test_what_is_simulated_with_a_payload_is_identified_and_validated_with_it(tmp_path: Path) -> None:
    text = ARM + PAYLOAD
    model = model_of(written(text))
    truth = {**of_bodies(model, 0), "mx_disc": 0.3}
    values = "\n".join(f"{name} = {value}" for name, value in truth.items() if name != "m_disc")
    (tmp_path / "two.toml").write_text(f"{text}[parameters.made]\n{values}\n")
    spec, files, out = tmp_path / "two.toml", [], tmp_path / "found.json"
    for name, carried in (("empty", []), ("full", ["--payload", "disc"])):
        files.append(tmp_path / f"{name}.csv")
        made = ["simulate", spec, "--excitation", "fourier", "--duration-s", "5", *carried, "-o", files[-1]]
        result = CliRunner().invoke(app, list(map(str, made)))
        assert result.exit_code == 0, result.output
    assert "load_disc" in result.output
    code, text = run(*files, "--spec", spec, "-o", out)
    assert code == 0, text
    assert json.loads(out.read_text())["params"]["mx_disc"] == pytest.approx(truth["mx_disc"], rel=0.02)
