"""Levels that suit any chain: no reversal under the chirp, rest in the trapezoid's dwells."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from generated import (
    emps300_qm_ac,
    emps_rigid_asymmetric_qm,
    emps_rigid_qm,
    three_mass_qa_qb_qc,
    tree_mixed,
    two_mass_bench_qm_qc,
)
from modelgen.errors import DataError
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.simulate import simulate

EMPS = model_from_module(emps300_qm_ac)
TREE = model_from_module(tree_mixed)
# for chains without a named set: what a small rotary or linear axis may have
TYPICAL = {"viscous": 0.01, "coulomb": 0.05, "offset": 0.01, "stiffness": 500.0, "damping": 0.05}


def typical(model: Model) -> dict[str, float]:
    return {name: TYPICAL.get(role.role, 5e-3) for name, role in model.roles.items()}


def cases() -> list[tuple[ModuleType, str]]:
    emps = [(emps300_qm_ac, values) for values in ("table_1", "table_2", "light")]
    typical_ones = [
        (module, "") for module in (two_mass_bench_qm_qc, emps_rigid_qm, emps_rigid_asymmetric_qm)
    ]
    return [*emps, (three_mass_qa_qb_qc, "nominal"), *typical_ones]


@pytest.mark.parametrize(("module", "values"), cases(), ids=lambda x: x if isinstance(x, str) else x.CHAIN)
def test_under_the_chirp_no_body_reverses(module: ModuleType, values: str) -> None:
    model = model_from_module(module)
    parameters = model.parameter_sets[values] if values else typical(model)
    found = simulate(model, parameters, "chirp", duration_s=4.0)
    waves = np.flatnonzero(found.reference.feedforward)
    steps = found.settings.oversample
    first, last = waves[0] // steps, waves[-1] // steps + 1
    bodies = [key.removeprefix("v_") for key in found.true if key.startswith("v_")]
    velocities = np.array([found.true[f"v_{body}"][first:last] for body in bodies])
    assert velocities.min() > 0.0
    # and it is a chirp that moves the bodies, not a mere drift
    assert np.ptp(velocities, axis=1).min() > 0.1 * velocities.mean()
    assert (last - first) / 5000.0 > 2.0


@pytest.mark.parametrize(("module", "values"), cases(), ids=lambda x: x if isinstance(x, str) else x.CHAIN)
def test_in_the_trapezoid_every_driven_body_goes_both_ways_and_sticks(
    module: ModuleType, values: str
) -> None:
    model = model_from_module(module)
    parameters = model.parameter_sets[values] if values else typical(model)
    found = simulate(model, parameters, "trapezoid", duration_s=4.0)
    mode = found.true[f"mode_{model.actuators[0].body}"]
    assert {-1.0, 0.0, 1.0} == set(np.unique(mode).tolist())
    speed = found.true[f"v_{model.actuators[0].body}"]
    top = found.reference.reference_rate.max()
    assert speed.max() == pytest.approx(top, rel=0.5)
    assert speed.min() == pytest.approx(-top, rel=0.5)


def test_the_band_lies_around_the_elastic_modes() -> None:
    for values, frequency_hz in (("table_1", 106.5), ("table_2", 123.6)):
        wave = default_excitation("chirp", EMPS, EMPS.parameter_sets[values], duration_s=4.0)
        power = np.abs(np.fft.rfft(wave.feedforward)) ** 2
        f_hz = np.fft.rfftfreq(wave.t.size, 1.0 / wave.rate_hz)
        inside = (f_hz > 0.2 * frequency_hz) & (f_hz < 1.8 * frequency_hz)
        assert power[inside].sum() > 0.99 * power.sum()
        share = power[f_hz < frequency_hz].sum() / power.sum()
        assert share == pytest.approx(0.5, abs=0.03)


def test_the_band_and_the_force_can_be_set() -> None:
    wave = default_excitation("chirp", EMPS, EMPS.parameter_sets["light"], band_hz=(400.0, 500.0), force=0.2)
    power = np.abs(np.fft.rfft(wave.feedforward)) ** 2
    f_hz = np.fft.rfftfreq(wave.t.size, 1.0 / wave.rate_hz)
    assert power[(f_hz > 390.0) & (f_hz < 510.0)].sum() > 0.99 * power.sum()
    assert np.abs(wave.feedforward).max() == pytest.approx(0.2, rel=1e-3)


def test_without_coulomb_friction_the_force_follows_from_the_inertia() -> None:
    model = model_from_module(emps_rigid_qm)
    wave = default_excitation("chirp", model, {"M": 95.0, "Fv": 200.0, "Fc": 0.0, "offset": 0.0})
    assert np.abs(wave.feedforward).max() == pytest.approx(5.0 * 95.0, rel=1e-3)


def test_gears_carry_friction_to_the_actuator() -> None:
    p = {**TREE.parameter_sets["nominal"], "K_b": 0.0}
    wave = default_excitation("chirp", TREE, p)
    assert np.abs(wave.feedforward).max() == pytest.approx(10.0 * (p["F_sm"] + p["F_sa"] / 20.0), rel=1e-3)


def test_a_chain_on_a_spring_is_pushed_as_far_as_the_force_allows() -> None:
    p = TREE.parameter_sets["nominal"]
    assert np.all(default_excitation("chirp", TREE, p).reference == 0.0)
    wave = default_excitation("trapezoid", TREE, p, force=2.0, duration_s=8.0)
    assert wave.feedforward.max() == pytest.approx(1.0)
    found = simulate(TREE, {**p, "O_a": 0.0, "F_sm": 0.0, "F_sa": 0.0}, wave)
    travel = wave.reference.max()
    # quasi-static motion follows the reference
    cruise = np.argmax(wave.reference) // found.settings.oversample
    assert found.true["q_m"][cruise] == pytest.approx(travel, rel=0.1)


def test_low_sampling_limits_the_band() -> None:
    wave = default_excitation(
        "chirp", EMPS, EMPS.parameter_sets["table_2"], fs=500.0, oversample=1
    ).feedforward
    power = np.abs(np.fft.rfft(wave)) ** 2
    f_hz = np.fft.rfftfreq(wave.size, 1.0 / 500.0)
    assert power[f_hz < 102.0].sum() > 0.99 * power.sum()


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(DataError, match="there is no kind 'sine'; choose chirp or trapezoid"):
        default_excitation("sine", EMPS, EMPS.parameter_sets["table_1"])


def test_an_impossible_band_is_refused() -> None:
    with pytest.raises(DataError, match="chirp: band: is 0 Hz to 200 Hz; give two positive frequencies"):
        default_excitation("chirp", EMPS, EMPS.parameter_sets["table_1"], band_hz=(0.0, 200.0))
