"""URDFs that are wrong or hostile: each gives its message, with the line; what a TOML file changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from modelgen.errors import SpecError
from modelgen.spec.arms.arm import ArmSpec, Turn
from modelgen.spec.arms.load import load_arm, parse_arm
from tests.spec.arms.random_urdf import random_urdf

GOOD = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><mass value="2"/><origin xyz="0.1 0 0"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"/>
<link name="tool"/>
<joint name="shoulder-1" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 0.5" rpy="1.5707963 0 -1.5708"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="2" effort="30"/><dynamics damping="0.5" friction="0.25"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><axis xyz="0 0 1"/></joint>
<joint name="flange" type="fixed"><parent link="fore"/><child link="tool"/></joint>
</robot>
"""
TOML = '[arm]\nname = "arm"\nurdf = "arm.urdf"\n'


@pytest.fixture
def load(tmp_path: Path):
    def load_it(urdf: str | bytes, toml: str = TOML) -> ArmSpec:
        content = urdf if isinstance(urdf, bytes) else urdf.encode()
        (tmp_path / "arm.urdf").write_bytes(content)
        (tmp_path / "arm.toml").write_text(toml)
        return load_arm(tmp_path / "arm.toml")

    return load_it


def problems(load, urdf: str | bytes, toml: str = TOML) -> list[str]:
    with pytest.raises(SpecError) as error:
        load(urdf, toml)
    return [str(problem) for problem in error.value.problems]


def changed(*changes: tuple[str, str]) -> str:
    text = GOOD
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def test_what_a_urdf_says(load) -> None:
    arm = load(GOOD)
    first, second, third = arm.joints
    assert [joint.name for joint in arm.joints] == ["shoulder_1", "elbow", "flange"]
    assert [joint.parent for joint in arm.joints] == [None, "shoulder_1", "elbow"]
    assert [joint.kind for joint in arm.joints] == ["revolute", "revolute", "fixed"]
    assert all(
        {abs(step.angle.cosine), abs(step.angle.sine)} == {0, 1}
        for joint in arm.joints
        for step in joint.placement
        if isinstance(step, Turn)
    )
    assert (first.position_limits, first.speed_limit, first.force_limit) == ((-1.0, 1.0), 2.0, 30.0)
    assert second.position_limits is None
    assert third.link == ()  # it has no mass, and no coordinate that could tell
    values = arm.parameter_sets["urdf"]
    assert (values["Fv_shoulder_1"], values["Fs_shoulder_1"]) == (0.5, 0.25)
    # z is the axis, y of the URDF; the centre of mass is on x, 0.1 m away
    assert values["Izz_shoulder_1"] == pytest.approx(1.02)
    assert (values["m_shoulder_1"], values["m_elbow"]) == (2.0, 0.0)


def test_what_is_fixed_to_the_base_has_no_parameters(load) -> None:
    between = """<link name="world"/><joint name="stand" type="fixed">
<parent link="world"/><child link="base"/></joint>
<link name="base"><inertial><mass value="50"/></inertial></link>"""
    arm = load(changed(('<link name="base"/>', between)))
    stand, shoulder = arm.joints[:2]
    assert (stand.name, stand.link, shoulder.parent) == ("stand", (), "stand")
    assert not any("stand" in name for name in arm.parameter_sets["urdf"])
    assert shoulder.link[0] == "Ixx_shoulder_1"


def test_a_toml_file_changes_drives_and_holds_joints(load) -> None:
    more = """
gravity = [0, 0, 0]
drive = ["viscous"]
[[joints]]
name = "elbow"
type = "fixed"
[[joints]]
name = "shoulder_1"
gear = 50
viscous = "rub"
speed_limit = "90 deg/s"
[[joints]]
name = "payload"
type = "fixed"
parent = "flange"
[known]
m_payload = 3
"""
    arm = load(GOOD, TOML + more)
    assert [joint.name for joint in arm.moving] == ["shoulder_1"]
    assert (arm.moving[0].viscous, arm.moving[0].coulomb, arm.moving[0].offset) == ("rub", None, None)
    assert arm.moving[0].speed_limit == pytest.approx(1.5707963)
    assert arm.moving[0].force_limit == 30
    assert arm.transmission == ((50,),)
    assert arm.parameter_sets["urdf"]["rub"] == 0.5
    assert arm.joints[-1].parent == "flange" and arm.known == {"m_payload": 3.0}


@pytest.mark.parametrize("seed", range(3))
def test_the_same_files_give_the_same_arm(load, seed: int) -> None:
    assert load(random_urdf(seed)) == load(random_urdf(seed))


