"""Rows of elastic arms: proven by Lagrange, exact base parameters, and the truth from noise-free sensors."""

from __future__ import annotations

import random
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from modelgen.errors import ModelError, RenderError
from modelgen.generated_module.module_check import module_problems
from modelgen.render.arms.arm_writer import arm_module
from modelgen.spec.arms.arm import ArmSensor, ArmSpec
from modelgen.spec.arms.sensors import without_springs
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from modelgen.symbolic.arms.drives import coordinates, drives, motor_coordinate, speed_node
from modelgen.symbolic.arms.dynamics.inverse_dynamics import inverse_dynamics
from modelgen.symbolic.arms.dynamics.lagrange import newton_minus_lagrange, vanishes
from modelgen.symbolic.arms.expressions.evaluation import sampled
from modelgen.symbolic.arms.expressions.graph import Graph
from tests.symbolic.arms.elastic_arms import (
    SPATIAL,
    elastic,
    exact_record,
    geared,
    readings,
    spatial,
    two_link,
    values_of,
    with_sensors,
)
from tests.symbolic.arms.made_arms import PUMA, random_arm, serial
from tests.symbolic.arms.numerical_rank import numerical_rank
from tests.symbolic.arms.regressor_samples import regressor_at
from tests.symbolic.arms.test_base_parameters import coupled, reproduces

PARTS = ("damping", "stiffness3")


def random_elastic(seed: int, **kinds: float) -> ArmSpec:
    rng = random.Random(seed)
    spec = random_arm(rng, **kinds)  # type: ignore[arg-type]
    chosen = tuple(j.name for j in spec.moving if rng.random() < 0.7)
    spec = elastic(spec, chosen, **{part: rng.random() < 0.5 for part in PARTS})
    return coupled(rng, spec) if seed % 3 == 0 else spec


@pytest.mark.parametrize("seed", range(12))
def test_springs_by_newton_are_those_of_lagrange(seed: int) -> None:
    spec = random_elastic(seed)
    graph, differences = newton_minus_lagrange(spec)
    assert len(differences) == len(spec.moving) + sum(j.elastic for j in spec.moving)
    assert vanishes(graph, differences, [*spec.lengths])


@pytest.mark.parametrize("kind", ["joint", "motor"])
@pytest.mark.parametrize("seed", range(20))
def test_base_parameters_are_exact(seed: int, kind: str) -> None:
    spec = random_elastic(200 + seed)
    rows = arm_rows(spec, kind)  # type: ignore[arg-type]
    model = arm_base_model(rows)
    assert len(model.base) == numerical_rank(rows)
    reproduces(model, {})


def test_a_rotor_behind_a_spring_counts_by_itself() -> None:
    rigid, soft = serial(SPATIAL, True), spatial()
    regrouped = arm_base_model(arm_rows(rigid)).absent
    assert "only in combination" in regrouped["Ia1"] and "only in combination" in regrouped["Ia2"]
    model = arm_base_model(arm_rows(soft))
    assert {"Ia1", "Ia2", "Ia3", "K1", "K2", "K3"} <= {*model.identifiable}
    # a torque sensor in front of the link does the same for a rigid joint
    sensed = with_sensors(rigid, *[(n, "link", "position") for n in "123"], ("2", "between", "torque"))
    alone = arm_base_model(arm_rows(sensed, sensor_set="s")).identifiable
    assert "Ia2" in alone and "Ia1" not in alone


def both(side: str = "motor", measures: str = "position", names: str = "12") -> list[tuple[str, str, str]]:
    return [(name, side, measures) for name in names]


