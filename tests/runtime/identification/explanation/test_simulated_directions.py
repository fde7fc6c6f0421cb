"""Directions near reversals from a simulation: a motor that swings about rest, both encoders."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.cli.candidates import spec_model
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.identification.explanation import explain_stretches
from modelgen.runtime.identification.explanation.explained import run_method
from modelgen.runtime.identification.explanation.simulated_directions import (
    _moved_by_unseen,
    with_simulated_directions,
)
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import IV, Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.iv.companion_simulation import followed_closely, simulated_beside
from modelgen.runtime.iv.physical.friction_rows import directions
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.iv.physical.swinging_servo import FS, SERVO, TRUTH, swung
from tests.runtime.iv.physical.test_composite_iv import model_of
from tests.runtime.iv.shapes.chains import TWO
from tests.runtime.two_mass_records import SMALL, two_mass_records
from tests.runtime.two_mass_records import TRUTH as SMALL_TRUTH

BOTH = SERVO + 'q_l = { body = "l", measures = "position" }\n'
PLACES = [(4.3, 0.02, 0.0), (7.9, 0.02, 1.0), (11.0, 0.015, 2.0), (15.0, 0.01, 4.0), (21.0, 0.006, 5.0)]


@cache
def servo() -> Model:
    return model_of(BOTH, "motor")


@cache
def swinging(seed: int) -> Record:
    """Return 5 s of a motor that reverses some twenty times a second: every sample feels a reversal."""
    clean = swung(servo(), TRUTH, PLACES, 5)
    rng = np.random.default_rng(seed)
    levels = {"q_m": 1e-6, "q_l": 1e-6, "T": 0.01 * float(np.std(clean.signals["T"]))}
    noisy = {key: clean.signals[key] + level * rng.standard_normal(clean.n) for key, level in levels.items()}
    return Record(noisy, FS, "swing")


def test_friction_at_reversals_is_known_from_a_simulation() -> None:
    found = identify(servo(), swinging(5))
    assert any("directions near reversals are those of a simulation" in note for note in found.fit.notes)
    for entry in found.parameters.physical:
        assert abs(entry.value - TRUTH[entry.name]) < 3.0 * entry.std
    # with signs of the low-passed velocity F_sm had no number, and D was known to 25 %, K to 0.3 %
    spread = {entry.name: entry.std / TRUTH[entry.name] for entry in found.parameters.physical}
    assert spread["F_sm"] < 0.05
    assert spread["D"] < 0.01
    assert spread["K"] < 0.001


def directions_of(
    truth: dict[str, float], places: list[tuple[float, float, float]], close: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return the motor's direction in a simulation beside a record, and the true friction over F_sm.

    Both below 40 Hz, shape (n,).
    """
    record = swung(servo(), truth, places, 5)
    q_m, q_l = record.signals["q_m"], record.signals["q_l"]
    v_m, v_l = (np.gradient(q, record.dt) for q in (q_m, q_l))
    moved = truth["J_m"] * np.gradient(v_m, record.dt) + truth["F_vm"] * v_m
    spring = truth["K"] * (q_m - q_l) + truth["D"] * (v_m - v_l)
    friction = (record.signals["T"] - spring - moved) / truth["F_sm"]
    choice = FilterChoice(4, 30.0, 100.0, (10,), 25.0, 30.0, (), (), ())
    simulated = simulated_beside(servo(), truth, record, choice)
    simulated = followed_closely(simulated, choice) if close else simulated
    found = directions(simulated, ["m"], record)["direction of m"]
    seen, true = (zero_phase(one, 4, 40.0, FS)[400:-400] for one in (found, friction))
    return seen, true


def test_friction_that_is_followed_closely_does_not_turn_late() -> None:
    """Beside a velocity that a low-pass bends at every reversal it had been late by 0.4 ms."""
    seen, true = directions_of(TRUTH, [(1.3, 0.05, 0.0), (3.1, 0.02, 1.0), (5.3, 0.01, 2.0)])
    slope = np.gradient(true, 1.0 / FS)
    late_s = -np.vdot(slope, seen - true) / np.vdot(slope, slope)
    assert abs(late_s) < 0.2e-3


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.15])
def test_a_body_that_is_followed_closely_slips_when_it_does_in_the_record(friction: float) -> None:
    """A feedback as fast as the dynamics had pulled at what sticks: 9 to 12 % of the friction was wrong."""
    seen, true = directions_of({**TRUTH, "F_sm": friction}, [(0.6, 0.3, 0.0), (1.3, 0.1, 1.0)])
    assert np.std(seen - true) < 0.01 * np.std(true)


