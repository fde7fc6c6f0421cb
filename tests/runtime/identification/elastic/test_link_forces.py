"""Links of other lengths, an arm that is mounted crooked and a load in one record are named and held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from modelgen import Record, identify
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.elastic.channel_errors import SetRight
from modelgen.runtime.identification.elastic.link_forces import LinksInMotion, link_forces
from modelgen.runtime.model.arm_functions import base_factors
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.derived_channels import with_derived
from modelgen.runtime.rows.record_rows import unmasked_rows
from modelgen.runtime.rows.row_terms import mismatch_terms
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.runtime.identification.elastic.test_channels_set_right import FS, noisy, told
from tests.symbolic.arms.elastic_arms import (
    PLANAR,
    SPATIAL,
    elastic,
    exact_record,
    readings,
    values_of,
    with_sensors,
)
from tests.symbolic.arms.made_arms import serial


def sensed(spec: ArmSpec, sides: tuple[str, ...] = ("motor", "link")) -> ArmSpec:
    joints = [joint.name for joint in spec.moving]
    return with_sensors(elastic(spec), *((one, side, "position") for side in sides for one in joints))


def model_of(spec: ArmSpec) -> Model:
    return model_from_text(arm_module(arm_base_model(arm_rows(spec, sensor_set="s"))), "elastic")


def record_of(spec: ArmSpec, values: dict[str, float], seed: int = 3, name: str = "arm") -> Record:
    times = np.arange(0.0, 8.0, 1.0 / FS)
    motion, forces = exact_record(spec, values, times, np.random.default_rng(seed), tempo=2.0)
    signals = readings(spec, motion, forces, "s")
    return Record(noisy({key: signals[key] for key in model_of(spec).channels}, 1.0), FS, name)


def held(estimate: Estimate, made: Model, values: dict[str, float]) -> np.ndarray:
    """Return how far each parameter is off in stated deviations, of the arm that was there, (parameters,)."""
    truth = made.base_from_physical({name: values[name] for name in made.parameters})
    by_name = dict(zip(made.base_parameters, truth.tolist(), strict=True))
    found = estimate.params
    return np.array([(found[name] - by_name[name]) / estimate.bse[name] for name in found if name in by_name])


def test_a_link_that_is_longer_is_named_and_held() -> None:
    longer = [PLANAR[0], (0, Fraction("0.505"), 0, 0)]
    file, there = sensed(serial(PLANAR, drive=True)), sensed(serial(longer, drive=True))
    values = values_of(there, np.random.default_rng(3))
    estimate = identify(model_of(file), record_of(there, values))
    (said,) = told(estimate)
    assert "joint 2 is off along x of the frame of joint 1 by +5.0" in said or "by +4.9" in said
    assert np.max(np.abs(held(estimate, model_of(there), values))) < 3.5


def test_an_arm_that_is_mounted_crooked_is_named_and_held() -> None:
    crooked = (Fraction("0.24"), Fraction("-0.12"), Fraction("-9.806"))
    file = sensed(serial(PLANAR, drive=True))
    there = sensed(serial(PLANAR, drive=True, gravity=crooked))
    values = values_of(there, np.random.default_rng(3))
    estimate = identify(model_of(file), record_of(there, values))
    assert any("mounted crooked" in said for said in told(estimate))
    # gravity along its first axis shows the file's arm what a tilted one bends
    assert np.max(np.abs(held(estimate, model_of(file), values))) < 3.5


def test_a_load_in_one_of_two_records_is_named_once_and_held() -> None:
    spec = sensed(serial(PLANAR, drive=True))
    values = values_of(spec, np.random.default_rng(3))
    loaded = values | {
        "m2": values["m2"] + 0.5,
        "mx2": values["mx2"] + 0.1,
        "Izz2": values["Izz2"] + 0.05,
    }
    records = [record_of(spec, values), record_of(spec, loaded, 4, "loaded")]
    model = model_of(spec)
    estimate = identify(model, records)
    (said,) = [one for one in told(estimate) if "load" in one]
    assert "link 2 carries another load in record 2 than in record 1" in said
    assert np.max(np.abs(held(estimate, model, values))) < 3.5


def test_links_that_no_sensor_sees_move_where_springs_put_them() -> None:
    spec = sensed(serial(PLANAR, drive=True), ("motor",))
    values, model = values_of(spec, np.random.default_rng(3)), model_of(spec)
    times = np.arange(0.0, 4.0, 1.0 / FS)
    motion, forces = exact_record(spec, values, times, np.random.default_rng(3), tempo=2.0)
    signals = readings(spec, motion, forces, "s")
    (record,) = with_derived(model, [Record({key: signals[key] for key in model.channels}, FS, "arm")])
    choice = choose_filter(model, [record])
    point = model.base_from_physical({name: values[name] for name in model.parameters})
    assert isinstance(model.kernel, DeflectedKernel)
    about = replace(model, kernel=model.kernel.at(point))
    rows = unmasked_rows(about, record, choice, choice.decimation[0])
    found = LinksInMotion(rows, record, 0, point).motion
    inside = slice(500, -500)
    for order, share in enumerate((1e-4, 1e-3, 1e-2)):
        for place, joint in enumerate(("1", "2")):
            true = motion[joint, order][inside]
            assert np.std(found[order, place, inside] - true) < share * np.std(true)


def test_motors_do_not_feel_links_through_springs_whose_torques_are_measured() -> None:
    # link encoders and joint torques: motors are where readings put them, whatever links need
    def measured(rows: Sequence[tuple[object, ...]]) -> ArmSpec:
        ways = (("link", "position"), ("between", "torque"))
        sensors = ((joint, *way) for way in ways for joint in ("1", "2"))
        return with_sensors(elastic(serial(rows, drive=True)), *sensors)

    file = measured(PLANAR)
    there = measured([PLANAR[0], (0, Fraction("0.505"), 0, 0)])
    values, model = values_of(file, np.random.default_rng(3)), model_of(file)
    point = model.base_from_physical({name: values[name] for name in model.parameters})
    # the smallest links that give these base parameters: what others need besides is a sum of columns
    factors, known = base_factors(model.base_from_physical, model.parameters)
    smallest = np.linalg.lstsq(factors, point - known, rcond=None)[0]
    values |= dict(zip(model.parameters, smallest.tolist(), strict=True))
    times = np.arange(0.0, 4.0, 1.0 / FS)
    motion, forces = exact_record(there, values, times, np.random.default_rng(3), tempo=2.0)
    signals = readings(there, motion, forces, "s")
    (record,) = with_derived(model, [Record({key: signals[key] for key in model.channels}, FS, "arm")])
    choice = choose_filter(model, [record])
    assert isinstance(model.kernel, DeflectedKernel)
    kernel = replace(model.kernel.at(point), rows=())
    rows = unmasked_rows(replace(model, kernel=kernel), record, choice, choice.decimation[0])
    slopes = {*model.kernel.keys} - {*kernel.keys}
    every = mismatch_terms(model, point)
    left = rows.mixed([{key: one for key, one in terms.items() if key not in slopes} for terms in every])
    (longer,) = [one for one in link_forces(model, 1) if one.name == "offset of joint 2 along x"]
    found = 0.005 * LinksInMotion(rows, record, 0, point).grown(longer)
    assert [row.name for row in model.rows if np.any(found[model.rows.index(row)])] == ["1 link", "2 link"]
    inside = slice(50, -50)
    assert np.max(np.abs((left - found)[:, inside])) < 0.03 * np.max(np.abs(left[:, inside]))


def test_what_may_be_off_in_links_is_in_the_file() -> None:
    names = [one.name for one in link_forces(model_of(sensed(serial(SPATIAL, drive=True))), 1)]
    # where an arm stands changes nothing
    assert [name for name in names if name.startswith("offset")] == [
        "offset of joint 2 along y",
        "offset of joint 3 along x",
        "offset of joint 3 along z",
    ]
    # of a vertical axis no row holds what gravity pulls at
    assert {"gravity across, mx1", "gravity across, my1"} <= {*names}
    rigid = replace(sensed(serial(PLANAR, drive=True)), gravity=(Fraction(0), Fraction(0), Fraction(0)))
    assert not [one for one in link_forces(model_of(rigid), 1) if "gravity" in one.name]


def test_beside_accelerometers_only_loads_are_looked_for() -> None:
    """They read other lengths and gravity themselves; a load was averaged, 118 deviations off."""
    motors = [(one, "motor", "position") for one in "12"]
    felt = with_sensors(
        elastic(serial(PLANAR, drive=True)), *motors, *((one, "link", "accelerometer") for one in "12")
    )
    names = [one.name for one in link_forces(model_of(felt), 2)]
    assert names
    assert all("of the load in record 2" in name for name in names)


@pytest.mark.parametrize("measured", ["link velocity", "motor velocity"])
def test_links_may_be_off_whatever_reads_them(measured: str) -> None:
    # the motor of joint 2 is in no row; a tachometer stands in for the derivative of an encoder
    side, measures = measured.split()
    sensors = [("1", "motor", "position"), ("1", side, measures), ("2", "link", "position")]
    spec = with_sensors(elastic(serial(PLANAR, drive=True)), *sensors)
    values = values_of(spec, np.random.default_rng(3))
    estimate = identify(model_of(spec), record_of(spec, values))
    assert "K2" in estimate.not_identifiable
    assert np.max(np.abs(held(estimate, model_of(spec), values))) < 3.5


def test_what_several_effects_say_is_said_once_with_the_size_of_all() -> None:
    tilts = [
        one for one in link_forces(model_of(sensed(serial(PLANAR, drive=True))), 1) if one.kind == "tilt"
    ]
    right = SetRight(("K1",), tuple(tilts), (0.03, 0.04), np.zeros((1, 2)), np.zeros((2, 2)))
    (said,) = right.advice
    assert "by 2.9 deg" in said.what
