"""Arms with springs in their joints go the way of rigid ones: the truth without noise, honest with it."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from modelgen import CheckOptions, Filters, identify, load_model, simulate
from modelgen.array_types import FloatArray
from modelgen.cli.arms.simulate_arm import arm_model, mounted
from modelgen.errors import IdentifiabilityError
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.diagnostics.row_noise import row_noise
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.elastic.likely_places import _told_by_readings
from modelgen.runtime.identification.job import Job
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.derived_channels import with_derived
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.simulation.arms.arm_plant import arm_plant
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.mounted_sensors import sensor_channels
from modelgen.spec.arms.arm import Angle, ArmSensor, ArmSpec, Length, Shift, Turn
from modelgen.spec.arms.parameters import mounting_values
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.elastic_arms import (
    Motion,
    exact_record,
    geared,
    readings,
    spatial,
    two_link,
    values_of,
    with_sensors,
)
from tests.symbolic.arms.made_arms import arm, joint
from tests.symbolic.arms.test_elastic_rows import SETS, both

MOUNTING = (Shift(0, Length(Fraction(1, 4))), Turn(2, Angle(Fraction(3, 5), Fraction(4, 5), 0.9273)))


def felt(spec: ArmSpec, *links: str, gyro: bool = False, unknown: bool = False) -> ArmSpec:
    """Return the arm with encoders at its motors and accelerometers on links, and gyros if asked for.

    `unknown` are mountings that are to be found.
    """
    motors = [ArmSensor(f"qm_{joint.name}", joint.name, "motor", "position") for joint in spec.moving]
    made = [ArmSensor(f"a_{name}", name, "link", "accelerometer", MOUNTING) for name in links]
    made += [ArmSensor(f"g_{name}", name, "link", "gyro", MOUNTING) for name in links if gyro]
    tilted = (*MOUNTING, *(Turn(axis, MOUNTING[1].angle) for axis in (0, 1)))
    made = [replace(one, mounting=tilted, estimated=True) for one in made] if unknown else made
    return replace(spec, sensor_sets={**spec.sensor_sets, "s": (*motors, *made)})


GENERATED = Path(__file__).resolve().parents[3] / "generated"
QUICK = CheckOptions(tests=False)
FS = 1000.0
NOISE = {"rad": 5e-6, "rad/s": 5e-5, "rad/s^2": 1e-1, "m/s^2": 1e-2, "N m": 0.1}
CASES = {
    **SETS,
    # no sensor sees where links are: their springs say it
    "motors alone": (with_sensors(two_link(), *both()), "s", 16),
    "motors alone, gears": (geared(with_sensors(two_link(), *both())), "s", 19),
    "motors alone, spatial": (with_sensors(spatial(), *both(names="123")), "s", 30),
    "torques at motors": (geared(with_sensors(two_link(), *both(), *both("between", "torque"))), "s", 19),
    # no sensor sees where motors are: what links need, over the stiffness, says it
    "links alone": (with_sensors(two_link(), *both("link")), "s", 16),
    "links alone, gears": (geared(with_sensors(two_link(), *both("link"))), "s", 19),
    "links alone, spatial": (with_sensors(spatial(), *both("link", names="123")), "s", 30),
    "links alone, six joints": (with_sensors(SETS["six joints"][0], *both("link", names="123456")), "s", 66),
    "torques at links": (with_sensors(two_link(), *both("link"), *both("between", "torque")), "s", 16),
    # what links feel says how they move, each axis in a row of its own
    "gyro and accelerometer of the last link": (felt(geared(two_link()), "2", gyro=True), "s", 19),
    "accelerometers, spatial": (felt(spatial(), "1", "2", "3"), "s", 30),
    "mounting unknown": (felt(two_link(), "2", gyro=True, unknown=True), "s", 31),
    "accelerations of links": (
        with_sensors(two_link(), *both(), *both("link", "acceleration")),
        "s",
        16,
    ),
    "accelerations across springs": (
        with_sensors(two_link(), *both(), *both("deflection", "acceleration")),
        "s",
        16,
    ),
    "speeds of links": (with_sensors(two_link(), *both(), *both("link", "velocity")), "s", 16),
}
SLOW = (
    "motors alone",
    "motors alone, gears",
    "links alone, gears",
    "torques at motors",
    "six joints",
    "links alone, six joints",
    "motors alone, spatial",
    "links alone, spatial",
    "accelerometers, spatial",
    "gyro and accelerometer of the last link",
    "mounting unknown",
    "accelerations of links",
    "accelerations across springs",
    "speeds of links",
)
SECONDS = {
    **dict.fromkeys(("mounting unknown", "accelerations of links", "accelerations across springs"), 4.0),
    "speeds of links": 6.0,
    "links alone, six joints": 3.0,
    "accelerometers, spatial": 3.0,
}


@lru_cache(maxsize=16)
def made(case: str, seconds: float = 12.0) -> tuple[Model, Record, dict[str, float]]:
    """Return a model, a record without noise, and the base parameters that it was made with."""
    spec, sensor_set, _ = CASES[case]
    rng = np.random.default_rng(1)
    model = model_from_text(arm_module(arm_base_model(arm_rows(spec, sensor_set=sensor_set))), "elastic")
    values = values_of(spec, rng)
    values |= mounting_values(spec, spec.sensor_sets[sensor_set])
    motion, forces = exact_record(spec, values, np.arange(0.0, seconds, 1.0 / FS), rng)
    signals = readings(spec, motion, forces, sensor_set) | felt_along(spec, values, motion, sensor_set)
    base = model.base_from_physical({name: values[name] for name in model.parameters})
    truth = dict(zip(model.base_parameters, base.tolist(), strict=True))
    return model, Record({key: signals[key] for key in model.channels}, FS, "arm"), truth


def felt_along(
    spec: ArmSpec, values: dict[str, float], motion: Motion, sensor_set: str
) -> dict[str, FloatArray]:
    """Return what gyros and accelerometers read."""
    sensors = [one for one in mounted(spec, sensor_set) if one.way]
    if not sensors:
        return {}
    model = arm_model(spec)
    plant = arm_plant(model, model.base_from_physical({name: values[name] for name in model.parameters}))
    q, v, a = (np.array([motion[name, k] for name in plant.coordinates.names]) for k in range(3))
    return sensor_channels(plant, sensors, JointMotion(q, v, a, FS))


def noisy(model: Model, record: Record, seed: int) -> Record:
    rng = np.random.default_rng(seed)
    units = {one.key: one.unit for one in (*model.sensors, *model.actuators)}
    return record.edited(
        {key: record.signals[key] + NOISE[units[key]] * rng.standard_normal(record.n) for key in record.keys}
    )


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(c, marks=pytest.mark.slow(begins="first") if "six" in c else pytest.mark.slow)
        if c in SLOW
        else c
        for c in CASES
    ],
)
def test_sensor_sets_without_noise_give_the_truth(case: str) -> None:
    model, record, truth = made(case, SECONDS.get(case, 12.0))
    found = identify(model, record, "wls", checks=QUICK).params
    assert list(found) == list(truth)
    worst = max(abs(found[name] / value - 1.0) for name, value in truth.items())
    assert worst < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("case", ["speeds of links", "accelerations of links"])
@pytest.mark.parametrize("share", [0.2, 1.0, 100.0])
def test_speeds_of_links_tell_springs_before_links_are_known(case: str, share: float) -> None:
    """From springs of a file, too, steps of all rows had led to where one is rigid."""
    model, record, truth = made(case, SECONDS[case])
    springs = [model.base_parameters.index(name) for name in ("K1", "K2")]
    kernel, records = model.kernel, (noisy(model, record, 1),)
    assert isinstance(kernel, DeflectedKernel)
    start = np.zeros(len(model.base_parameters))
    start[springs] = [share * truth["K1"], share * truth["K2"]]
    told = _told_by_readings(Job(model, records, choose_filter(model, records)), kernel, [start])
    assert told is not None
    assert told[springs] == pytest.approx([truth["K1"], truth["K2"]], rel=1e-2)


def test_chunks_memory_and_stretches_change_nothing() -> None:
    model, record, _ = made("gears and a coupling")
    record = noisy(model, record, 3)
    assert model.derived  # encoders in front of gears
    whole = identify(model, record, "wls", checks=QUICK)
    remade = identify(model, record, "wls", Filters(memory_limit_mb=0.02), QUICK)
    read = identify(model, Record.over(record), "wls", checks=QUICK)
    for name, value in whole.params.items():
        for other in (remade, read):
            assert abs(other.params[name] - value) < 1e-6 * whole.bse[name]


@pytest.mark.slow
@pytest.mark.parametrize("case", ["two encoders", "torques"])
def test_intervals_with_noise_are_honest(case: str) -> None:
    model, record, truth = made(case)
    estimates = [identify(model, noisy(model, record, seed), "wls", checks=QUICK) for seed in range(30)]
    errors = np.array([[e.params[n] - v for n, v in truth.items()] for e in estimates])
    stated = np.array([[e.bse[n] for n in truth] for e in estimates])
    inside = np.mean(np.abs(errors) < 1.96 * stated)
    ratio = np.sqrt(np.mean(stated**2, axis=0)) / np.std(errors, axis=0)
    bias = np.abs(errors.mean(axis=0)) / np.std(errors, axis=0)
    assert 0.88 < inside <= 1.0
    assert 0.75 < np.median(ratio) < 1.4
    # K multiplies the deflection, which is small, but large against its noise
    springs = [k for k, name in enumerate(truth) if name.startswith("K")]
    assert max(np.std(errors, axis=0)[k] / truth[f"K{n}"] for n, k in enumerate(springs, start=1)) < 1e-4
    assert np.all(bias < 4.0 / np.sqrt(len(errors)))


def test_one_elastic_joint_without_gravity_is_the_chain_of_the_paper() -> None:
    chain = load_model(GENERATED / "emps300_qm_qc.py")
    named = {
        "stiffness": "K",
        "damping": "F_vmc",
        "rotor_inertia": "J_m",
        "viscous": "F_vm",
        "coulomb": "F_sm",
    }
    spec = arm([joint("1", None, (), **named)], gravity=(Fraction(0),) * 3)
    encoders = (ArmSensor("q_m", "1", "motor", "position"), ArmSensor("q_c", "1", "link", "position"))
    spec = replace(spec, sensor_sets={"s": encoders})
    model = model_from_text(arm_module(arm_base_model(arm_rows(spec, sensor_set="s"))), "arm")
    noise = {"q_m": 1e-5, "q_c": 1e-5, "Gamma_m": 1e-4}
    record = simulate(chain, chain.parameter_sets["light"], "chirp", noise=noise, seed=1).record
    signals = {{"Gamma_m": "tau_1"}.get(key, key): record.signals[key] for key in record.keys}
    filters = Filters(cutoff_hz=60.0, decimation=10, direction_cutoff_hz=60.0)
    wanted = identify(chain, record, "wls", filters, QUICK)
    found = identify(model, Record(signals, record.fs, record.name), "wls", filters, QUICK)
    names = [{"J_c": "Izz1"}.get(name, name) for name in wanted.params]
    for ours, theirs in ((found.params, wanted.params), (found.bse, wanted.bse)):
        assert [ours[name] for name in names] == pytest.approx([*theirs.values()], rel=1e-9)


def turning(
    truth: dict[str, float], sizes: dict[float, float], seconds: float, *sides: Literal["link", "motor"]
) -> tuple[Model, dict[str, FloatArray]]:
    """Return one elastic joint without gravity, and its signals: it turns by tones of those sizes (Hz, rad).

    The motor is ahead of its link by what stiffness and damping let through.
    """
    named = {"stiffness": "K", "damping": "D", "rotor_inertia": "J", "viscous": "F"}
    spec = arm([joint("1", None, (), **named)], gravity=(Fraction(0),) * 3)
    spec = replace(spec, sensor_sets={"s": tuple(ArmSensor(side, "1", side, "position") for side in sides)})
    model = model_from_text(arm_module(arm_base_model(arm_rows(spec, sensor_set="s"))), "arm")
    t = np.arange(0.0, seconds, 1.0 / FS)
    signals = {key: np.zeros(len(t)) for key in ("link", "motor", "tau_1")}
    for f_hz, size in sizes.items():
        s = 2j * np.pi * f_hz
        torque = truth["Izz1"] * s**2
        motor = 1.0 + torque / (truth["K"] + truth["D"] * s)
        force = (truth["J"] * s**2 + truth["F"] * s) * motor + torque
        for key, gain in (("link", 1.0), ("motor", motor), ("tau_1", force)):
            signals[key] += size * np.real(gain * np.exp(s * t + 1j * f_hz))
    return model, {key: signals[key] for key in (*sides, "tau_1")}


@pytest.mark.parametrize(("side", "damping"), [("link", 1.5), ("motor", 1.5), ("motor", 10.0)])
def test_damping_of_springs_that_place_is_exact(side: Literal["link", "motor"], damping: float) -> None:
    """At 12 Hz the last damper has three quarters of its spring's part."""
    truth = {"Izz1": 0.3, "J": 0.2, "F": 1.0, "K": 1000.0, "D": damping}
    model, signals = turning(truth, {1.0: 0.3, 5.0: 0.1, 12.0: 0.01}, 6.0, side)
    found = identify(model, Record(signals, FS, "tones"), "wls", checks=QUICK).params
    assert [found[name] for name in truth] == pytest.approx([*truth.values()], rel=1e-3)


