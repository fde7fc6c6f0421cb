"""The picture of an arm: well-formed, escaped, the same bytes again, every joint in it."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

import modelgen
from modelgen.chain_picture.arm_svg import ArmSkeleton, DrawnJoint, arm_svg
from modelgen.spec.load import catalog_arms, catalog_path

SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize("name", catalog_arms())
def test_every_joint_is_named_and_inside(name: str) -> None:
    arm = modelgen.load_arm(catalog_path(name))
    text = modelgen.draw_arm(arm)
    assert text == modelgen.draw_arm(arm)
    page = ElementTree.fromstring(text)
    named = ", ".join(element.text or "" for element in page.iter(f"{SVG}text"))
    assert {f"q_{joint.name}" for joint in arm.moving} <= {*named.split(", ")}
    wide, high = float(page.attrib["width"]), float(page.attrib["height"])
    for element in page.iter(f"{SVG}path"):
        if "A" not in element.attrib["d"]:
            numbers = [float(number) for number in re.findall(r"-?[\d.]+", element.attrib["d"])]
            assert all(0 <= x <= wide for x in numbers[::2]) and all(0 <= y <= high for y in numbers[1::2])


def test_ways_follow_the_steps_of_a_placement() -> None:
    page = ElementTree.fromstring(modelgen.draw_arm(modelgen.load_arm(catalog_path("scara"))))
    bones = [e.attrib["d"] for e in page.iter(f"{SVG}path") if e.attrib["class"] == "bone"]
    assert [bone.count("L") for bone in bones] == [1, 1, 2]  # the third goes along the link, then down


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "fixed"])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.577, 0.577, 0.578)])
def test_texts_are_escaped_whatever_the_joint(kind: str, axis: tuple[float, float, float]) -> None:
    joint = DrawnJoint('<script>&"', kind, ((0.0, 0.0, 0.0),), axis)
    text = arm_svg(ArmSkeleton("</title><script>", (joint,)))
    ElementTree.fromstring(text)
    assert "<script" not in text
