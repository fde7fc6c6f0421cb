"""`modelgen design` of an arm, as a user types it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.spec.load import catalog_path

ARM = """
[arm]
name = "pair"
[[joints]]
name = "1"
alpha = -90
position_limits = [-120, 120]
speed_limit = "180 deg/s"
[[joints]]
name = "slide"
type = "prismatic"
r = 0.2
position_limits = [0, 0.4]
speed_limit = 0.5
acceleration_limit = 2
[[joints]]
name = "tip"
type = "fixed"
r = 0.1
"""
QUICK = ("--seeds", "2", "--rounds", "10", "--duration-s", "3")


def run(*arguments: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, ["design", *arguments])
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "pair.toml"
    path.write_text(ARM, encoding="utf-8")
    return path


def test_a_trajectory_is_found_and_written(arm: Path) -> None:
    options = ("--inside", "tip=:,:,-0.5:", "--optimise", "go.csv", "--fs", "200")
    text = run("pair.toml", *QUICK, *options)
    assert "frame tip in z -0.5 to inf m: kept" in text and "wrote go.csv" in text
    lines = Path("go.csv").read_text().splitlines()
    assert lines[1] == "t,q_1,d1_q_1,d2_q_1,q_slide,d1_q_slide,d2_q_slide"
    table = np.loadtxt(lines[2:], delimiter=",")
    assert table.shape == (601, 7) and table[-1, 0] == pytest.approx(3.0)
    assert np.abs(table[:, 2]).max() <= np.pi and np.abs(table[:, 6]).max() <= 2.0
    assert table[:, 4].min() >= 0.0 and table[:, 4].max() <= 0.4
    found = json.loads(run("pair.toml", *QUICK, "--json"))
    assert [joint["unit"] for joint in found["joints"]] == ["rad", "m"] and len(found["searches"]) == 2
    # told before the search
    assert "exists" in run("pair.toml", "--rounds", "1000000", "--optimise", "go.csv", code=2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("pair.toml", "--noise", "q_1=1", "--sensors", "a"), "--sensors: is of chains"),
        (("pair.toml", "--criterion", "worst"), "choose one of condition, d-optimal"),
        (("pair.toml", "--inside", "tip=1"), "write FRAME=X0:X1,Y0:Y1,Z0:Z1"),
        (("pair.toml", "--inside", "tip=nan:1,:,:"), "cannot be read"),
        (("pair.toml", "--outside", "tap=:,:,0:1"), "is no joint's frame; choose from 1, slide, tip"),
        (("pair.toml", "--inside", "tip=5:6,:,:"), "are kept by none of 2,000 postures"),
        (("pair.toml", "--optimise", "go.txt"), "give it .csv or .npz"),
        (("pair.toml", "--fs", "1"), "gives 10 samples of 5 harmonics in 10 s; give 5 to 1e+06 Hz"),
        (("pair.toml", "--fs", "1e9"), "give 5 to 1e+06 Hz"),
        (("pair.toml", "--duration-s", "0"), "--duration-s: is 0 s; give a positive number"),
        (
            (
                "emps300",
                "--parameters",
                "light",
                "--noise",
                "q_m=1e-5",
                "--noise",
                "q_c=1e-5",
                "--duration-s",
                "0",
            ),
            "leaves no time",
        ),
        (("tx40",), "joint 6: speed_limit: is missing"),
        (("emps300", "--inside", "a=:,:,:"), "--inside: is of arms"),
    ],
)
def test_what_cannot_be_planned_is_told(arm: Path, arguments: tuple[str, ...], message: str) -> None:
    assert message in run(*arguments, code=2)


@pytest.fixture
def soft(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the elastic arm of the catalogue with limits."""
    monkeypatch.chdir(tmp_path)
    text = catalog_path("elastic_two_link").read_text(encoding="utf-8")
    limits = 'position_limits = [-120, 120]\nspeed_limit = "180 deg/s"\n'
    path = tmp_path / "soft.toml"
    path.write_text(
        text.replace('name = "1"\n', f'name = "1"\n{limits}').replace('name = "2"\n', f'name = "2"\n{limits}')
    )
    return path


def told(output: str) -> Any:
    """Return the JSON behind notes."""
    return json.loads(output[output.index("{") :])


@pytest.mark.slow
def test_an_elastic_arm_moves_slowly_then_fast_and_its_sensor_sets_are_ranked(soft: Path) -> None:
    quick = ("--seeds", "1", "--rounds", "2", "--duration-s", "4", "--sensors", "encoders", "--json")
    found = told(run("soft.toml", *quick, "--optimise", "go.csv"))
    slow, fast = (np.loadtxt(f, delimiter=",", skiprows=2) for f in ("go.csv", "go_fast.csv"))
    assert found["fast"]["written"] == "go_fast.csv" and slow.shape == fast.shape
    np.testing.assert_allclose(slow[0, [1, 4]], fast[-1, [1, 4]], atol=0.2)  # one begins near the other
    assert np.ptp(fast[:, 1]) < 0.3 * np.ptp(slow[:, 1]) and np.abs(fast[:, 2]).max() > 1.0
    (both,) = found["predicted"]["sets"]
    assert both["within"] and both["half_interval_percent"]["K_1"] < 0.1
    printed = run("soft.toml", "--sensors", "encoders", "--excitation", "go.csv", "--wanted-percent", "1e-6")
    assert "no set gives stiffness within 1e-06 %" in printed and "K_2 %" in printed
    alone = told(run("soft.toml", "--sensors", "encoders", "--excitation", "go.csv", "--json"))
    (one,) = alone["predicted"]["sets"]
    assert one["half_interval_percent"]["D_1"] > 3.0 * both["half_interval_percent"]["D_1"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--excitation", "chirp"), "none of an arm"),
        (("--sensors", "none"), "no sensor set"),
        (("--price", "q_1=3"), "--price: is of chains"),
    ],
)
def test_mistakes_of_elastic_arms_are_told(soft: Path, arguments: tuple[str, ...], message: str) -> None:
    quick = ("--seeds", "1", "--rounds", "1", "--duration-s", "3")
    assert message in " ".join(run("soft.toml", *quick, *arguments, code=2).split())
