"""What is said of effects: what may be the rows' own is no warning, and a zero below noise is not told."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from modelgen.runtime.advice import ROWS_OWN
from modelgen.runtime.iv.model_errors import effects_of, zero_effect
from modelgen.runtime.iv.told_effects import below_noise, left, summed, within_rounding
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import RAMPS, SMALL

NOISE = 1e-4


@pytest.mark.parametrize("turning", [True, False])
def test_friction_at_low_speed_is_a_warning_where_no_samples_about_reversals_are_used(turning: bool) -> None:
    effects = {one.name: one for one in effects_of(SMALL, ("m", "c"), RAMPS[:1], turning=turning)}
    assert ("direction of m" in effects) == turning
    told = left(effects["Stribeck friction on m"], 1e-3, ())
    assert told.kind == (ROWS_OWN if turning else "more than the model")


def test_friction_that_is_estimated_is_in_no_sum() -> None:
    effects = {one.name: one for one in effects_of(SMALL, ("m", "c"), RAMPS[:1])}
    coulomb, viscous = effects["Coulomb friction on c"], effects["viscous friction on c"]
    (both,) = summed((coulomb, viscous, coulomb), ())
    assert both.count("Coulomb") == both.count("viscous") == 1
    assert both.endswith("the value is the sum of all bodies' friction")
    (one,) = summed((coulomb, viscous), (coulomb,))
    assert one.startswith("viscous friction on c, which")
    assert one.endswith("the value holds it as well, Coulomb friction on c not")
    assert summed((coulomb,), (coulomb,)) == ()


@pytest.mark.parametrize(("share", "below"), [(0.5, True), (2.0, False)])
def test_a_zero_of_a_part_of_a_readings_noise_is_below_it(share: float, below: bool) -> None:
    rng = np.random.default_rng(0)
    t = np.arange(8000) / 1000.0
    reading = np.sin(2.0 * np.pi * t) + NOISE * rng.standard_normal(len(t))
    record = Record({"q_c": reading, "q_m": reading}, 1000.0, "r")
    assert below_noise(zero_effect("q_c", 0, 1), share * NOISE, [record]) == below
    # of other effects nothing of the kind is known
    gain = next(one for one in effects_of(SMALL, ("m", "c"), RAMPS[:1]) if one.name == "gain of q_c")
    assert not below_noise(gain, 1e-9, [record])


@pytest.mark.parametrize("step", [1e-3, 0.0])
def test_encoders_hide_what_moves_them_by_less_than_their_step(step: float) -> None:
    t = np.arange(8000) / 1000.0
    reading = np.sin(2.0 * np.pi * t) + 1e-4 * np.sin(0.7 * t)
    rounded = step * np.round(reading / step) if step else reading
    measured = Record({"q_m": rounded, "q_c": rounded}, 1000.0, "r")
    # what is set right by little was read as coarsely
    measured = measured.edited({"q_m": measured.signals["q_m"] + 1e-5 * np.cos(t)})
    plain = Record({"q_m": reading, "q_c": reading}, 1000.0, "r")
    simulated = SimpleNamespace(plant=SimpleNamespace(model=SMALL), record=plain, measured=measured, index=0)
    effects = {one.name: one for one in effects_of(SMALL, ("m", "c"), RAMPS[:1])}
    for name in ("delay of q_m", "delay of q_c", "gain of q_m", "zero of q_c"):
        moved = effects[name].changes(cast(Any, simulated))
        (change,) = moved.values()
        one = 1e-3 / np.sqrt(12.0 * np.mean(change**2))
        for share, hidden in ((0.9, bool(step)), (1.1, False)):
            assert within_rounding(effects[name], share * one, [cast(Any, simulated)]) == hidden
    # a force tells what it tells
    force = effects["clock of Gamma_m"]
    assert not within_rounding(
        replace(force, changes=lambda _: {"Gamma_m": 0.0 * t}), 1.0, [cast(Any, simulated)]
    )