KNOWN = {"m2": 1.5, "K1": 1200.0, "Ia2": 0.4}
SETS = {
    "two encoders": (two_link(), "encoders", 16),
    "two encoders, spatial": (spatial(), "encoders", 30),
    "gears and a coupling": (geared(spatial()), "encoders", 33),
    "one elastic joint among rigid ones": (geared(elastic(serial(SPATIAL, True), ("2",))), "encoders", 30),
    "six joints": (elastic(serial(PUMA, True)), "encoders", 66),
    "known parameters": (replace(geared(two_link()), known=KNOWN), "encoders", 17),
    "deflections": (geared(with_sensors(two_link(), *both(), *both("deflection"))), "s", 19),
    "speeds of motors": (
        geared(with_sensors(two_link(), *both(), *both("motor", "velocity"), *both("link"))), "s", 19),
    "torques": (
        geared(with_sensors(two_link(), *both(), *both("between", "torque"), *both("link"))), "s", 19),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", SETS)
def test_noise_free_sensors_give_the_truth(case: str) -> None:
    spec, sensor_set, count = SETS[case]
    rng = np.random.default_rng(1)
    model = arm_base_model(arm_rows(spec, sensor_set=sensor_set))
    text = arm_module(model)
    assert module_problems(text) == []
    module: dict[str, object] = {}
    exec(compile(text, "module", "exec"), module)
    values = values_of(spec, rng)
    motion, forces = exact_record(spec, values, np.linspace(0.0, 8.0, 1500), rng)
    signals = readings(spec, motion, forces, sensor_set)
    regressor = module["regressor"](signals).reshape(-1, count)  # type: ignore[operator]
    measured = module["measurement"](signals).ravel()  # type: ignore[operator]
    truth = module["base_from_physical"]({n: values[n] for n in module["PARAMETERS"]})  # type: ignore[operator, attr-defined]
    sizes = np.linalg.norm(regressor, axis=0)
    found, _, rank, _ = np.linalg.lstsq(regressor / sizes, measured, rcond=1e-12)
    assert rank == count
    np.testing.assert_allclose(found / sizes, truth, rtol=1e-7)


def gyros(spec: ArmSpec, mounting: tuple[object, ...] = ()) -> ArmSpec:
    made = tuple(ArmSensor(f"g_{n}", n, "link", "gyro", mounting) for n in "12")  # type: ignore[arg-type]
    motors = tuple(ArmSensor(f"qm_{n}", n, "motor", "position") for n in "12")
    return replace(spec, sensor_sets={"s": (*motors, *made)})


def test_gyros_on_links_that_springs_place_have_rows_of_their_own() -> None:
    rows = arm_rows(gyros(two_link()), sensor_set="s")
    # nothing is differentiated: friction would jump at every reversal
    assert rows.names == ("1", "2", "g_1 z", "g_2 z", "1 deflected", "2 deflected")
    assert not any(rows.differentiated)
    assert [tuple(one) for one in rows.estimated] == [("q_1", "1 deflected"), ("q_2", "2 deflected")]
    assert {"Ia1", "fv1", "fs1", "off1", "K1"} <= {*arm_base_model(rows).identifiable}


def test_gyros_in_front_of_and_behind_a_joint_that_is_seen_give_its_speed() -> None:
    spec = gyros(two_link())
    links = tuple(ArmSensor(f"q_{n}", n, "link", "position") for n in "12")
    rows = arm_rows(replace(spec, sensor_sets={"s": (*spec.sensor_sets["s"], *links)}), sensor_set="s")
    assert not rows.estimated
    reading = {
        symbol: found for symbol, found in rows.channels.items() if symbol.name == "2" and symbol.order == 1
    }
    # the speed of joint 2 is what both gyros differ by, along the axis
    assert {(key, factor) for (found,) in [reading.values()] for key, _, factor in found} == {
        ("g_2_z", 1),
        ("g_1_z", -1),
    }


def test_a_mounting_that_is_to_be_found_is_columns_of_its_sensor() -> None:
    spec = with_sensors(two_link(), *both())
    felt = ArmSensor("a", "2", "link", "accelerometer", estimated=True)
    spec = replace(spec, sensor_sets={"s": (*spec.sensor_sets["s"], felt)})
    rows = arm_rows(spec, sensor_set="s")
    assert rows.names == ("1", "2", "a x", "a y", "a z", "1 deflected", "2 deflected")
    base = arm_base_model(rows).base
    # in the plane an axis feels two accelerations, and two changes of them with the place on the link
    assert [one.name for one in base if "a_x" in one.name] == [
        "R_a_x_x",
        "R_a_x_y",
        "l_a_x_xx + l_a_x_yy",
        "l_a_x_xy - l_a_x_yx",
    ]


def test_encoders_on_links_alone_place_the_motors() -> None:
    rows = arm_rows(with_sensors(two_link(), *both("link")), sensor_set="s")
    assert rows.names == ("1", "2", "1 driven", "2 driven")
    assert [tuple(one) for one in rows.estimated] == [
        ("deflection_1", "1 driven"),
        ("deflection_2", "2 driven"),
    ]
    assert len(arm_base_model(rows).base) == 16 and not rows.lost
    # a cubic spring is not solved for its deflection
    arms = with_sensors(two_link(), *both("link"))
    cubic = replace(arms, joints=tuple(replace(j, stiffness3=f"K3{j.name}") for j in arms.joints))
    with pytest.raises(ModelError, match="the position of motor 1"):
        arm_rows(cubic, sensor_set="s")


@pytest.mark.parametrize("joints", [None, ("1",), ("2", "3")])
@pytest.mark.parametrize("sensors", [("motor position 1",), ("motor velocity 2",), ("link velocity 3",), ()])
def test_the_sensors_that_an_error_names_give_a_row(
    joints: tuple[str, ...] | None, sensors: tuple[str, ...]
) -> None:
    spec = elastic(serial(SPATIAL, True), joints, damping=True, stiffness3=True)
    named = [(joint, side, measures) for side, measures, joint in (one.split() for one in sensors)]
    spec = with_sensors(spec, *named)
    with pytest.raises(ModelError, match="give no row") as error:
        arm_rows(spec, sensor_set="s")
    remedy = error.value.problems[0].remedy
    tables = [tomllib.loads(one) for one in re.findall(r"\w+ = \{[^}]*\}", remedy)]
    added = [ArmSensor(key, **table) for one in tables for key, table in one.items()]
    assert added
    spec = replace(spec, sensor_sets={"s": (*spec.sensor_sets["s"], *added)})
    assert arm_rows(spec, sensor_set="s").names


def test_what_a_set_cannot_give_is_said_with_the_sensor_that_would() -> None:
    speeds = both("motor", "velocity")
    rates = both("link", "velocity")
    for sides, needs in ((speeds, "the position of link 1"), (rates, "motor 1 and the position of link 1")):
        with pytest.raises(ModelError) as error:
            arm_rows(with_sensors(two_link(), *sides), sensor_set="s")
        assert needs in str(error.value) and 'joint = "1", side = "' in str(error.value)
    # speeds on both sides: rows of springs, differentiated, and nothing of where the arm is
    rows = arm_rows(with_sensors(two_link(), *speeds, *both("link", "velocity")), sensor_set="s")
    assert rows.names == ("1 spring", "2 spring") and not rows.estimated
    assert "needs the positions of links 1, 2" in rows.lacking
    assert rows.lost["fs1"].startswith("constant between reversals")
    with pytest.raises(ModelError, match="has no sensor set 'x'"):
        arm_rows(two_link(), sensor_set="x")


def test_a_module_says_what_is_measured_and_slow_motion_needs_no_springs() -> None:
    with pytest.raises(RenderError, match="choose one of the sensor sets encoders"):
        arm_module(arm_base_model(arm_rows(two_link())))
    assert without_springs(spatial()) == serial(SPATIAL, drive=True)


@pytest.mark.parametrize("seed", range(8))
def test_rows_are_the_torques_of_motors_and_links(seed: int) -> None:
    """Springs with damping and cubic stiffness: what a motor exerts ends in its rotor and its spring."""
    spec = random_elastic(400 + seed)
    rows, rng = arm_rows(spec), np.random.default_rng(seed)
    motion = {(name, k): rng.standard_normal(5) for name in coordinates(spec) for k in (0, 1, 2)}
    values = {name: float(rng.uniform(0.5, 2.0)) for name in rows.columns}
    graph = Graph()
    torques = inverse_dynamics(graph, spec)
    speeds = {drive.speed_name: speed_node(graph, drive) for drive in drives(spec)}
    needed = dict(zip(torques, sampled(graph, [*torques.values()], motion, values, speeds).T, strict=True))
    regressor = regressor_at(rows, motion, {})
    found = dict(zip(rows.names, (regressor @ [values[name] for name in rows.columns]).T, strict=True))
    for moved in spec.moving:
        link = needed[moved.name]
        row = f"{moved.name} link" if moved.elastic else moved.name
        np.testing.assert_allclose(found[row], link, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(link).max()))
        if moved.elastic:
            np.testing.assert_allclose(
                found[f"{moved.name} spring"], needed[motor_coordinate(moved)], rtol=1e-9, atol=1e-9
            )
