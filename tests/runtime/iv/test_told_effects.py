"""What is said of effects: what may be the rows' own is no warning, and a zero below noise is not told."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.advice import ROWS_OWN
from modelgen.runtime.iv.model_errors import effects_of, zero_effect
from modelgen.runtime.iv.told_effects import below_noise, left
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import SMALL

NOISE = 1e-4


@pytest.mark.parametrize("turning", [True, False])
def test_friction_at_low_speed_is_a_warning_where_no_samples_about_reversals_are_used(turning: bool) -> None:
    effects = {one.name: one for one in effects_of(SMALL, ("m", "c"), 1, turning=turning)}
    assert ("direction of m" in effects) == turning
    told = left(effects["Stribeck friction on m"], 1e-3, ())
    assert told.kind == (ROWS_OWN if turning else "more than the model")


@pytest.mark.parametrize(("share", "below"), [(0.5, True), (2.0, False)])
def test_a_zero_of_a_part_of_a_readings_noise_is_below_it(share: float, below: bool) -> None:
    rng = np.random.default_rng(0)
    t = np.arange(8000) / 1000.0
    reading = np.sin(2.0 * np.pi * t) + NOISE * rng.standard_normal(len(t))
    record = Record({"q_c": reading, "q_m": reading}, 1000.0, "r")
    assert below_noise(zero_effect("q_c", 0, 1), share * NOISE, [record]) == below
    # of other effects nothing of the kind is known
    gain = next(one for one in effects_of(SMALL, ("m", "c"), 1) if one.name == "gain of q_c")
    assert not below_noise(gain, 1e-9, [record])