def slow_joint(K: float, sizes: dict[float, float], seconds: float, noise: float, seed: int) -> None:
    """Identify a slow elastic joint whose deflection is less than the noise of its encoders (rad)."""
    truth = {"Izz1": 0.3, "J": 0.2, "F": 1.0, "K": K, "D": 4.0}
    model, signals = turning(truth, sizes, seconds, "motor", "link")
    rng, level = np.random.default_rng(seed), {"motor": noise, "link": noise, "tau_1": 0.1}
    read = {key: line + level[key] * rng.standard_normal(len(line)) for key, line in signals.items()}
    identify(model, Record(read, FS, "slow"))


def test_a_link_whose_motion_noise_hides_has_no_stiffness() -> None:
    """Zero solves its row, which holds no force: K had been -0.2 +- 72, and J that of both bodies."""
    with pytest.raises(IdentifiabilityError, match="row 1 link has no force, and zero solves it") as told:
        slow_joint(8000.0, {0.1: 0.3, 0.23: 0.2}, 20.0, 1e-5, 1)
    assert "J, F: takes over what is lost" in str(told.value)


@pytest.mark.parametrize(
    ("stiffness", "sizes", "seconds", "noise", "seed"),
    [
        # noise had left nothing, so that all was kept: K = 103 +- 120, and J = 0.495 +- 0.003, that of both
        (12000.0, {0.2: 0.3, 0.5: 0.1}, 12.0, 1e-4, 0),
        # K was refused once other cut-offs had moved it, and J = 0.502 +- 0.006 stayed
        (8000.0, {0.1: 0.3, 0.23: 0.2}, 20.0, 2e-5, 1),
        (16000.0, {0.4: 0.3, 1.0: 0.1}, 16.0, 5e-5, 5),
    ],
)
def test_what_other_rows_take_over_is_refused_late_as_well(
    stiffness: float, sizes: dict[float, float], seconds: float, noise: float, seed: int
) -> None:
    with pytest.raises(IdentifiabilityError):
        slow_joint(stiffness, sizes, seconds, noise, seed)


