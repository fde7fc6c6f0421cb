"""Rules of the format that the whole chain must keep: a wrong file for each, and the message from end to end.

What single tables and references must keep is in `test_spec`; what a sensor set cannot answer is here.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from modelgen.cli.main import app
from modelgen.errors import ModelError, ModelgenError
from modelgen.spec.load import parse_spec
from modelgen.symbolic.pipeline import build
from modelgen.symbolic.sensor_set_overview import MOST_BODIES, every_subset

CHAIN = """
[chain]
name = "axis"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
actuator = "Gamma_m"
[[bodies]]
name = "c"
inertia = "J_c"
[[links]]
bodies = ["m", "c"]
stiffness = "K"
stiffness3 = "K3"
[sensors.qm]
q_m = { body = "m", measures = "position" }
[sensors.qm_ac]
q_m = { body = "m", measures = "position" }
a_c = { body = "c", measures = "acceleration" }
[sensors.vm_vc]
v_m = { body = "m", measures = "velocity" }
v_c = { body = "c", measures = "velocity" }
[sensors.qm_qc]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
[sensors.twist]
twist = { deflection = ["m", "c"], measures = "position" }
q_m = { body = "m", measures = "position" }
"""
CUBE = "the cubic stiffness K3 needs its link's deflection undifferentiated"
CASES = {
    "cubic stiffness, load without sensor": (
        CHAIN,
        "qm",
        "axis.toml: sensors.qm: the cubic stiffness at m would have to be eliminated with c; "
        "add a position sensor on c",
    ),
    "cubic stiffness, acceleration": (
        CHAIN,
        "qm_ac",
        f"axis.toml: sensors.qm_ac: {CUBE}; add a position sensor on c, or a deflection sensor on that link",
    ),
    "cubic stiffness, velocities": (
        CHAIN,
        "vm_vc",
        f"axis.toml: sensors.vm_vc: {CUBE}; add a position sensor on m, c, or a deflection sensor on that "
        "link",
    ),
    "no such sensor set": (
        CHAIN,
        "other",
        "axis.toml: sensors.other: there is no such sensor set; choose one of qm, qm_ac, vm_vc, qm_qc, twist",
    ),
    "nothing acts": (
        CHAIN.replace('actuator = "Gamma_m"\n', "").replace('stiffness3 = "K3"\n', ""),
        "qm_qc",
        "axis.toml: bodies: no force is measured or known anywhere, so only the ratios to each other of "
        "J_m, J_c, K can be identified; "
        'give the body that is driven an actuator, for example actuator = "Gamma_m"',
    ),
    "everything known": (
        CHAIN.replace('stiffness3 = "K3"\n', "") + "[known]\nJ_m = 1.0\nJ_c = 1.0\nK = 1.0\n",
        "qm_qc",
        "axis.toml: sensors.qm_qc: no parameter is left to be estimated; "
        "take at least one parameter out of [known]",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_sensor_set_that_cannot_answer(name: str) -> None:
    text, sensors, message = CASES[name]
    with pytest.raises(ModelgenError) as caught:
        build(parse_spec(text, "axis.toml"), sensors)
    assert str(caught.value) == message


@pytest.mark.parametrize("sensors", ["qm_qc", "twist"])
def test_cubic_stiffness_is_allowed_where_the_deflection_is_read(sensors: str) -> None:
    assert "K3" in build(parse_spec(CHAIN, "axis.toml"), sensors).identifiable


def test_only_small_chains_are_enumerated() -> None:
    bodies = "".join(f'[[bodies]]\nname = "b{i}"\ninertia = "J{i}"\n' for i in range(MOST_BODIES + 1))
    links = "".join(
        f'[[links]]\nbodies = ["b{i}", "b{i + 1}"]\nstiffness = "K{i}"\n' for i in range(MOST_BODIES)
    )
    spec = parse_spec(f'[chain]\nname = "long"\nmotion = "rotation"\n{bodies}{links}', "long.toml")
    with pytest.raises(ModelError) as caught:
        every_subset(spec)
    assert str(caught.value) == (
        f"long.toml: --sensors all: {MOST_BODIES + 1} bodies have {4 ** (MOST_BODIES + 1) - 1} subsets of "
        f"sensors; at most {MOST_BODIES} bodies are enumerated; write the sensor sets in question into the "
        "spec"
    )


def test_the_command_line_gives_one_line_a_mistake_and_exit_code_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    wrong = CHAIN.replace('inertia = "J_c"', 'inertia = "J c"').replace('"velocity"', '"speed"')
    (tmp_path / "axis.toml").write_text(wrong, encoding="utf-8")
    result = CliRunner().invoke(app, ["generate", "axis.toml"])
    assert result.exit_code == 2
    lines = result.stderr.splitlines()
    assert [line.split(": ")[:3] for line in lines] == [
        ["error", "axis.toml", "bodies[1].inertia"],
        ["error", "axis.toml", "sensors.vm_vc.v_m.measures"],
        ["error", "axis.toml", "sensors.vm_vc.v_c.measures"],
    ]
    assert list(tmp_path.iterdir()) == [tmp_path / "axis.toml"]


def test_a_wrong_file_ends_a_real_process_without_a_traceback(tmp_path: Path) -> None:
    (tmp_path / "axis.toml").write_text("[chain\n", encoding="utf-8")
    root = str(Path(__file__).resolve().parents[2])
    done = subprocess.run(
        [sys.executable, "-m", "modelgen", "show", "axis.toml"],
        cwd=tmp_path,
        env={"PYTHONPATH": root, "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: axis.toml: line 1, column 7: is not valid TOML")
    assert done.stderr.count("\n") == 1
