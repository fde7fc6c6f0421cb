"""Springs and sensors in an arm's file: what they become, and every mistake with its message."""

from __future__ import annotations

import pytest

from modelgen.errors import SpecError
from modelgen.spec.arms.load import parse_arm
from modelgen.spec.arms.parameters import arm_parameters

GOOD = """
[arm]
name = "soft"
[[joints]]
name = "1"
alpha = 90
stiffness = true
damping = true
[[joints]]
name = "2"
d = 0.5
[[joints]]
name = "3"
type = "prismatic"
stiffness = "k_slide"
stiffness3 = true
[[joints]]
name = "tool"
type = "fixed"
[sensors.all]
qm_1 = { joint = "1", side = "motor", measures = "position" }
dq_3 = { deflection = "3", measures = "velocity" }
w_2 = { joint = "2", side = "link", measures = "velocity" }
t_1 = { joint = "1", measures = "torque" }
g = { joint = "tool", side = "link", measures = "gyro", rpy = [0, 90, 0], xyz = [0, 0, "h/2"] }
[lengths]
h = 0.2
"""


def problems(text: str) -> list[str]:
    with pytest.raises(SpecError) as error:
        parse_arm(text, "soft.toml")
    return [str(problem).removeprefix("soft.toml: ") for problem in error.value.problems]


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def test_the_good_file_is_good() -> None:
    arm = parse_arm(GOOD, "soft.toml")
    assert [joint.elastic for joint in arm.joints] == [True, False, True, False]
    units = {p.name: p.unit for p in arm_parameters(arm)}
    assert (units["K_1"], units["D_1"]) == ("N m/rad", "N m s/rad")
    assert (units["k_slide"], units["K3_3"]) == ("N/m", "N/m^3")
    sensors = arm.sensor_sets["all"]
    assert [s.side for s in sensors] == ["motor", "deflection", "link", "between", "link"]
    assert sensors[-1].channels == ("g_x", "g_y", "g_z") and len(sensors[-1].mounting) == 2
    assert arm.lengths == {"h": 0.2}


def test_without_sensors_a_rigid_arm_has_no_set_and_an_elastic_one_all_encoders() -> None:
    text = GOOD[: GOOD.index("[sensors.all]")]
    sets = parse_arm(text, "soft.toml").sensor_sets
    assert [s.key for s in sets["encoders"]] == ["qm_1", "qm_3", "q_1", "q_2", "q_3"]
    rigid = text.replace("stiffness = true\ndamping = true\n", "").replace(
        'stiffness = "k_slide"\nstiffness3 = true\n', ""
    )
    assert parse_arm(rigid, "rigid.toml").sensor_sets == {}


QM = 'qm_1 = { joint = "1", side = "motor", measures = "position" }'
WRONG = [
    (("stiffness = true\ndamping", "damping"),
     "joints[0].damping: is of a spring, and the joint has no stiffness; "
     "add stiffness = true (or a name), or leave it out"),
    (("type = \"fixed\"", "type = \"fixed\"\nstiffness = true"),
     "joints[3].stiffness: is of a joint that is fixed; leave it out, or let the joint move"),
    ((QM, 'qm_1 = { joint = "7", side = "motor", measures = "position" }'),
     'sensors.all.qm_1.joint: "7" is not a joint; the joints are 1, 2, 3, tool'),
    ((QM, 'qm_1 = { joint = "tool", side = "motor", measures = "position" }'),
     'sensors.all.qm_1.joint: "tool" is fixed; name a joint that moves'),
    ((QM, 'qm_1 = { joint = "1", measures = "position" }'),
     'sensors.all.qm_1.side: is missing; write side = "motor" or "link"'),
    ((QM, 'qm_1 = { joint = "1", sid = "motor", measures = "position" }'),
     'sensors.all.qm_1.sid: is not a key of this table; did you mean "side"?'),
    ((QM, 'qm_1 = { joint = "1", side = "motr", measures = "position" }'),
     'sensors.all.qm_1.side: must be "motor" or "link", not "motr"; write for example side = "motor"'),
    ((QM, 'qm_1 = { joint = "1", side = "motor", measures = "gyro" }'),
     'sensors.all.qm_1.side: has a motor with a gyro; write side = "link"'),
    ((QM, 'qm_1 = { joint = "1", side = "motor" }'),
     'sensors.all.qm_1.measures: is missing; write measures = "position"'),
    ((QM, 'qm_1 = { measures = "torque" }'),
     'sensors.all.qm_1: has neither joint nor deflection; add joint = "1"'),
    ((QM, 'qm_1 = { joint = "1", deflection = "1", measures = "position" }'),
     "sensors.all.qm_1: has both joint and deflection; keep one of them"),
    ((QM, 'qm_1 = { deflection = "2", measures = "position" }'),
     'sensors.all.qm_1.deflection: "2" has no stiffness, so nothing deflects; '
     "write stiffness = true into the table of joint 2, or leave the sensor out"),
    ((QM, 'qm_1 = { deflection = "1", measures = "torque" }'),
     'sensors.all.qm_1.measures: is "torque", of a deflection; '
     'write "position", "velocity" or "acceleration"'),
    ((QM, 'qm_1 = { joint = "1", side = "motor", measures = "position", mounting = "estimated" }'),
     "sensors.all.qm_1.mounting: is the mounting of a gyro or an accelerometer; leave it out"),
    ((QM, 'qm_1 = { joint = "1", side = "link", measures = "gyro", mounting = "found" }'),
     'sensors.all.qm_1.mounting: must be "given" or "estimated", not "found"; '
     'write for example mounting = "estimated"'),
    ((QM, 'qm_1 = { joint = "1", side = "motor", measures = "position", xyz = [0, 0, 1] }'),
     "sensors.all.qm_1.xyz: is the mounting of a gyro or an accelerometer; leave it out"),
    ((QM, QM.replace("qm_1", "tau_1")),
     'sensors.all.tau_1: "tau_1" is the force or torque of the motor of joint 1; rename the sensor'),
    ((QM, QM.replace("qm_1", "d1_q")),
     'sensors.all.d1_q: "d1_q" is kept for a derived signal; do not begin with sign_ or d1_, d2_, ...'),
    ((QM, QM.replace("qm_1", "g_x")), 'sensors.all.g: gives "g_x", as g_x does; rename one of them'),
    ((QM, QM.replace("qm_1", "K_1")), 'sensors.all.K_1: "K_1" is a parameter; rename the sensor'),
    (("h = 0.2", ""), 'lengths.h: is in a placement, but not here; write h = 0.4 (m) under [lengths], or '
     'h = "symbolic" where it has no value'),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), WRONG, ids=lambda item: str(item)[-40:])
def test_a_mistake_gives_its_message(change: tuple[str, str], message: str) -> None:
    assert message in problems(changed(*change))


def test_all_mistakes_are_reported_at_once_and_an_empty_table_is_one() -> None:
    text = changed(QM, 'qm_1 = { joint = "7", side = "motr", measures = "posit" }') + "[sensors.none]\n"
    found = problems(text)
    assert len(found) == 4, found
    assert any("sensors.none: is empty" in line for line in found)


def test_parts_of_a_mounting_are_names_that_nothing_else_has() -> None:
    sensor = 'a = { joint = "1", side = "link", measures = "accelerometer", mounting = "estimated" }'
    text = changed(QM, sensor).replace('"k_slide"', '"R_a_x_y"')
    assert 'sensors.all.a: "R_a_x_y" is a parameter; rename the sensor' in problems(text)
