"""Encoders that count the other way round are proposed negated; vibration above a resonance is not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.cli.reversed_sensors import with_reversed
from modelgen.render.writer import generate
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.mapping_file import Proposed, load_mapping
from modelgen.spec.load import parse_spec

SPEC = """
chain = { name = "axis", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_v", coulomb = "F_s", actuator = "T" },
    { name = "c", inertia = "J_c" },
]
links = [{ bodies = ["m", "c"], stiffness = "K", damping = "D", ratio = RATIO }]
[sensors.both]
q_m = { body = "m", measures = "MEASURES" }
q_c = { body = "c", measures = "MEASURES" }
"""
T = np.arange(2000) / 1000.0
SLOW = np.sin(2 * np.pi * T)


def axis(ratio: str = "1.0", measures: str = "position") -> Model:
    spec = parse_spec(SPEC.replace("RATIO", ratio).replace("MEASURES", measures), "axis.toml")
    return model_from_text(generate(spec, "both"), "axis_both")


def judged(model: Model, motor: np.ndarray, load: np.ndarray) -> bool:
    entries = tuple(Proposed(key, "rad", key, None, "by its name") for key in ("q_m", "q_c"))
    first, second = with_reversed(entries, model, {"q_m": motor, "q_c": load})
    assert not first.negate
    assert ("--map q_c=-q_c" in second.why) == second.negate
    return second.negate


@pytest.mark.parametrize("measures", ["position", "velocity"])
@pytest.mark.parametrize("ratio", [1.0, 20.0, 0.01, -3.0])
@pytest.mark.parametrize("offset", [0.0, 300.0])
def test_the_sign_is_that_of_the_rigid_chain(measures: str, ratio: float, offset: float) -> None:
    model = axis(repr(ratio), measures)
    flexible = SLOW / ratio + offset + 0.01 * np.random.default_rng(0).normal(size=T.size) / abs(ratio)
    assert not judged(model, SLOW, flexible)
    assert judged(model, SLOW, -flexible)


def test_vibration_against_each_other_is_no_reversal() -> None:
    fast = np.sin(2 * np.pi * 150.0 * T)
    assert not judged(axis(), fast, -fast)
    assert not judged(axis(), SLOW + fast, SLOW - fast)


def test_a_body_that_rests_or_a_broken_channel_says_nothing() -> None:
    broken = SLOW.copy()
    broken[5] = np.nan
    for load in (np.zeros(T.size), broken, SLOW[:50]):
        assert not judged(axis(), SLOW[: load.size], load)


def test_import_writes_it_into_the_mapping(tmp_path: Path) -> None:
    (tmp_path / "axis.toml").write_text(SPEC.replace("RATIO", "2.0").replace("MEASURES", "position"))
    (tmp_path / "axis.py").write_text(generate(parse_spec((tmp_path / "axis.toml").read_text(), "a"), "both"))
    table = np.column_stack((T, SLOW, -SLOW / 2.0, 0.1 * SLOW))
    header = "t,theta_mot,theta_load,T"
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header=header, comments="")
    arguments = ["import", str(tmp_path / "run.csv"), "--model", str(tmp_path / "axis.py")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "q_c <- -theta_load" in result.stdout and "--map q_c=-theta_load" in result.stdout
    mapping = load_mapping(tmp_path / "run.map.toml")
    assert dict(mapping.columns) == {"q_m": "theta_mot", "q_c": "-theta_load", "T": "T"}
    told = json.loads(CliRunner().invoke(app, [*arguments, "--overwrite", "--json"]).stdout)
    assert [entry["negate"] for entry in told["channels"]] == [False, True, False]
