"""Any tables of an arm and any URDF either are an arm or get explained; an arm can be shown and drawn."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.cli.arms.arm_tables import describe_arm
from modelgen.errors import ModelgenError, SpecError
from modelgen.report.arm_drawing import draw_arm
from modelgen.spec.arms.draft import Described
from modelgen.spec.arms.load import parse_arm
from modelgen.spec.arms.urdf.read_urdf import described_arm
from tests.fuzz.test_specs import (
    FUZZ,
    MARKS,
    NIGHTLY,
    NUMBER,
    TEXT,
    check_lines,
    document_text,
    mostly,
    table,
)
from tests.spec.arms.random_urdf import random_urdf

NAME = st.sampled_from(["1", "2", "3", "tool", "base", "L1", "Ia_1"])
ANGLE = mostly(st.sampled_from([0, 90, -90, 30.5, "pi/2", "-pi", "0.3 rad", "20 deg", "1.57"]) | NUMBER)
LENGTH = mostly(st.sampled_from([0, 0.4, "L1", "-L1/2", "2*L2", "1/3", "L1+1"]) | NUMBER)
OWN = mostly(st.booleans() | st.sampled_from(["Ia_1", "rub", "Fv_2"]))
JOINT = table(
    {"name": mostly(NAME)},
    {
        "type": mostly(st.sampled_from(["revolute", "prismatic", "fixed"])),
        "parent": mostly(NAME),
        **{key: ANGLE for key in ("gamma", "alpha", "theta")},
        **{key: LENGTH for key in ("b", "d", "r")},
        "xyz": mostly(st.lists(LENGTH, min_size=3, max_size=3)),
        "rpy": mostly(st.lists(ANGLE, min_size=3, max_size=3)),
        **{key: OWN for key in ("rotor_inertia", "viscous", "coulomb", "offset", "gain")},
        **{key: OWN for key in ("stiffness", "damping", "stiffness3")},
        "gear": mostly(NUMBER),
        "massless": mostly(st.booleans()),
        "position_limits": mostly(st.lists(ANGLE, min_size=2, max_size=2)),
        "speed_limit": mostly(st.sampled_from(["180 deg/s", "1 m/s", 3.0])),
    },
)
COUPLING = table({"motor": mostly(NAME), "joint": mostly(NAME), "ratio": mostly(NUMBER)})
SENSOR = table(
    {"measures": mostly(st.sampled_from(["position", "velocity", "torque", "gyro", "accelerometer"]))},
    {
        "joint": mostly(NAME),
        "deflection": mostly(NAME),
        "side": mostly(st.sampled_from(["motor", "link"])),
        "xyz": mostly(st.lists(LENGTH, min_size=3, max_size=3)),
        "rpy": mostly(st.lists(ANGLE, min_size=3, max_size=3)),
    },
)
SENSORS = st.dictionaries(st.sampled_from(["q_1", "qm_1", "g", "g_x", "tau_1", "Ia_1"]), mostly(SENSOR))
ARM = table(
    {"name": mostly(st.just("arm"))},
    {
        "gravity": mostly(st.lists(NUMBER, min_size=3, max_size=3)),
        "drive": mostly(st.lists(st.sampled_from(["viscous", "coulomb", "gain"]), max_size=3)),
        "urdf": mostly(TEXT),
    },
)
DOCUMENT = st.fixed_dictionaries(
    {"arm": ARM, "joints": mostly(st.lists(JOINT, min_size=1, max_size=4))},
    optional={
        "couplings": mostly(st.lists(COUPLING, max_size=2)),
        "lengths": mostly(
            st.dictionaries(st.sampled_from(["L1", "L2"]), mostly(NUMBER | st.just("symbolic")))
        ),
        "known": mostly(st.dictionaries(st.sampled_from(["m_1", "Fv_2", "Ixx_3", "x"]), mostly(NUMBER))),
        "sensors": mostly(st.dictionaries(st.sampled_from(["all", "few"]), mostly(SENSORS), max_size=2)),
        "parameters": mostly(st.dictionaries(TEXT, st.dictionaries(TEXT, NUMBER, max_size=3), max_size=2)),
    },
)


def explained(text: str) -> bool:
    """Parse an arm, and show and draw it if it is one."""
    try:
        arm = parse_arm(text, "arm.toml")
    except SpecError as error:
        check_lines(error)
        assert all(problem.where.startswith("arm.toml") for problem in error.problems)
        return False
    try:
        describe_arm(arm)
    except ModelgenError as error:
        check_lines(error)
    ElementTree.fromstring(draw_arm(arm))
    return True


@st.composite
def good_documents(draw: st.DrawFn) -> dict[str, Any]:
    """Draw an arm of at most four joints that is free of mistakes."""
    angles = st.sampled_from([0, 90, -90, 180, 30.5, "pi/2", "0.3 rad"])
    lengths = st.sampled_from([0, 0.4, -1.25, "1/3", "L", "-L/2"])
    joints: list[dict[str, Any]] = []
    for k in range(draw(st.integers(1, 4))):
        row = {"gamma": angles, "alpha": angles, "b": lengths, "d": lengths}
        origin = {
            "xyz": st.lists(lengths, min_size=3, max_size=3),
            "rpy": st.lists(angles, min_size=3, max_size=3),
        }
        place = draw(st.sampled_from([row, origin])) | {"theta": angles, "r": lengths}
        kind = draw(st.sampled_from(["revolute", "prismatic", "fixed"] if k else ["revolute", "prismatic"]))
        drive = {
            "viscous": st.booleans(),
            "friction": st.just("asymmetric"),
            "gear": st.just(-50),
            "gain": st.booleans(),
            "stiffness": st.just(True),
        }
        more = {} if kind == "fixed" else drive
        joint = draw(st.fixed_dictionaries({}, optional=place | more | {"massless": st.booleans()}))
        parent = draw(st.sampled_from(["base", *(one["name"] for one in joints)]))
        joints.append({"name": f"j{k}", "type": kind, "parent": parent, **joint})
    document: dict[str, Any] = {"arm": {"name": "arm"}, "joints": joints}
    if any("L" in str(joint) for joint in joints):
        document["lengths"] = {"L": draw(st.sampled_from([0.5, "symbolic"]))}
    moving = [joint["name"] for joint in joints if joint["type"] != "fixed"]
    sensors = st.tuples(
        st.sampled_from(moving),
        st.sampled_from(["motor", "link"]),
        st.sampled_from(["position", "velocity", "torque"]),
    )
    chosen = draw(st.lists(sensors, max_size=6, unique=True))
    if chosen:
        document["sensors"] = {"few": {f"s{k}": _sensor(*one) for k, one in enumerate(chosen)}}
    return document


def _sensor(joint: str, side: str, measures: str) -> dict[str, str]:
    named = {"joint": joint, "measures": measures}
    return named if measures == "torque" else {**named, "side": side}


@pytest.mark.slow
@settings(FUZZ, max_examples=1000 if NIGHTLY else 40)
@given(good_documents())
def test_good_arms_are_shown_and_drawn(document: dict[str, Any]) -> None:
    assert explained(document_text(document))


@pytest.mark.slow
@FUZZ
@given(DOCUMENT)
def test_any_tables(document: dict[str, Any]) -> None:
    explained(document_text(document))


@pytest.mark.slow
@FUZZ
@given(st.integers(0, 20), st.data())
def test_a_urdf_with_one_piece_replaced(seed: int, data: st.DataObject) -> None:
    text = random_urdf(seed, joints=3)
    start = data.draw(st.integers(0, len(text)))
    piece = data.draw(
        st.text(max_size=5) | MARKS | st.sampled_from(["1e400", "nan", "<", "&a;", "/>", "xyz"])
    )
    changed = text[:start] + piece + text[start + data.draw(st.integers(0, 20)) :]
    described, problems = described_arm(changed, "arm.urdf", ())
    assert isinstance(described, Described)
    if problems:
        check_lines(SpecError(*problems))
        assert all(problem.where.startswith("arm.urdf") for problem in problems)