def test_a_body_that_is_followed_closely_turns_when_it_does_in_the_record() -> None:
    """A weak feedback, which sees slow motion only, damps what is faster: 18 % of the friction was wrong."""
    often = {**TRUTH, "F_sm": 0.15}, [(14.0, 0.02, 1.0), (22.0, 0.01, 3.0), (35.0, 0.006, 2.0)]
    shares = []
    for close in (False, True):
        seen, true = directions_of(*often, close=close)
        shares.append(np.std(seen - true) / np.std(true))
    assert shares[1] < 0.5 * shares[0]


ROW = """
chain = { name = "row", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "T" },
    { name = "c", inertia = "J_c" },
    { name = "l", inertia = "J_l" },
]
links = [
    { bodies = ["m", "c"], stiffness = "K_1", damping = "D_1" },
    { bodies = ["c", "l"], stiffness = "K_2", damping = "D_2" },
]

[sensors.motor]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
"""


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 6, 7])
def test_a_fit_in_physical_parameters_takes_simulated_directions_too(seed: int) -> None:
    """With those of a low-passed velocity J_m was 2.2 % too large and F_sm 2.7 % too small."""
    truth = {"J_m": 4e-3, "F_vm": 8e-3, "F_sm": 0.1, "J_c": 6e-3, "J_l": 5e-3}
    truth |= {"D_1": 0.03, "K_1": 120.0, "D_2": 0.02, "K_2": 60.0}
    places = [(4.3, 0.03, 0.0), (7.9, 0.03, 1.0), (11.0, 0.02, 2.0), (16.0, 0.01, 4.0), (27.0, 0.004, 5.0)]
    clean = swung(model_of(ROW, "motor"), truth, places, 4)
    rng = np.random.default_rng(seed)
    levels = {"q_m": 1e-6, "q_c": 1e-6, "T": 0.005 * float(np.std(clean.signals["T"]))}
    noisy = {key: clean.signals[key] + level * rng.standard_normal(clean.n) for key, level in levels.items()}
    found = identify(model_of(ROW, "motor"), Record(noisy, FS, "swing"))
    assert any("method iv, in the physical parameters" in note for note in found.fit.notes)
    for entry in found.parameters.physical:
        assert abs(entry.value - truth[entry.name]) < 3.0 * entry.std
    assert abs(found.params["J_m"] / truth["J_m"] - 1.0) < 0.01
    assert abs(found.params["F_sm"] / truth["F_sm"] - 1.0) < 0.015


@pytest.mark.slow
def test_instruments_are_not_run_again_where_rows_hold_no_sign(monkeypatch: pytest.MonkeyPatch) -> None:
    def again(*_: object) -> None:
        raise AssertionError("run again, with nothing new")

    monkeypatch.setattr("modelgen.runtime.identification.explanation.simulated_directions.run_method", again)
    # friction forward and backward is no sign
    asymmetric = BOTH.replace('coulomb = "F_sm"', 'coulomb = "F_sm", friction = "asymmetric"')
    found = identify(model_of(asymmetric, "motor"), swinging(5))
    assert not any("directions near reversals" in note for note in found.fit.notes)