BOMB = (
    '<?xml version="1.0"?><!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(8))
    + ']><robot name="&i;"/>'
)
HOSTILE = {
    "entities in entities": (BOMB, "line 1: has a document type"),
    "another file": (
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>',
        "line 1: has a document type",
    ),
    "a document type elsewhere": (
        '<!DOCTYPE robot SYSTEM "http://127.0.0.1/x.dtd"><robot/>',
        "line 1: has a document type",
    ),
    "an entity nobody declared": ('<robot name="&x;"/>', "is not valid XML (undefined entity)"),
    "deep": ("<robot>" + "<a>" * 100_000, "nests elements too deeply"),
    "many": ("<robot>" + "<a/>" * 150_000 + "</robot>", "has more than 100000 elements"),
    "half": (GOOD[:200], "is not valid XML"),
    "nothing": ("", "is not valid XML (no element found)"),
    "two": ("<robot/><robot/>", "is not valid XML (junk after document element)"),
    "no XML": ("[arm]", "is not valid XML"),
    "UTF-16": (GOOD.encode("utf-16"), "is UTF-16, not UTF-8 text"),
    "another format": ("<sdf/>", "is SDF, not URDF"),
    "macros": ('<robot xmlns:xacro="x"><xacro:include filename="b"/></robot>', "expand them first: xacro"),
    "10,000 joints": (
        "<robot><link name='l'/>" + "<joint name='j'/>" * 10_000 + "</robot>",
        "has 10000 joints, more than 1000",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_files_give_one_message(load, case: str) -> None:
    text, message = HOSTILE[case]
    (found,) = problems(load, text)
    assert "arm.urdf" in found and message in found


WRONG = {
    "no number": (('xyz="0 0 0.5"', 'xyz="0 0 nan"'), 'line 8: joint shoulder_1: has xyz = "0 0 nan"'),
    "two numbers": (('xyz="0 0 0.5"', 'xyz="0 0.5"'), "which is not 3 numbers"),
    "huge": (('xyz="0 0 0.5"', 'xyz="0 0 1e300"'), "which is not 3 numbers that can be calculated with"),
    "thousands of digits": (('value="2"', f'value="{"9" * 5000}"'), "line 3: link"),
    "code": (('name="elbow"', "name=\"__import__('os')\""), "is no name of a joint"),
    "braces": (('name="elbow"', 'name="{{ x }}"'), "is no name of a joint"),
    "the same name": (('name="elbow"', 'name="shoulder.1"'), 'has the name of joint "shoulder-1"'),
    "a second link": (('<link name="tool"/>', '<link name="fore"/>'), 'line 6: is a second link "fore"'),
    "no such link": (('<parent link="upper"/>', '<parent link="uper"/>'), 'did you mean "upper"?'),
    "a loop": (('<child link="tool"/>', '<child link="upper"/>'), "ends at link"),
    "a circle": (('<parent link="base"/>', '<parent link="fore"/>'), "a circle: shoulder_1, elbow, flange"),
    "mimic": (('<axis xyz="0 0 1"/>', '<mimic joint="shoulder-1"/>'), 'name = "elbow", type = "fixed"'),
    "floating": (('type="continuous"', 'type="floating"'), "is of type floating: it moves in six directions"),
    "planar": (('type="continuous"', 'type="planar"'), "is of type planar"),
    "a misspelt type": (('type="continuous"', 'type="continous"'), 'did you mean "continuous"?'),
    "degrees": (('rpy="1.5707963 0 -1.5708"', 'rpy="9000 0 0"'), "has an angle beyond 1000 rad"),
    "no axis": (('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>'), "has an axis without a direction"),
    "negative": (('value="2"', 'value="-2"'), "has value = -2, which is negative"),
    "limits": (('lower="-1"', 'lower="1.5"'), "has its lower limit 1.5 above 1"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_gives_its_message(load, case: str) -> None:
    change, message = WRONG[case]
    found = problems(load, changed(change))
    assert any("arm.urdf" in one and message in one for one in found), found


def test_joints_in_a_circle_are_refused(load) -> None:
    text = changed(('<link name="base"/>', ""), ('<parent link="base"/>', '<parent link="fore"/>'))
    assert any(
        "carry each other in a circle: shoulder_1, elbow, flange" in one for one in problems(load, text)
    )


def test_mistakes_of_both_files_are_reported_together(load) -> None:
    text = changed(WRONG["mimic"][0], WRONG["negative"][0], WRONG["limits"][0])
    found = problems(load, text, TOML + "gravity = 9.81\n")
    assert [one.split(":")[0] for one in found] == ["arm.toml", *["arm.urdf"] * 3]


def test_what_the_toml_file_may_not_change(load) -> None:
    tables = """
[[joints]]
name = "elbow"
alpha = 90
[[joints]]
name = "elbo"
[parameters.urdf]
"""
    found = problems(load, GOOD, TOML + tables)
    assert [one.split("; ")[0].removeprefix("arm.toml: ") for one in found] == [
        'joints[1].name: "elbo" is no joint of the URDF',
        'joints[0].alpha: of "elbow" is said by the URDF',
        "parameters.urdf: is the set that the inertials of the URDF make",
    ]


def test_a_urdf_that_is_not_there_is_one_message(tmp_path: Path) -> None:
    for urdf in ("none.urdf", "package://robot/arm.urdf", ".", "/dev/zero"):
        with pytest.raises(SpecError, match=r"cannot be read .*; check the path under urdf"):
            parse_arm(TOML.replace("arm.urdf", urdf), "arm.toml", tmp_path)
    with pytest.raises(SpecError, match=r"arm.toml: arm.urdf: .* this text is in no folder"):
        parse_arm(TOML, "arm.toml")
