"""`modelgen show` and `new` with arms: what is printed, written and refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from modelgen.cli.main import app, main
from modelgen.spec.arms.arm import LINK_PARAMETERS
from modelgen.spec.load import catalog_arms, catalog_path
from tests.spec.arms.random_urdf import random_urdf


def run(*arguments: str) -> Result:
    return CliRunner(env={"COLUMNS": "160"}).invoke(app, arguments)


@pytest.mark.parametrize("name", catalog_arms())
def test_show_says_the_same_as_a_table_and_as_json(name: str) -> None:
    printed = run("show", name)
    assert printed.exit_code == 0, printed.output
    described = json.loads(run("show", name, "--json").output)
    assert described["arm"] == name
    for joint in described["joints"]:
        assert joint["placement"] in printed.output
    for motor in described["motors"]:
        assert motor["position"] in printed.output
    assert f"Parameters: {len(described['parameters'])}" in printed.output


def test_show_of_the_coupled_arm() -> None:
    described = json.loads(run("show", "tx40", "--json").output)
    assert described["motors"][5] == {"joint": "6", "position": "motor 6 = 32 q_5 + 32 q_6"}
    assert described["joints"][1]["placement"] == "Rot(x, -90°) Rot(z, -90°)"
    assert {p["unit"] for p in described["parameters"] if p["joint"] == "1"} == {
        "kg m^2",
        "kg m",
        "kg",
        "N m s/rad",
        "N m",
    }


@pytest.mark.parametrize(("name", "links"), [("two_link", 6), ("scara", 8), ("tx40", 36)])
def test_show_counts_base_parameters(name: str, links: int) -> None:
    described = json.loads(run("show", name, "--prove", "--json").output)
    base = described["base_parameters"]
    assert sum(entry["of"] == "link" for entry in base) == links
    assert described["newton_equals_lagrange"] is True
    printed = run("show", name).output
    assert f"Base parameters: {len(base)} ({links} of links" in printed
    assert {entry["name"] for entry in base if entry["terms"] == 1} == {*described["identifiable"]}


LIGHTWEIGHT = ((0.11, "0 0 1"), (0.2, "0 -1 0"), (0.2, "0 0 1"), (0.2, "0 1 0"), (0.2, "0 0 1"))
LIGHTWEIGHT += ((0.19, "0 -1 0"), (0.078, "0 0 1"))


def test_a_urdf_of_seven_axes_has_43_inertial_base_parameters(tmp_path: Path) -> None:
    pieces = ['<link name="l0"/>']
    for k, (height, axis) in enumerate(LIGHTWEIGHT):
        pieces.append(f'<link name="l{k + 1}"><inertial><mass value="2"/></inertial></link>')
        pieces.append(
            f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
            f'<origin xyz="0 0 {height}" rpy="0 0 6.283185"/><axis xyz="{axis}"/></joint>'
        )
    (tmp_path / "r.urdf").write_text(f"<robot>{''.join(pieces)}</robot>")
    (tmp_path / "r.toml").write_text('[arm]\nname = "r"\nurdf = "r.urdf"\ndrive = []\n')
    described = json.loads(run("show", str(tmp_path / "r.toml"), "--json").output)
    assert len(described["base_parameters"]) == 43
    assert described["joints"][6]["pose"][2][3] == pytest.approx(1.178)


def test_an_arm_without_rows_is_shown_all_the_same(tmp_path: Path) -> None:
    known = "".join(f"{name}_1 = 0\n" for name in (*LINK_PARAMETERS, "Ia", "Fv", "Fs", "off"))
    (tmp_path / "a.toml").write_text(f'[arm]\nname = "a"\n[[joints]]\nname = "1"\n[known]\n{known}')
    printed = run("show", str(tmp_path / "a.toml"))
    assert printed.exit_code == 0
    assert "base parameters: none are derived; no parameter is left to be estimated" in printed.output


def test_show_says_what_sensor_sets_give_and_what_they_lack() -> None:
    described = json.loads(run("show", "elastic_two_link", "--sensors", "all", "--json").output)
    by_name = {entry["name"]: entry for entry in described["sensor_sets"]}
    assert not by_name["motor and link encoders"]["lost"]
    rows = [row["name"] for row in by_name["motor encoders, link speeds"]["rows"]]
    assert rows == ["1", "2", "dq_1 motion", "dq_2 motion"]
    assert [row["name"] for row in by_name["motor encoders"]["rows"]] == ["1", "2"]
    assert by_name["motor encoders"]["estimated"] == ["q_1", "q_2"] and not by_name["motor encoders"]["lost"]
    assert by_name["link encoders"]["estimated"] == ["deflection_1", "deflection_2"]
    assert not by_name["link encoders"]["lost"] and not by_name["link encoders"]["reason"]
    one = run("show", "elastic_two_link", "--sensors", "rates").output
    assert "Base parameters: 18 (6 of links, 12 of drives)" in one
    rigid = json.loads(run("show", "two_link", "--sensors", "all", "--json").output)["sensor_sets"]
    assert not any(entry["lost"] for entry in rigid)


def test_sensors_in_vain_are_told_from_those_that_others_replace(tmp_path: Path) -> None:
    text = catalog_path("elastic_two_link").read_text(encoding="utf-8")
    few = "".join(
        f'{key} = {{ joint = "{joint}", side = "{side}", measures = "position" }}\n'
        for key, joint, side in (("m1", "1", "motor"), ("l1", "1", "link"), ("m2", "2", "motor"))
    )
    text = text.replace('"damping"]', '"damping", "stiffness3"]')
    text = text.replace("[lengths]", f"[sensors.few]\n{few}\n[lengths]")
    file = tmp_path / "a.toml"
    file.write_text(text, encoding="utf-8")
    (told,) = json.loads(run("show", str(file), "--sensors", "few", "--json").output)["sensor_sets"]
    assert told["unread"] == [] and told["unread_in_vain"] == ["m2"]
    printed = run("show", str(file), "--sensors", "few").output
    assert "no row reads m2: the rows that hold what they measure need more" in printed


def test_show_draws_an_arm(tmp_path: Path) -> None:
    picture = tmp_path / "arm.svg"
    assert run("show", "scara", "--svg", str(picture)).exit_code == 0
    assert picture.read_text(encoding="utf-8").startswith("<svg ")


def test_an_angle_beside_a_right_one_is_noted(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('[arm]\nname = "a"\n[[joints]]\nname = "1"\nalpha = "1.57 rad"\n')
    printed = run("show", str(tmp_path / "a.toml")).output
    assert "note: joint 1 is turned 0.0008 rad off a right angle" in printed


REFUSED = {
    "sensor sets": ("show tx40 --sensors q", ["describes an arm without sensor sets"]),
    "a comparison with nothing": ("compare tx40", ["names 1 model; give two or more"]),
    "a misspelt sensor set": ("show elastic_two_link --sensors encoder", ['did you mean "encoders"?']),
    "a project": ("new a --arm --project", ["--project: is for chains"]),
    "a name with quotes": ("new a\"b --arm", ["is not a name"]),
    "no URDF": ("new a --urdf none.urdf", ["none.urdf: cannot be read"]),
    "a misspelt example": ("show tx4", ['"tx4": is not in the catalogue; did you mean "tx40"?']),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line, messages = REFUSED[case]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["modelgen", *line.split()])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    printed = capsys.readouterr().err
    assert all(message in printed for message in messages), printed
    assert not list(tmp_path.iterdir())


def test_new_starts_an_arm_that_show_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("robot.urdf").write_text(random_urdf(5))
    for line in ("new plain --arm", "new robot --urdf robot.urdf", "new soft --elastic"):
        done = run(*line.split())
        assert done.exit_code == 0, done.output
        assert "next: modelgen show" in done.output
    for name in ("plain", "robot", "soft"):
        assert json.loads(run("show", f"{name}.toml", "--json").output)["arm"] == name


def test_new_holds_the_joints_that_no_arm_can_have(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    kinds = ('type="revolute"', 'type="revolute"><mimic joint="a-0"/', 'type="planar"', 'type="floating"')
    pieces = ['<link name="l0"/>']
    for k, kind in enumerate(kinds):
        pieces.append(f'<link name="l{k + 1}"/>')
        ends = f'<parent link="l{k}"/><child link="l{k + 1}"/>'
        pieces.append(f'<joint name="a-{k}" {kind}>{ends}</joint>')
    Path("odd.urdf").write_text(f"<robot>{''.join(pieces)}</robot>")
    assert run("new", "odd", "--urdf", "odd.urdf").exit_code == 0
    described = json.loads(run("show", "odd.toml", "--json").output)
    assert [joint["type"] for joint in described["joints"]] == ["revolute", "fixed", "fixed", "fixed"]