def test_a_spring_that_is_known_leaves_the_rest() -> None:
    spec, sensor_set, _ = CASES["two encoders"]
    _, record, truth = made("two encoders")
    held = replace(spec, known={"K1": truth["K1"]})
    held_model = model_from_text(arm_module(arm_base_model(arm_rows(held, sensor_set=sensor_set))), "held")
    found = identify(held_model, record, "wls", checks=QUICK).params
    assert "K1" not in found
    assert all(found[name] == pytest.approx(truth[name], rel=1e-3) for name in found)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["motors alone", "torques at motors", "links alone"])
def test_what_springs_place_is_honest_about_noise(case: str) -> None:
    """Encoders' noise is differentiated four times: the intervals know of its bias, or there is no number."""
    model, record, truth = made(case)
    estimates = [identify(model, noisy(model, record, seed)) for seed in range(2)]
    errors = [(e.params[n] - truth[n]) / e.bse[n] for e in estimates for n in e.params]
    assert np.mean(np.abs(errors) < 1.96) > 0.88
    assert np.sqrt(np.mean(np.square(errors))) < 1.3


@pytest.mark.slow
def test_slow_motion_gives_no_stiffness_from_motors_alone() -> None:
    model, record, truth = made("motors alone, gears")
    found = identify(model, noisy(model, record, 1))
    named = [name for name in truth if name not in found.params]
    assert {"K1", "K2"} & {*named}
    assert all(abs(value - truth[name]) < 3.0 * found.bse[name] for name, value in found.params.items())