def test_all_of_a_long_record_takes_the_directions_that_its_stretches_take(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    short = identify(servo(), swinging(5))
    monkeypatch.setattr(explain_stretches, "SEARCHED", 1 << 12)
    found = identify(servo(), swinging(5))
    (record,) = found.source.records
    assert record.n == swinging(5).n
    assert "direction of m" in record.signals
    # with low-passed ones F_sm has no number
    assert abs(found.params["F_sm"] - short.params["F_sm"]) < 3.0 * short.bse["F_sm"]


def test_reversals_that_a_low_pass_does_not_see_count_where_they_move_friction() -> None:
    begun = run_method(prepared(SMALL, two_mass_records(), Auto(), Filters(), CheckOptions()), IV())
    assert with_simulated_directions(begun) is begun
    fit = begun.found.fit
    assert fit.simulated is not None
    turned = {}
    for index, record in fit.simulated.items():
        q = record.signals["q_m"].copy()
        places = np.arange(500, record.n - 500, 50)
        # the next sample lies before this one
        q[places] += 3.0 * np.gradient(q)[places]
        turned[index] = record.edited({"q_m": q})
    unseen = replace(begun, found=replace(begun.found, fit=replace(fit, simulated=turned)))
    move = _moved_by_unseen(unseen)
    assert move is not None
    place = fit.columns.index("F_sm")
    # one sample in 50 has the wrong direction: friction comes out low by some 4 %
    assert 0.01 < abs(move[place]) / SMALL_TRUTH["F_sm"] < 0.1
    found = with_simulated_directions(unseen)
    assert found is not unseen
    assert found.found.drift[place, place] == pytest.approx(move[place] ** 2) or (
        "directions near reversals are those of a simulation at the estimate" in found.found.fit.notes
    )


@pytest.mark.slow
def test_directions_are_simulated_anew_with_what_the_residual_shows() -> None:
    rubbing = BOTH.replace('inertia = "J_l"', 'inertia = "J_l", coulomb = "F_sl"')
    pushed = model_of(rubbing.replace('coulomb = "F_sl"', 'coulomb = "F_sl", offset = "F_0"'), "motor")
    truth = {**TRUTH, "F_sl": 0.02}
    clean = swung(pushed, {**truth, "F_0": 0.02}, PLACES, 5)
    rng = np.random.default_rng(5)
    levels = {"q_m": 1e-6, "q_l": 1e-6, "T": 0.01 * float(np.std(clean.signals["T"]))}
    noisy = {key: clean.signals[key] + level * rng.standard_normal(clean.n) for key, level in levels.items()}
    found = identify(model_of(rubbing, "motor"), Record(noisy, FS, "swing"))
    spread = {entry.name: entry.std / truth[entry.name] for entry in found.parameters.physical}
    for entry in found.parameters.physical:
        assert abs(entry.value - truth[entry.name]) < 3.0 * entry.std
    # with directions that know nothing of the force on the load F_sl has no number, and D is known to 27 %
    assert spread["F_sl"] < 0.01
    assert spread["D"] < 0.01
    assert spread["K"] < 0.001


AXIS = (
    TWO
    + """
[sensors.s]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
"""
)
AXIS_TRUTH = {"J_m": 0.0024, "F_vm": 0.01, "F_sm": 0.25, "J_c": 0.0045, "K": 2600.0, "D": 0.35}


def sines_about_rest(seed: int, noise: float) -> Record:
    """Return 2 s of sines about rest that reverse the motor 160 times a second, and stop it in between."""
    inertia = AXIS_TRUTH["J_m"] + AXIS_TRUTH["J_c"]
    w = np.sqrt(AXIS_TRUTH["K"] * inertia / (AXIS_TRUTH["J_m"] * AXIS_TRUTH["J_c"]))
    t, phases = np.arange(10_000) / 5000.0, np.random.default_rng(seed).uniform(0.0, 6.0, 6)
    shares = (0.05, 0.13, 0.31, 0.55, 0.9, 1.3)
    force = np.sum([np.sin(one * w * t + phase) for one, phase in zip(shares, phases, strict=True)], axis=0)
    force *= 6.0 * AXIS_TRUTH["F_sm"] / np.max(np.abs(force))
    rate = w / 12.0
    return simulate(
        spec_model(parse_spec(AXIS, "axis.toml"), "s"),
        AXIS_TRUTH,
        Excitation(0.0 * t, 0.0 * t, force, 5000.0, "sines"),
        fs=5000.0,
        controller=PositionVelocityController(inertia * rate**2, 1.4 * inertia * rate),
        noise={"q_m": noise, "q_c": noise, "T": 0.02 * AXIS_TRUTH["F_sm"]},
        seed=seed,
    ).record


# K was 2.4 deviations off and F_sm 3.1 (seed 1, 20 urad); 28 and 14 % were stated of F_sm (seeds 1 and 8)
@pytest.mark.parametrize(("seed", "noise"), [(1, 2e-5), (1, 3e-6), (8, 3e-6)])
def test_intervals_hold_what_is_uncertain_of_reversals(seed: int, noise: float) -> None:
    found = identify(spec_model(parse_spec(AXIS, "axis.toml"), "s"), sines_about_rest(seed, noise))
    for name, value in AXIS_TRUTH.items():
        assert abs(found.params[name] - value) < 2.6 * found.bse[name]
    assert found.bse["F_sm"] < (0.02 if noise < 1e-5 else 0.08) * AXIS_TRUTH["F_sm"]
