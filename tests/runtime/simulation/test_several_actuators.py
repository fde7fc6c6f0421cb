"""Chains with several actuators: all forces drive the simulation, and the model simulated along a record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from functools import cache
from importlib.resources import files
from math import inf, pi
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from modelgen.cli.candidates import spec_model
from modelgen.cli.main import app
from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.iv.companion_simulation import Loop, run_beside
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.output_error import fit_response
from modelgen.runtime.iv.physical.starting_values import _felt_inertia
from modelgen.runtime.least_squares.time_shifts import shift
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.excitation import Excitation, excitation_from_record
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import record_with_reference, simulate
from modelgen.runtime.simulation.validate import validate
from modelgen.spec.load import parse_spec

FS = 5000.0
NOISE = {"q_a": 2e-5, "q_b": 2e-5, "q_c": 2e-5, "Gamma_a": 2e-4, "Gamma_c": 2e-4}
LATE = {"Gamma_a": 0.8e-4, "Gamma_c": 3.4e-4}
RECORDS = 6
# the catalogue's chain a - b - c with a second motor at its end, and with a sensor set that does not see b
THREE_MASS = files("modelgen").joinpath("catalog", "three_mass.toml").read_text(encoding="utf-8")
BOTH_ENDS = (
    THREE_MASS.replace('coulomb = "F_sc"', 'coulomb = "F_sc"\nactuator = "Gamma_c"')
    + """
