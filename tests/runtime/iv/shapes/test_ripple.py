"""Forces and errors periodic in a position: their columns, the search for periods, and what identify says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.iv.shapes.ripple import PeriodicPlace, position, ripple
from modelgen.runtime.iv.shapes.ripple_search import _spectrum
from modelgen.runtime.iv.thresholds import FEWEST_PERIODS
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec
from tests.runtime.iv.shapes.chains import BOTH_SEEN, FURTHER, KNOWN, SHORT, TWO, simulated_alone
from tests.runtime.two_mass_records import SMALL

ENDS_SEEN = BOTH_SEEN.replace("q_c", "q_x").replace('"c"', '"x"')
THREE = spec_model(parse_spec(TWO + FURTHER + ENDS_SEEN, "three.toml"), "s")
THIRD = {"J_x": 3e-3, "K_x": 2500.0, "D_x": 0.4}
NUMBER, AMPLITUDE, NOISE = 14.0, {"T": 0.12, "q": 1e-4}, {"T": 2e-3, "q": 3e-6}
SAID = {
    "T": "a force that varies with the position of m acts on it, 14 periods a turn",
    "q_m": "q_m has an error that is periodic in what it reads, 14 periods a turn",
    "q_c": "q_c has an error that is periodic in what it reads, 14 periods a turn",
}


def rippled(model: Model, values: dict[str, float], seed: int, wrong: str = "T") -> list[Record]:
    """Return a chirp and a trapezoid of a drive that cogs, 14 periods a turn, by 0.12 N m.

    Or one whose encoder `wrong` is eccentric, by 0.1 mrad.

    A motor that is pushed by a force of its position is one without it whose torque is less by it. In coarser
    steps the simulation would be off by more than noise.
    """
    found = []
    for kind in ("chirp", "trapezoid"):
        clean = simulate(model, values, kind, fs=2000.0, duration_s=3.0, oversample=40).record.signals
        rng = np.random.default_rng([seed, len(found)])
        turned = np.sin(NUMBER * clean["q_m" if wrong == "T" else wrong] + 1.0)
        signals = {key: samples + NOISE[key[0]] * rng.standard_normal(len(samples))
                   for key, samples in clean.items() if key[0] in NOISE}  # fmt: skip
        signals[wrong] = signals[wrong] + AMPLITUDE[wrong[0]] * turned
        found.append(Record(signals, 2000.0, kind))
    return found


@pytest.mark.parametrize("place", [0, 1])
def test_number_and_phase_change_the_effect_as_their_columns_say(place: int) -> None:
    simulated, size, step = simulated_alone(), 2e-3, 1e-4
    wave = ripple(SMALL, PeriodicPlace("c"), 1.0, 40.0, [0.3])
    assert wave.moved is not None
    steps = [size * step if index == place else 0.0 for index in range(2)]
    near = [wave.moved(size, [sign * by for by in steps]) for sign in (1.0, -1.0)]
    more, less = (one.changes(simulated)["q_c"] for one in near)
    expected = wave.shape(1)[place].changes(simulated)["q_c"]
    scale = float(np.max(np.abs(expected)))
    np.testing.assert_allclose((more - less) / (2.0 * step), expected, atol=1e-5 * scale)


def test_steps_lead_to_no_ripple_that_a_friction_or_a_gain_could_be() -> None:
    way = 1.0
    wave, slowest = ripple(SMALL, PeriodicPlace("c"), way, 4.0, [0.0]), 2.0 * np.pi * FEWEST_PERIODS / way
    for _ in range(5):
        assert wave.moved is not None
        wave = wave.moved(1.0, [-1.0, 0.0])
    assert f"{slowest:.4g} periods a turn" in wave.words


def test_each_record_has_a_phase_of_its_own() -> None:
    simulated = simulated_alone()
    of_first, of_second = ripple(SMALL, PeriodicPlace("c"), 1.0, 40.0, [0.3, 0.5]).shape(2)[1:]
    assert of_first.changes(simulated) and not of_second.changes(simulated)
    assert of_second.changes(replace(simulated, index=1))


def test_position_is_the_measured_one_whatever_the_simulation_drifts_by() -> None:
    simulated = simulated_alone()
    drifted = {**simulated.motion, "q_c": simulated.motion["q_c"] + np.linspace(0.0, 2.0, simulated.record.n)}
    record = simulated.record.edited({"q_c": drifted["q_c"]})
    away = replace(simulated, motion=drifted, record=record)
    np.testing.assert_allclose(position(away, "c"), position(simulated, "c"), atol=0.01)


def test_the_spectrum_is_the_sum_over_positions() -> None:
    rng = np.random.default_rng(3)
    place, samples = np.sort(rng.uniform(-2.0, 2.0, 500)), rng.standard_normal(500)
    step, count = 2.0 * np.pi / 16.0, 30
    direct = np.exp(-1j * step * np.arange(count)[:, None] * place) @ samples
    np.testing.assert_allclose(np.abs(_spectrum(samples, place, step, count)), np.abs(direct), atol=4.0)


@pytest.mark.parametrize("wrong", SAID)
def test_what_is_periodic_is_told_with_its_periods_and_moves_nothing(wrong: str) -> None:
    estimate = identify(SHORT, rippled(SHORT, KNOWN, 1, wrong))
    assert SAID[wrong] in " ".join(advice.what for advice in estimate.checks.advice)
    for found in estimate.parameters.physical:
        assert found.value == pytest.approx(KNOWN[found.name], abs=3.0 * found.std)
        assert found.std < 0.01 * abs(found.value)


@pytest.mark.slow
def test_beside_a_body_without_a_sensor_as_well() -> None:
    """Rows are linear in composites: steps are taken in physical parameters, and the ripple with them."""
    estimate = identify(THREE, rippled(THREE, KNOWN | THIRD, 2))
    said = " ".join(advice.what for advice in estimate.checks.advice)
    assert "a force that varies with the position of m acts on it, 14 periods a turn" in said
    for found in estimate.parameters.physical:
        assert found.value == pytest.approx((KNOWN | THIRD)[found.name], abs=3.0 * found.std)


def test_records_that_are_held_out_have_phases_of_their_own() -> None:
    """The period is known; a phase is that of the middle of a record, and tells nothing of another one."""
    estimate = identify(SHORT, rippled(SHORT, KNOWN, 3), checks=CheckOptions(hold_out=0.3))
    held = estimate.checks.held_out
    assert held is not None
    assert all(row.relative_error < 4.0 * (row.fitted_error or 0.0) for row in held.rows)
    assert not any(move.significant for move in held.moves)