@pytest.mark.slow
def test_slow_motion_tells_a_spring_at_a_higher_cutoff() -> None:
    """At 4.3 Hz no stiffness led to an estimate: it had been refused; a cut-off that is given stays."""
    truth = {"Izz1": 0.3, "J": 0.2, "F": 1.0, "K": 1000.0, "D": 1.5}
    model, signals = turning(truth, {0.3: 0.4, 0.7: 0.2}, 10.0, "link")
    rng, level = np.random.default_rng(1), {"link": 1e-6, "tau_1": 0.01}
    read = {key: line + level[key] * rng.standard_normal(len(line)) for key, line in signals.items()}
    record = Record(read, FS, "slow")
    found = identify(model, record, checks=QUICK)
    assert found.params["K"] == pytest.approx(truth["K"], abs=2.0 * found.bse["K"])
    assert 0.0 < found.bse["K"] < 0.15 * truth["K"]
    said = [one for one in found.fit.filtering.sentences if one.startswith("Cut-off")]
    assert len(said) == 1 and said[0].endswith("at which the records do not tell how far springs deflect.")
    with pytest.raises(IdentifiabilityError, match="how far the springs deflect"):
        identify(model, record, filters=Filters(cutoff_hz=4.3), checks=QUICK)


@pytest.mark.slow
def test_links_are_found_where_springs_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """Torques behind the springs: rows of links need no deflection."""
    model, record, truth = made("torques at links")
    record = noisy(model, record, 2)
    for steps in ("elastic.rest", "elastic.steps_about"):
        monkeypatch.setattr(f"modelgen.runtime.identification.{steps}.MOST_STEPS", 0)
    found = identify(model, record, "wls", checks=QUICK)
    links = [name for name in truth if name[:2] in ("Iz", "mx", "my")]
    assert [*found.params] == links
    assert all(abs(found.params[name] - truth[name]) < 3.0 * found.bse[name] for name in links)
    assert "needs how far the springs deflect" in found.not_identifiable["K1"]
    alone, record, _ = made("links alone")
    with pytest.raises(IdentifiabilityError, match="how far the springs deflect"):
        identify(alone, noisy(alone, record, 2), "wls", checks=QUICK)


