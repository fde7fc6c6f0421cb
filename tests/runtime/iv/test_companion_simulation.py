"""The motion along which effects are worked out is that of the record, not that of the held simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.cli.candidates import spec_model
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.iv.companion_simulation import Simulated, simulated_beside
from modelgen.runtime.iv.freed_effects import fit_with_effects
from modelgen.runtime.iv.model_errors import effects_of
from modelgen.runtime.iv.pushed_chain import Pushed, deflection_of
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.two_mass_records import GEARED_TEXT

TEXT = GEARED_TEXT.replace("ratio = 100.0\n", "")
PLAIN = spec_model(parse_spec(TEXT, "plain.toml"), "s")
RUBBING = spec_model(
    parse_spec(TEXT.replace('inertia = "J_c"', 'inertia = "J_c"\nviscous = "F_vc"'), "rubbing.toml"), "s"
)
TRUTH = {"J_m": 2e-3, "F_vm": 0.02, "F_sm": 0.4, "J_c": 6e-3, "K": 1500.0, "D": 0.6}
FS, FRICTION = 5000.0, 0.01
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 8e-3}


@cache
def clean(kind: str) -> tuple[Record, dict[str, FloatArray]]:
    """A record of a chain whose load rubs, which the model does not name, and the true speeds."""
    simulated = simulate(RUBBING, {**TRUTH, "F_vc": FRICTION}, kind, fs=FS, duration_s=1.5, oversample=4)
    record = simulated.record
    speeds = {body: np.gradient(record.signals[f"q_{body}"], 1.0 / FS) for body in ("m", "c")}
    return record, speeds


def record_with(kind: str, noise: float, zero: float = 0.0) -> Record:
    record, _ = clean(kind)
    rng = np.random.default_rng(3)
    signals = {
        key: samples + noise * NOISE[key] * rng.standard_normal(record.n)
        for key, samples in record.signals.items()
    }
    return Record({**signals, "q_c": signals["q_c"] + zero}, FS, kind, kind)


def away(found: FloatArray, true: FloatArray) -> float:
    inner = slice(400, -400)
    return float(np.std((found - true)[inner]) / np.std(true[inner]))


def without_encoders(one: Simulated) -> Simulated:
    """Return a simulation that no encoder says the positions of bodies of."""
    return replace(one, led={body: replace(one.led[body], away=None) for body in one.plant.bodies})


@pytest.mark.parametrize("kind", ["chirp", "trapezoid"])
def test_bodies_move_as_they_did_though_the_model_lacks_a_friction(kind: str) -> None:
    record, speeds = clean(kind)
    choice = choose_filter(PLAIN, (record,))
    one = simulated_beside(PLAIN, TRUTH, record_with(kind, 0.1), choice)
    for body, true in speeds.items():
        held = np.gradient(one.record.signals[f"q_{body}"], 1.0 / FS)
        assert away(held, true) > 0.02
        assert away(one.led[body].speed, true) < 0.2 * away(held, true)


def test_a_spring_bends_as_in_the_record_whatever_the_zeros_of_encoders_are() -> None:
    record, _ = clean("chirp")
    choice = choose_filter(PLAIN, (record,))
    (stiffens,) = (one for one in effects_of(PLAIN, ("m", "c"), (record,)) if one.name == "stiffening of K")
    true = record.signals["q_m"] - record.signals["q_c"]
    for zero in (0.0, 0.02):  # three times as large as the deflections are
        one = simulated_beside(PLAIN, TRUTH, record_with("chirp", 0.0, zero), choice)
        expected = Pushed(one, np.array([1.0, -1.0]), -((true - np.mean(true)) ** 3))["q_c"]
        assert away(stiffens.changes(one)["q_c"], expected) < 0.03
        assert away(stiffens.changes(without_encoders(one))["q_c"], expected) > 0.1


def test_noise_of_coarse_encoders_bends_no_spring() -> None:
    record, _ = clean("chirp")
    choice = choose_filter(PLAIN, (record,))
    (stiffens,) = (one for one in effects_of(PLAIN, ("m", "c"), (record,)) if one.name == "stiffening of K")
    one = simulated_beside(PLAIN, TRUTH, record_with("chirp", 30.0), choice)
    found, plain = stiffens.changes(one), stiffens.changes(without_encoders(one))
    np.testing.assert_array_equal(found["q_c"], plain["q_c"])


def test_what_sticks_has_no_direction_from_noise() -> None:
    record, _ = clean("trapezoid")
    choice = choose_filter(PLAIN, (record,))
    rest = {key: np.full(2000, samples[0]) for key, samples in record.signals.items()}
    rng = np.random.default_rng(4)
    rest["q_m"] = rest["q_m"] + 2e-5 * rng.standard_normal(2000)
    still = simulated_beside(PLAIN, TRUTH, Record(rest, FS, "rest", "rest"), choice)
    held = np.abs(still.led["m"].speed) < 1e-12
    assert np.mean(held) > 0.9


def seen_by(sensors: dict[str, tuple[str, str]], more: str = "") -> Model:
    """The chain behind other sensors: what each is mounted on and measures."""
    listed = [f'{key} = {{ body = "{body}", measures = "{what}" }}' for key, (body, what) in sensors.items()]
    text = TEXT[: TEXT.index("[sensors.s]")].replace('damping = "D"', 'damping = "D"' + more)
    return spec_model(parse_spec("\n".join([text, "[sensors.s]", *listed, ""]), "seen.toml"), "s")


TACHOMETER = {"v_m": ("m", "velocity"), "q_c": ("c", "position")}
ACCELEROMETER = {"q_m": ("m", "position"), "a_c": ("c", "acceleration")}


@cache
def bent(stiffer: float) -> Record:
    """A chirp of a chain whose spring is so much stiffer at a deflection of 0.002 rad."""
    cubic = stiffer * TRUTH["K"] / 0.002**2
    every = {**TACHOMETER, **ACCELEROMETER}
    stiffening = seen_by(every, '\nstiffness3 = "K3"')
    return simulate(stiffening, {**TRUTH, "K3": cubic}, "chirp", fs=FS, duration_s=1.5, oversample=4).record


def noisy(
    record: Record, sensors: Iterable[str], zeros: Mapping[str, float] = MappingProxyType({})
) -> Record:
    rng = np.random.default_rng(1)
    noise = {**NOISE, "v_m": 2e-3, "a_c": 2.0}
    read = {
        key: record.signals[key] + zeros.get(key, 0.0) + noise[key] * rng.standard_normal(record.n)
        for key in (*sensors, "Gamma_m")
    }
    return Record(read, FS, "chirp", "chirp")


@pytest.mark.parametrize("sensors", [TACHOMETER, ACCELEROMETER], ids=["tachometer", "accelerometer"])
def test_speeds_and_accelerations_tell_how_far_a_spring_bends(sensors: dict[str, tuple[str, str]]) -> None:
    record, model = bent(0.5), seen_by(sensors)
    true = record.signals["q_m"] - record.signals["q_c"]
    # a tachometer and an accelerometer have zeros, too
    seen = noisy(record, sensors, {"v_m": 0.1, "a_c": 3.0})
    (stiffens,) = (one for one in effects_of(model, ("m", "c"), (seen,)) if one.name == "stiffening of K")
    one = simulated_beside(model, TRUTH, seen, choose_filter(model, (seen,)))
    for key in sensors:
        expected = Pushed(one, np.array([1.0, -1.0]), -(true**3))[key]
        found = stiffens.added(one, 0.5 * TRUTH["K"] / 0.002**2)[key]
        assert away(found, expected) < 0.1
        assert away(stiffens.changes(without_encoders(one))[key], expected) > 0.3


@pytest.mark.slow
@pytest.mark.parametrize("sensors", [TACHOMETER, ACCELEROMETER], ids=["tachometer", "accelerometer"])
def test_a_spring_that_stiffens_severely_is_named_and_known(sensors: dict[str, tuple[str, str]]) -> None:
    model = seen_by(sensors)
    estimate = identify(model, noisy(bent(0.5), sensors))
    assert any("K between m and c stiffens" in one.what for one in estimate.checks.advice)
    found = {one.name: one for one in estimate.parameters.physical}
    assert found.keys() == TRUTH.keys()
    for name, one in found.items():
        assert abs(one.value - TRUTH[name]) < 3.0 * one.std
    assert found["K"].std < 0.03 * TRUTH["K"]


@pytest.mark.slow
def test_friction_that_the_spec_does_not_name_leaves_the_others_right() -> None:
    records = tuple(record_with(kind, 1.0) for kind in ("chirp", "trapezoid"))
    job = Job(PLAIN, records, choose_filter(PLAIN, records), late=("Gamma_m",))
    fit = METHODS["iv"].run(job)[1]
    (effect,) = (one for one in effects_of(PLAIN, ("m", "c"), records) if one.name == "viscous friction on c")
    found = fit_with_effects(job.setting(), job.calm, fit, (effect,), (), job.sharpened)
    assert abs(found.sizes[0] - FRICTION) < 3.0 * found.stds[0]
    truth = np.array([TRUTH[name] for name in found.fit.columns])
    spread = np.sqrt(np.diag(hac_covariance(found.fit)))
    np.testing.assert_array_less(np.abs(found.fit.solution.x - truth), 3.0 * spread)


def test_a_force_is_felt_by_the_rows_that_it_is_in() -> None:
    record, _ = clean("chirp")
    one = simulated_beside(PLAIN, TRUTH, record, choose_filter(PLAIN, (record,)))
    force = np.sin(np.arange(record.n) / FS)
    for push, rows in (([1.0, 0.0], (0,)), ([0.0, 1.0], (1,)), ([1.0, -1.0], (0, 1))):
        assert Pushed(one, np.array(push), force).felt_rows() == rows


def test_the_lever_of_a_link_does_not_depend_on_how_stiff_it_is() -> None:
    for stiffness in (1e-30, TRUTH["K"], 1e30):
        plant = make_plant(PLAIN, {**TRUTH, "K": stiffness})
        np.testing.assert_allclose(np.abs(deflection_of(plant, "K")), [1.0, 1.0], rtol=1e-12)


@pytest.mark.parametrize("kind", ["chirp", "trapezoid"])
def test_a_body_without_a_sensor_moves_as_its_links_carry_it_in_the_record(kind: str) -> None:
    """The slow motion of the nearest sensor alone had left the load where the held simulation had it."""
    _record, speeds = clean(kind)
    alone = spec_model(parse_spec(TEXT.split("q_c = ")[0], "alone.toml"), "s")
    seen = record_with(kind, 0.1)
    seen = Record({key: seen.signals[key] for key in ("q_m", "Gamma_m")}, FS, kind, kind)
    one = simulated_beside(alone, TRUTH, seen, choose_filter(alone, (seen,)))
    assert away(one.motion["v_c"], speeds["c"]) > 0.02
    assert away(one.led["c"].speed, speeds["c"]) < 0.2 * away(one.motion["v_c"], speeds["c"])