[sensors.ends]
q_a = { body = "a", measures = "position" }
q_c = { body = "c", measures = "position" }
"""
)


def model_of(text: str, sensors: str) -> Model:
    return spec_model(parse_spec(text, "chain.toml"), sensors)


@cache
def both_ends(sensors: str) -> Model:
    return model_of(BOTH_ENDS, sensors)


ALL = both_ends("qa_qb_qc")
TRUTH = ALL.parameter_sets["nominal"]


def excitations(oversample: int = 8) -> tuple[Excitation, Excitation]:
    """The motor at a follows chirp and trapezoid, that at c pushes in its own way."""
    chirp, trapezoid = (
        default_excitation(kind, ALL, TRUTH, FS, duration_s=1.5, oversample=oversample)
        for kind in ("chirp", "trapezoid")
    )
    t = chirp.t
    swept = 0.4 * np.sin(2.0 * pi * (5.0 + 30.0 * t) * t) * np.minimum(1.0, t / 0.2)
    slow = 0.15 * np.sin(2.0 * pi * 1.1 * t) + 0.2 * np.sin(2.0 * pi * 7.3 * t)
    return replace(chirp, forces={"Gamma_c": swept}), replace(trapezoid, forces={"Gamma_c": slow})


@cache
def clean(sensors: str) -> tuple[Record, ...]:
    return tuple(simulate(both_ends(sensors), TRUTH, given, fs=FS).record for given in excitations())


def measured(sensors: str, seed: int, late: Mapping[str, float], share: float = 1.0) -> tuple[Record, ...]:
    """The clean records with noise, and forces that are logged late."""
    rng = np.random.default_rng(seed)
    return tuple(
        Record(
            {
                key: shift(key, -FS * late.get(key, 0.0)).whole(samples)
                + share * NOISE[key] * rng.standard_normal(record.n)
                for key, samples in record.signals.items()
            },
            record.fs,
            record.name,
        )
        for record in clean(sensors)
    )


def errors_of(estimate: Estimate) -> dict[str, float]:
    """Relative error of every physical parameter."""
    return {entry.name: entry.value / TRUTH[entry.name] - 1.0 for entry in estimate.parameters.physical}


@pytest.mark.slow
@pytest.mark.parametrize("bandwidth_hz", [inf, 150.0])
def test_two_driven_bodies_move_as_an_independent_integrator_says(bandwidth_hz: float) -> None:
    p, t = TRUTH, np.arange(2001) / 10000.0
    reference = 20.0 * t + 0.2 * (1.0 - np.cos(40.0 * t))
    rate, forward = 20.0 + 8.0 * np.sin(40.0 * t), 0.3 * np.sin(150.0 * t)
    pull = 0.5 * np.sin(260.0 * t + 1.0)
    loop = PositionVelocityController(3.0, 0.08)
    start = [0.0, 0.0, 0.0, 20.0, 20.0, 20.0]
    found = simulate(
        ALL,
        p,
        Excitation(reference, rate, forward, 10000.0, forces={"Gamma_c": pull}),
        fs=10000.0,
        controller=loop,
        drive=Drive(bandwidth_hz=bandwidth_hz),
        initial_state=start,
    )

    def motion(now: float, x: npt.NDArray[np.float64]) -> list[float]:
        (qa, qb, qc, va, vb, vc, force), at = x, lambda samples: float(np.interp(now, t, samples))
        wanted = loop.kp * (at(reference) - qa) + loop.kv * (at(rate) - va) + at(forward)
        lag = 2.0 * pi * bandwidth_hz * (wanted - force) if bandwidth_hz < inf else 0.0
        drive = force if bandwidth_hz < inf else wanted
        ab = p["K_ab"] * (qa - qb) + p["F_dab"] * (va - vb)
        bc = p["K_bc"] * (qb - qc) + p["F_dbc"] * (vb - vc)
        a = (drive - ab - p["F_va"] * va - p["F_sa"]) / p["J_a"]
        b = (ab - bc - p["F_vb"] * vb) / p["J_b"]
        c = (at(pull) + bc - p["F_vc"] * vc - p["F_sc"]) / p["J_c"]
        return [va, vb, vc, a, b, c, lag]

    expected = solve_ivp(
        motion, (0.0, t[-1]), [*start, 0.0], "DOP853", t, rtol=1e-9, atol=1e-11, max_step=1e-4
    ).y
    # nothing reverses: the friction of a and c is the constant that `motion` takes it for
    assert min(expected[3].min(), expected[5].min()) > 0.0
    assert found.changes == ()
    for key, row in (("q_a", 0), ("q_b", 1), ("q_c", 2), ("v_a", 3), ("v_b", 4), ("v_c", 5)):
        np.testing.assert_allclose(found.true[key], expected[row], atol=1e-7, rtol=1e-7)
    np.testing.assert_array_equal(found.true["Gamma_c"], pull)
    slopes = [motion(now, x) for now, x in zip(t, expected.T, strict=True)]
    for key, row in (("a_a", 3), ("a_b", 4), ("a_c", 5)):
        np.testing.assert_allclose(found.true[key], [slope[row] for slope in slopes], atol=2e-3)


def test_a_further_force_lets_a_body_slip_when_it_overcomes_friction() -> None:
    t = np.arange(4001) / 4000.0
    rest = Excitation(0.0 * t, 0.0 * t, 0.0 * t, 4000.0, forces={"Gamma_c": 0.1 * t})
    found = simulate(ALL, TRUTH, rest, fs=4000.0)
    first = found.changes[0]
    assert (first.body, first.mode) == ("c", 1)
    assert first.time_s == pytest.approx(TRUTH["F_sc"] / 0.1, abs=1e-9)
    assert np.all(found.true["q_c"][t < 0.3] == 0.0)


def test_a_force_that_rests_is_as_good_as_none() -> None:
    chirp = excitations()[0]
    resting = simulate(ALL, TRUTH, replace(chirp, forces={"Gamma_c": 0.0 * chirp.t}), fs=FS)
    none = simulate(ALL, TRUTH, replace(chirp, forces={}), fs=FS)
    for key, samples in none.true.items():
        np.testing.assert_array_equal(resting.true[key], samples)


def test_what_cannot_be_simulated_is_said() -> None:
    chirp = excitations()[0]
    strange = replace(chirp, forces={"Gamma_a": chirp.forces["Gamma_c"]})
    with pytest.raises(DataError, match=r"chirp: forces: name Gamma_a, which the controller .* feedforward"):
        simulate(ALL, TRUTH, strange, fs=FS)
    with pytest.raises(DataError, match="chirp: forces: has no further actuator Gamma_b"):
        simulate(ALL, TRUTH, replace(chirp, forces={"Gamma_b": chirp.forces["Gamma_c"]}), fs=FS)
    for forces in ({3: chirp.t}, [chirp.t]):
        with pytest.raises(DataError, match="chirp: forces: is no mapping from names"):
            replace(chirp, forces=forces)
    with pytest.raises(DataError, match=r"chirp: channel forces\[Gamma_c\]: holds no number"):
        replace(chirp, forces={"Gamma_c": np.full(chirp.t.size, np.nan)})
    hard = model_of(BOTH_ENDS.replace('"K_bc"\n', '"K_bc"\nstiffness3 = "H_bc"\n'), "qa_qb_qc")
    with pytest.raises(DataError, match="has cubic springs, and forces of several actuators"):
        simulate(hard, {**TRUTH, "H_bc": 1.0}, chirp, fs=FS)


def test_without_noise_the_truth_comes_out() -> None:
    estimate = identify(ALL, clean("qa_qb_qc"), **values_of("iv", delays="none", drift_check=False))
    for name, error in errors_of(estimate).items():
        assert abs(error) < 5e-4, name


@pytest.mark.slow
def test_a_body_that_no_sensor_sees_comes_out_too() -> None:
    # next to no noise: without any, nothing says how much each row is to weigh
    records = measured("ends", 0, {}, share=1e-3)
    estimate = identify(both_ends("ends"), records, **values_of("iv", delays="none", drift_check=False))
    assert set(errors_of(estimate)) == set(TRUTH)
    for name, error in errors_of(estimate).items():
        assert abs(error) < 5e-4, name


@pytest.mark.slow
def test_bias_coverage_and_a_delay_of_each_force() -> None:
    found = [
        identify(ALL, measured("qa_qb_qc", seed, LATE), **values_of("iv", drift_check=False))
        for seed in range(RECORDS)
    ]
    truth = np.array([*TRUTH.values(), *LATE.values()])
    values = [[*(entry.value for entry in one.parameters.physical), *one.delays.values()] for one in found]
    spreads = [[*(entry.std for entry in one.parameters.physical), *one.delay_std.values()] for one in found]
    error = np.array(values) - truth
    bias = error.mean(axis=0) / np.median(spreads, axis=0)
    # 0.25 and three standard deviations of a mean
    assert np.all(np.abs(bias) < 0.25 + 3.0 / np.sqrt(RECORDS)), bias
    covered = np.mean(np.abs(error) < 1.96 * np.array(spreads))
    # 0.95 and three standard deviations of a share, of that many independent parameters and records
    assert covered > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / error.size)
    # nor are the intervals padded: the middle of all ratios
    assert np.median(np.median(spreads, axis=0) / error.std(axis=0, ddof=1)) < 1.5


@pytest.mark.slow
def test_what_the_known_loop_did_is_simulated_under_the_other_force() -> None:
    controller = PositionVelocityController(0.5, 0.02)
    for drive in (Drive(), Drive(rate_hz=FS, delay_s=2e-4)):
        done = simulate(ALL, TRUTH, excitations(4)[0], fs=FS, controller=controller, drive=drive)
        record = record_with_reference(done)
        (found,) = validate(ALL, TRUTH, [record], controller, drive=drive, oversample=4)
        assert min(check.fit for check in found.checks) > 99.0
        run = run_beside(ALL, TRUTH, record, choose_filter(ALL, [record]), Loop(controller, drive))
        np.testing.assert_array_equal(run.signals["Gamma_c"], record.signals["Gamma_c"])
        for key in ("q_b", "q_c", "Gamma_a"):
            moving = record.signals[key] - np.mean(record.signals[key])
            assert np.std(run.signals[key] - record.signals[key]) < 0.01 * np.std(moving)


def test_a_loop_that_grows_without_bound_gets_one_error() -> None:
    away = PositionVelocityController(-1e6, -1e4)
    with pytest.raises(DataError, match="grows without bound"):
        simulate(ALL, TRUTH, excitations()[0], fs=FS, controller=away, drive=Drive(rate_hz=1000.0))


def test_a_delay_longer_than_the_run_leaves_the_axis_alone() -> None:
    chirp = replace(excitations()[1], forces={})
    late = simulate(ALL, TRUTH, chirp, fs=FS, drive=Drive(rate_hz=1000.0, delay_s=10.0))
    assert not late.true["Gamma_a"].any()


def test_an_excitation_can_be_sent_to_another_process() -> None:
    given = excitations()[0]
    sent = deepcopy(given)
    np.testing.assert_array_equal(sent.forces["Gamma_c"], given.forces["Gamma_c"])
    np.testing.assert_array_equal(sent.reference, given.reference)
    assert (sent.rate_hz, sent.name) == (given.rate_hz, given.name)


def test_a_held_command_beside_another_force_is_as_exact_as_a_continuous_one() -> None:
    # without feedback and with a constant feedforward, sampling changes nothing; c sticks and slips
    t = np.arange(8001) / 8000.0
    push = Excitation(
        0.0 * t, 0.0 * t, 0.02 + 0.0 * t, 8000.0, forces={"Gamma_c": 0.08 * np.sin(9.0 * t) + 0.1 * t}
    )
    free = PositionVelocityController(0.0, 0.0)
    plain, sampled = (
        simulate(ALL, TRUTH, push, fs=1000.0, controller=free, drive=drive)
        for drive in (Drive(), Drive(rate_hz=500.0))
    )
    assert len(plain.changes) > 3
    assert [(c.body, c.mode) for c in sampled.changes] == [(c.body, c.mode) for c in plain.changes]
    np.testing.assert_allclose(
        [c.time_s for c in sampled.changes], [c.time_s for c in plain.changes], atol=1e-9
    )
    for key, samples in plain.true.items():
        np.testing.assert_allclose(sampled.true[key], samples, atol=1e-9 * max(1.0, np.abs(samples).max()))


@pytest.mark.slow
@pytest.mark.parametrize(
    "drive",
    [
        Drive(rate_hz=1000.0, delay_s=1.5e-3, velocity="central", encoder_step=1e-3),
        Drive(rate_hz=2000.0, bandwidth_hz=150.0, limit=0.2, velocity="backward"),
    ],
)
def test_tick_by_tick_is_the_compiled_motion_where_the_other_force_is_next_to_nothing(drive: Drive) -> None:
    given = excitations()[1]
    nothing, next_to_nothing = ({"Gamma_c": size + 0.0 * given.t} for size in (0.0, 1e-15))
    fast, slow = (
        simulate(
            ALL, TRUTH, replace(given, forces=forces), fs=FS, drive=drive, initial_state=[0, 0, 0, 5, 5, 5]
        )
        for forces in (nothing, next_to_nothing)
    )
    assert [(c.body, c.mode) for c in slow.changes] == [(c.body, c.mode) for c in fast.changes]
    np.testing.assert_allclose([c.time_s for c in slow.changes], [c.time_s for c in fast.changes], atol=1e-8)
    for key in ("q_a", "q_b", "q_c", "Gamma_a", "command_Gamma_a", "mode_c"):
        np.testing.assert_allclose(slow.true[key], fast.true[key], atol=1e-8)


@pytest.mark.slow
def test_output_error_takes_all_forces_as_well() -> None:
    part = {key: samples[2000:3000] for key, samples in clean("qa_qb_qc")[0].signals.items()}
    start = {name: 1.1 * value for name, value in TRUTH.items()}
    found = fit_response(ALL, [Record(part, FS, "part")], start)
    values = dict(zip(found.names, found.values, strict=True))
    for name in ("J_a", "J_b", "J_c", "K_ab", "K_bc"):
        assert values[name] == pytest.approx(TRUTH[name], rel=0.02), name


def test_the_inertia_that_an_actuator_feels_is_that_of_all_forces_together() -> None:
    t = np.arange(4000) / FS
    motion = 0.02 * np.sin(60.0 * t)
    force = -0.005 * 60.0**2 * motion
    signals = {"q_a": motion, "q_b": motion, "q_c": motion, "Gamma_a": 3.0 * force, "Gamma_c": -2.0 * force}
    records = (Record(signals, FS),)
    setting = Setting(ALL, records, choose_filter(ALL, records, cutoff_hz=100.0))
    assert _felt_inertia(setting, make_plant(ALL, TRUTH)) == pytest.approx(0.005, rel=0.05)


def test_a_record_without_one_of_the_forces_is_refused() -> None:
    record = clean("qa_qb_qc")[0].select(["q_a", "q_b", "q_c", "Gamma_a"])
    choice = choose_filter(ALL, clean("qa_qb_qc"))
    with pytest.raises(DataError, match="chirp: has no force Gamma_c; did you mean Gamma_a"):
        run_beside(ALL, TRUTH, record, choice)


def test_a_records_columns_drive_further_actuators() -> None:
    record = Record({"reference": np.arange(3.0), "Gamma_c": np.array([0.0, 2.0, 0.0])}, 100.0, "mine")
    given = excitation_from_record(record, 2, ["Gamma_c", "Gamma_d"])
    assert list(given.forces) == ["Gamma_c"]
    np.testing.assert_array_equal(given.forces["Gamma_c"], [0.0, 1.0, 2.0, 1.0, 0.0])


@pytest.mark.slow
def test_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("both_ends.toml").write_text(BOTH_ENDS, encoding="utf-8")
    noise = [word for key, level in NOISE.items() for word in ("--noise", f"{key}={level}")]
    run_command("generate", "both_ends.toml", "--sensors", "qa_qb_qc")
    for given in excitations(1):
        plan = {key: getattr(given, key) for key in ("reference", "reference_rate", "feedforward")}
        write_record(tmp_path / f"{given.name}_plan.csv", Record({**plan, **given.forces}, FS, given.name))
        run_command(
            *("simulate", "both_ends.toml", "--sensors", "qa_qb_qc", "-o", f"{given.name}.csv"),
            *("--excitation", f"{given.name}_plan.csv", *noise),
        )
    told = run_command(
        *("identify", "chirp.csv", "trapezoid.csv", "--model", "generated/three_mass_qa_qb_qc.py"),
        *("--method", "iv", "--details", "-o", "estimate.json"),
    )
    for force in ("Gamma_a", "Gamma_c"):
        assert f"Delay of {force}: " in told
    found = json.loads(Path("estimate.json").read_text(encoding="utf-8"))
    assert set(found["physical"]) == set(TRUTH)
    for name, value in found["physical"].items():
        assert value == pytest.approx(TRUTH[name], rel=0.03), name


def run_command(*arguments: str) -> str:
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 0, result.output
    return result.output