def test_steps_are_linear_about_the_point_to_second_order() -> None:
    """Rows about two points agree with their derivatives: slopes are those of what the rows hold."""
    model, record, truth = made("motors alone")
    kernel = model.kernel
    assert isinstance(kernel, DeflectedKernel)
    point = np.array([*truth.values()])
    part = record.part(3000, 6000, "part")
    choice = choose_filter(model, [record])
    rng = np.random.default_rng(0)
    step = 1e-4 * point * rng.choice([-1.0, 1.0], len(point))

    def held(at: np.ndarray) -> np.ndarray:
        """What the rows hold at a point that they are linear about: the left side less what is left."""
        about = replace(model, kernel=kernel.at(at))
        blocks = observe(about, [part], choice).blocks
        return np.concatenate([b.dense(len(at)).W @ at - b.Y for b in blocks])

    about = replace(model, kernel=kernel.at(point))
    slopes = np.concatenate([b.dense(len(point)).W for b in observe(about, [part], choice).blocks])
    wanted = (held(point + step) - held(point - step)) / 2.0
    np.testing.assert_allclose(slopes @ step, wanted, atol=1e-5 * np.abs(wanted).max())


@pytest.mark.parametrize(
    "case",
    ["torques", "motors alone, gears", "links alone, gears", "gyro and accelerometer of the last link"],
)
def test_the_noise_that_rows_are_expected_to_hold_is_what_they_hold(case: str) -> None:
    model, record, truth = made(case)
    x = np.array([*truth.values()])
    if isinstance(model.kernel, DeflectedKernel):
        model = replace(model, kernel=model.kernel.at(x))
    clean, loud = with_derived(model, [record, noisy(model, record, 1)])
    choice = choose_filter(model, [clean])
    pairs = zip(*(observe(model, [one], choice).blocks for one in (clean, loud)), strict=True)
    for one, other in pairs:
        _, here, there = np.intersect1d(one.place, other.place, return_indices=True)
        before, after = one.dense(len(x)), other.dense(len(x))
        added = (after.Y - after.W @ x)[there] - (before.Y - before.W @ x)[here]
        expected = row_noise(model, loud, choice, choice.decimation[0], one.row, x)
        assert expected == pytest.approx(np.std(added), rel=0.2)
