"""Every rule of an arm's file: a wrong file and the message that it gives; mistakes are reported together."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from modelgen.errors import SpecError
from modelgen.spec.arms.load import parse_arm
from modelgen.spec.arms.transmission import is_invertible

GOOD = """
[arm]
name = "arm"
gravity = [0, 0, -9.81]
[[joints]]
name = "1"
r = "H"
gear = 100
[[joints]]
name = "2"
alpha = 90
theta = "pi/2"
friction = "asymmetric"
position_limits = [-120, "2.5 rad"]
speed_limit = "180 deg/s"
[[joints]]
name = "3"
d = 0.4
viscous = "rub_3"
offset = false
[[joints]]
name = "tool"
type = "fixed"
xyz = [0, 0, 0.1]
[[couplings]]
motor = "3"
joint = "2"
ratio = "1/3"
[lengths]
H = 0.3
[known]
m_tool = 1.5
[parameters.guess]
Izz_1 = 2
"""


def problems(text: str) -> list[str]:
    with pytest.raises(SpecError) as error:
        parse_arm(text, "arm.toml")
    return [str(problem).removeprefix("arm.toml: ") for problem in error.value.problems]


def changed(*changes: tuple[str, str]) -> str:
    text = GOOD
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def test_the_good_file_is_good() -> None:
    arm = parse_arm(GOOD, "arm.toml")
    assert [joint.name for joint in arm.joints] == ["1", "2", "3", "tool"]
    assert [joint.parent for joint in arm.joints] == [None, "1", "2", "3"]
    assert arm.joints[2].viscous == "rub_3" and arm.joints[2].offset is None
    assert arm.joints[1].position_limits == pytest.approx((-2.0943951, 2.5))
    assert arm.joints[1].speed_limit == pytest.approx(3.14159265)
    assert [[str(ratio) for ratio in row] for row in arm.transmission] == [
        ["100", "0", "0"],
        ["0", "1", "0"],
        ["0", "1/3", "1"],
    ]
    assert (arm.lengths, arm.known) == ({"H": 0.3}, {"m_tool": 1.5})


WRONG = [
    (("gravity = [0, 0, -9.81]", "gravity = 9.81"),
     "arm.gravity: must be a list of three, not 9.81; write for example gravity = [0, 0, -9.81]"),
    (("gravity = [0, 0, -9.81]", "gravty = [0, 0, 0]"),
     'arm.gravty: is not a key of this table; did you mean "gravity"?'),
    (('name = "2"', 'name = "two axes"'),
     'joints[1].name: "two axes" is no name of a joint; '
     'write "two_axes", also where a URDF has another mark'),
    (('name = "2"', 'name = "é"'),
     'joints[1].name: "é" is no name of a joint; use letters, digits and _ (ASCII, 48 at most)'),
    (('name = "2"', 'name = "base"'), 'joints[1].name: "base" is what does not move; choose another name'),
    (("alpha = 90", "alpha = 1.5708"),
     'joints[1].alpha: is 1.5708, which would be degrees, but looks like pi/2 rad; write "pi/2" or 90; '
     'or name the unit, "1.5708 deg"'),
    (("alpha = 90", "alpha = nan"),
     'joints[1].alpha: is nan, no angle; write for example 90 (degrees), "pi/2" or "0.35 rad"'),
    (("d = 0.4", 'd = "0.4 m"'),
     'joints[2].d: is "0.4 m", which cannot be read from \'m\' at character 5 on; write a number (m) or a '
     'multiple of one name, for example 0.4318 (m), "431.8/1000", "L2" or "-L2/2"'),
    (("d = 0.4", "d = 0.4\ngear = 1e-300"),
     "joints[2].gear: is 1e-300; give a magnitude from 1e-30 to 1e+30"),
    (("d = 0.4", "d = 1e300"),
     "joints[2].d: is 1e+300, a length that cannot be used; "
     "give zero or a magnitude from 1e-30 to 1e+30; check the unit"),
    (("d = 0.4", "d = 0.4\nxyz = [0, 0, 0]"),
     "joints[2]: has both d and xyz; keep one way: gamma, b, alpha, d, theta, r; or xyz, rpy (with theta, r "
     "as the joint's zero)"),
    (("d = 0.4", 'parent = "4"'), 'joints[2].parent: "4" is not a joint; the joints are 1, 2, 3, tool, base'),
    (("d = 0.4", 'parent = "3"'), 'joints[2].parent: is the joint itself; name another one, or "base"'),
    (('r = "H"', 'r = "H"\nparent = "3"'),
     'joints: 1 - 3 - 2 carry each other in a circle; let one of them have parent = "base"; '
     "a loop is not a tree"),
    (('type = "fixed"', 'type = "fixed"\nviscous = true'),
     "joints[3].viscous: is of a joint that is fixed; leave it out, or let the joint move"),
    (('type = "fixed"', 'type = "ball"'),
     'joints[3].type: must be "revolute", "prismatic" or "fixed", not "ball"; '
     'write for example type = "revolute"'),
    (('speed_limit = "180 deg/s"', "speed_limit = 3.1"),
     'joints[1].speed_limit: is 3.1, without a unit; write for example "180 deg/s" or "3.14 rad/s"'),
    (('[-120, "2.5 rad"]', "[120, -120]"),
     "joints[1].position_limits: has its lower limit 120 not below -120; swap them"),
    (("gear = 100", "gear = 0"),
     "joints[0].gear: must be a number other than 0, not 0; write for example gear = 100"),
    (('motor = "3"', 'motor = "2"'),
     'couplings[0]: couples "2" with itself; write gear into the joint\'s table'),
    (('joint = "2"', 'joint = "tool"'),
     'couplings[0].joint: "tool" is fixed; name a joint that moves'),
    (("H = 0.3", "h = 0.3"), 'lengths.h: is in no placement; the lengths in placements are H'),
    (("m_tool = 1.5", "m_tool = -1.5"),
     "known.m_tool: is -1.5, but m of joint tool is never negative; correct the value"),
    (("m_tool = 1.5", "M_tool = 1.5"),
     'known.M_tool: is not a parameter of the arm; did you mean "m_tool"?'),
    (("m_tool = 1.5", "Fv_2 = 1.5"),
     "known.Fv_2: is not a parameter of the arm; write Fv_2_plus and Fv_2_minus"),
    (('viscous = "rub_3"', 'viscous = "Ia_3"'),
     'joints[2].viscous: "Ia_3" is the rotor\'s inertia of joint 3 and viscous of joint 3; '
     "rename one of them"),
    (('name = "3"', 'name = "2"'), 'joints[2].name: "2" is the name of joints[1]; rename one'),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), WRONG, ids=lambda item: str(item)[:30])
def test_a_mistake_gives_its_message(change: tuple[str, str], message: str) -> None:
    assert message in problems(changed(change))


def test_all_mistakes_are_reported_at_once() -> None:
    chosen = [WRONG[k] for k in (1, 2, 5, 15, 21)]
    found = problems(changed(*(change for change, _ in chosen)))
    assert {message for _, message in chosen} <= {*found}


def test_couplings_that_leave_no_inverse_are_refused() -> None:
    more = '[[couplings]]\nmotor = "2"\njoint = "3"\nratio = 3\n[lengths]'
    (found,) = problems(changed(("[lengths]", more)))
    assert found.startswith("couplings: leave motors that move together")


@pytest.mark.parametrize(
    "text", ["", "[arm]\n", '[arm]\nname = "a"\n', "[[joints]]\n", "joints = 3\n", "arm = 1\n"]
)
def test_a_file_that_is_hardly_begun_is_explained(text: str) -> None:
    assert problems(text)


@given(st.lists(st.integers(-3, 3), min_size=16, max_size=16))
def test_an_inverse_is_found_as_exact_elimination_finds_it(entries: list[int]) -> None:
    rows = [[Fraction(entry, 7) for entry in entries[k : k + 4]] for k in range(0, 16, 4)]
    assert is_invertible(rows) == (sympy.Matrix(4, 4, entries).det() != 0)


def test_many_couplings_are_decided_at_once() -> None:
    joints = "".join(f'[[joints]]\nname = "j{k}"\n' for k in range(100))
    pairs = [(i, j) for i in range(100) for j in range(100) if i != j][:5000]
    couplings = "".join(
        f'[[couplings]]\nmotor = "j{i}"\njoint = "j{j}"\nratio = 1.{(i * 7919 + j * 104729) % 99991}e-7\n'
        for i, j in pairs
    )
    assert len(parse_arm(f'[arm]\nname = "a"\n{joints}{couplings}', "a.toml").transmission) == 100


@pytest.mark.slow
def test_too_many_joints_are_refused_at_once() -> None:
    joints = "".join(f'[[joints]]\nname = "j{k}"\n' for k in range(10_000))
    assert problems(f'[arm]\nname = "a"\n{joints}') == [
        "joints: are 10000 joints, more than 1000; leave out what is not identified",
        "joints: are 10000 joints that move, more than 100; leave out what is not identified",
    ]
