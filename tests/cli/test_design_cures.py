"""What noise leaves open is listed as open, with what cures it, and the cure does."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from tests.broken_sentences import hole

CHAIN = """
[chain]
name = "two"
title = "motor and load"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
coulomb = "F_sm"
actuator = "tau"
[[bodies]]
name = "l"
inertia = "J_l"
[[links]]
bodies = ["m", "l"]
stiffness = "K"
damping = "D"
[sensors.one]
q_m = { body = "m", measures = "position" }
[sensors.both]
q_m = { body = "m", measures = "position" }
q_l = { body = "l", measures = "position" }
[parameters.guess]
J_m = 1e-4
F_vm = 1e-3
F_sm = 0.01
J_l = 3e-4
K = 50.0
D = 0.01
"""


def design(folder: Path, noise: float, sensors: str) -> dict[str, Any]:
    (folder / "two.toml").write_text(CHAIN, encoding="utf-8")
    levels = [f"--noise={key}={noise:g}" for key in ("q_m", "q_l") if key == "q_m" or sensors == "both"]
    # what is tested are reasons and cures, of which least squares needs the most
    options = ["--sensors", sensors, "--method=wls", *levels, "--noise=tau=1e-2", "--json"]
    result = CliRunner().invoke(app, ["design", str(folder / "two.toml"), *options])
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


@pytest.mark.slow
def test_what_the_noise_forbids_is_not_promised_and_its_cure_is_computed(tmp_path: Path) -> None:
    (one,) = (found := design(tmp_path, 1e-4, "one"))["sets"]
    assert one["missing"]
    assert all(entry["std_percent"] <= 20.0 for entry in one["parameters"].values())
    assert hole(one["reason"]) is None
    sensor, rigid = found["cures"]["one"]
    assert sensor.startswith(
        "a position sensor on l as precise as q_m would cure it: J_m, F_vm, F_sm, J_l, D, K"
    )
    assert rigid.startswith("m and l as one body (link K rigid) would cure it: J_m_J_l, F_vm, F_sm within")
    # the promise of the cure is that of the set it names
    (both,) = design(tmp_path, 1e-4, "both")["sets"]
    (told,) = re.findall(r"within (\S+) %", sensor)
    assert both["missing"] == []
    assert float(told) == pytest.approx(both["worst_percent"], rel=0.3)


def test_a_set_that_answers_everything_needs_no_cure(tmp_path: Path) -> None:
    found = design(tmp_path, 1e-5, "both")
    assert found["sets"][0]["missing"] == []
    assert found["cures"] == {}


@pytest.mark.slow
def test_beyond_the_limits_of_an_estimate_nothing_is_promised(tmp_path: Path) -> None:
    for noise in (3e-3, 3e-2):
        found = design(tmp_path, noise, "both")
        (both,) = found["sets"]
        for entry in both["parameters"].values():
            assert entry["std_percent"] <= 100.0
            assert abs(entry["bias_percent"]) <= 100.0
        assert both["missing"]
        assert "not to be had at this noise" in both["reason"] or not both["parameters"]
        assert all(hole(sentence) is None for sentence in found["cures"]["both"])
