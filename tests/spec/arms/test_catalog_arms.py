"""The example arms and the starters load, and are what their comments say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import SpecError
from modelgen.render.environment import environment
from modelgen.spec.arms.arm import LINK_PARAMETERS, ArmSpec
from modelgen.spec.arms.load import load_arm, parse_arm
from modelgen.spec.arms.parameters import arm_parameters
from modelgen.spec.arms.poses import zero_poses
from modelgen.spec.load import catalog_arms, catalog_names, catalog_path, load_spec
from tests.spec.arms.rigid_bodies import mass_matrix_and_weights, poses

NAMES = ("elastic_spatial", "elastic_two_link", "puma560", "scara", "two_link", "tx40")


def arm(name: str) -> ArmSpec:
    return load_arm(catalog_path(name))


def test_names_of_the_catalogue() -> None:
    assert catalog_arms() == NAMES
    assert not {*catalog_arms()} & {*catalog_names()}


@pytest.mark.parametrize("name", NAMES)
def test_every_example_is_complete(name: str) -> None:
    assert catalog_path(name).read_text(encoding="utf-8").startswith("# ")
    spec = arm(name)
    assert spec.name == name
    assert spec.parameter_sets
    for values in spec.parameter_sets.values():
        assert list(values) == [parameter.name for parameter in arm_parameters(spec)]


@pytest.mark.parametrize("name", NAMES)
def test_bodies_can_have_the_values_of_the_catalogue(name: str) -> None:
    """Where a link's ten parameters are those of masses, no moment about a plane is negative."""
    for values in arm(name).parameter_sets.values():
        for link in dict.fromkeys(key[2:] for key in values if key.startswith("m_")):
            xx, xy, xz, yy, yz, zz, x, y, z, m = (float(values[f"{p}_{link}"]) for p in LINK_PARAMETERS)
            planes = 0.5 * (xx + yy + zz) * np.eye(3) - [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
            pseudo = np.block([[planes, np.array([[x], [y], [z]])], [np.array([[x, y, z, m]])]])
            assert np.linalg.eigvalsh(pseudo).min() >= -1e-9


def test_an_arm_is_no_chain_and_a_chain_no_arm() -> None:
    with pytest.raises(SpecError, match=r"^tx40\.toml: arm: describes an arm, .* takes chains only"):
        load_spec(catalog_path("tx40"))
    with pytest.raises(SpecError, match=r"^tree\.toml: arm: is missing, .* takes arms only"):
        load_arm(catalog_path("tree"))


def test_tx40_stands_upright_and_its_last_axes_are_coupled() -> None:
    spec = arm("tx40")
    assert zero_poses(spec)["6"][:3, 3] == pytest.approx([0, 0.035, 0.77])
    ratios = np.array([[float(ratio) for ratio in row] for row in spec.transmission])
    expected = np.diag([32.0, 32, 45, -48, 45, 32])
    expected[5, 4] = 32
    np.testing.assert_array_equal(ratios, expected)


def test_puma_has_a_spherical_wrist_where_the_survey_has_it() -> None:
    found = zero_poses(arm("puma560"))
    for joint in "456":
        assert found[joint][:3, 3] == pytest.approx([0.4318 - 0.0203, 0.1501, 0.4331])


def test_scara_slides_down_and_its_screw_travels_by_its_lead() -> None:
    spec = arm("scara")
    q = {"1": 0.0, "2": 0.0, "3": -0.05, "4": 1.0}
    assert poses(spec, q)["4"][:3, 3] == pytest.approx([0.55, 0, 0.15])
    ratios = np.array([[float(ratio) for ratio in row] for row in spec.transmission])
    # the nut at rest, the spindle once around: one lead down
    turned = np.linalg.solve(ratios, [0, 0, 0, 20 * 2 * np.pi])
    assert turned == pytest.approx([0, 0, -0.02, 2 * np.pi])


def test_two_link_is_the_arm_of_textbooks() -> None:
    spec = arm("two_link")
    mass, weights = mass_matrix_and_weights(spec, {"1": 0.3, "2": 0.5}, spec.parameter_sets["nominal"])
    l1, m1, m2 = 0.5, 4.0, 2.0
    expected_11 = (m1 / 3 + m2 + m2 / 3 + m2 * np.cos(0.5)) * l1**2
    assert mass[0, 0] == pytest.approx(expected_11)
    assert weights[1] == pytest.approx(9.81 * m2 * l1 / 2 * np.cos(0.8))


def test_the_poses_are_those_of_the_motion() -> None:
    for name in NAMES:
        spec = arm(name)
        ours, theirs = zero_poses(spec), poses(spec, dict.fromkeys((j.name for j in spec.joints), 0.0))
        for joint in spec.joints:
            np.testing.assert_allclose(ours[joint.name], theirs[joint.name], atol=1e-15)


def test_starter_is_a_good_file_and_so_are_its_options() -> None:
    template = environment().get_template("starter_arm.toml.j2")
    text = template.render(name="my_arm", urdf=None, joints=["1", "2", "3"], held=[], elastic=False)
    spec = parse_arm(text, "my_arm.toml")
    assert (spec.name, [joint.name for joint in spec.joints]) == ("my_arm", ["1", "2", "3", "tool"])
    assert float(spec.gravity[2]) == -9.81
    options = ("friction", "position_limits", "speed_limit", "acceleration_limit", "force_limit", "theta",
               "coulomb", "gain", "[[couplings]]", "motor", "joint", "ratio", "[known]", "m_3", "Fv_1",
               "[parameters.guess]")  # fmt: skip
    lines = [
        line.removeprefix("# ") if line.startswith(tuple(f"# {option}" for option in options)) else line
        for line in text.splitlines()
    ]
    full = "\n".join(lines).replace("Fv_1 = 5.0", "Fv_1_plus = 5.0")
    arm = parse_arm(full, "my_arm.toml")
    assert arm.joints[2].gain == "gain_3" and arm.joints[2].coulomb is None
    assert arm.joints[0].friction == "asymmetric" and arm.known == {"m_3": 1.5}


def test_starter_of_an_elastic_arm_is_a_good_file_and_so_are_its_sensors() -> None:
    template = environment().get_template("starter_arm.toml.j2")
    text = template.render(name="soft", urdf=None, joints=["1", "2", "3"], held=[], elastic=True)
    spec = parse_arm(text, "soft.toml")
    assert all(joint.elastic for joint in spec.moving)
    assert [sensor.key for sensor in spec.sensor_sets["encoders"]] == [
        "qm_1",
        "qm_2",
        "qm_3",
        "q_1",
        "q_2",
        "q_3",
    ]
    options = ("dq =", "w =", "t =", "g =")
    lines = [line.removeprefix("# ") if line.startswith(tuple(f"# {o}" for o in options)) else line
             for line in text.splitlines()]  # fmt: skip
    sensors = parse_arm("\n".join(lines), "soft.toml").sensor_sets["encoders"]
    assert [(s.key, s.side) for s in sensors[6:]] == [
        ("dq", "deflection"), ("w", "link"), ("t", "between"), ("g", "link")
    ]  # fmt: skip


def test_starter_of_a_urdf_is_a_good_file(tmp_path: Path) -> None:
    from tests.spec.arms.random_urdf import random_urdf

    (tmp_path / "r.urdf").write_text(random_urdf(1))
    bare = parse_arm('[arm]\nname = "a"\nurdf = "r.urdf"\n', "a.toml", tmp_path)
    moving = [joint.name for joint in bare.moving]
    template = environment().get_template("starter_arm.toml.j2")
    text = template.render(name="a", urdf='"r.urdf"', joints=moving, held=[], elastic=False)
    assert parse_arm(text, "a.toml", tmp_path).joints == bare.joints
    options = ("gear", "[[joints]]", "name", "type", "parent", "xyz")
    lines = [line.removeprefix("# ") if line.startswith(tuple(f"# {o}" for o in options)) else line
             for line in text.splitlines()]  # fmt: skip
    held = lines.index(f'name = "{moving[-1]}"', lines.index(f'name = "{moving[-1]}"') + 1)
    full = parse_arm("\n".join(lines[: held - 1] + lines[held + 2 :]), "a.toml", tmp_path)
    assert full.joints[-1].name == "payload" and full.transmission[0][0] == 100
