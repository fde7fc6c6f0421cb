"""Effects that a model may lack: what physics allows, what is said of them, how channels are set right."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.model_errors import _without_lag, effects_of, zero_effects
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import FS, GEARED, SMALL, two_mass_records

BODIES = ("m", "c")
EFFECTS = {effect.name: effect for effect in effects_of(SMALL, BODIES, 2)}
FRICTIONS = [
    f"{form} friction on {body}"
    for form in ("viscous", "Coulomb", "quadratic", "Stribeck")
    for body in BODIES
    if f"{form} friction on {body}" in EFFECTS
]


def test_every_effect_has_a_name_of_its_own_and_words() -> None:
    assert len(EFFECTS) == len(effects_of(SMALL, BODIES, 2))
    for effect in EFFECTS.values():
        assert effect.words
        assert effect.remedy
        assert effect.possible(1.0)
        assert effect.possible(-1.0) is bool(effect.negative)
        for size in (1e-4, -1e-4) if effect.negative else (1e-4,):
            assert effect.said(size).startswith(effect.words if size > 0.0 else effect.negative)


@pytest.mark.parametrize("name", FRICTIONS)
@given(size=st.floats(1e-12, 1e12))
def test_no_friction_pushes(name: str, size: float) -> None:
    assert EFFECTS[name].possible(size)
    assert not EFFECTS[name].possible(-size)


@pytest.mark.parametrize("body", BODIES)
def test_no_further_mass_is_negative_but_forces_and_delays_have_either_sign(body: str) -> None:
    assert not EFFECTS[f"further mass on {body}"].possible(-1.0)
    for name in (f"constant force on {body}", f"delay of q_{body}", f"gain of q_{body}"):
        assert EFFECTS[name].possible(-1.0)


def test_what_the_spec_names_is_not_looked_for() -> None:
    # viscous and Coulomb friction of the motor are in the model, the load has none but that of the link
    assert "Coulomb friction on m" not in EFFECTS
    assert "viscous friction on m" not in EFFECTS
    assert "Coulomb friction on c" in EFFECTS
    assert len(FRICTIONS) == 6


def test_zeros_are_those_of_all_positions_but_the_first_in_every_record() -> None:
    assert [effect.name for effect in zero_effects(SMALL, 2)] == [
        "zero of q_c in record 1",
        "zero of q_c in record 2",
    ]
    assert [effect.name for effect in zero_effects(GEARED, 1)] == ["zero of q_c"]


@pytest.mark.parametrize("samples", [0.25, -0.25, 1.0])
def test_a_late_channel_is_set_right_and_the_others_stay(samples: float) -> None:
    (late, _), (right, _) = two_mass_records(late={"q_c": samples}, noise=0.0), two_mass_records(noise=0.0)
    found = EFFECTS["delay of q_c"].corrected(late, samples / FS)
    np.testing.assert_allclose(found.signals["q_c"][20:-20], right.signals["q_c"][20:-20], atol=1e-8)
    np.testing.assert_array_equal(found.signals["q_m"], late.signals["q_m"])
    assert EFFECTS["delay of q_c"].corrected(late, 0.0) is late
    # what has no edit stays in the rows
    assert EFFECTS["gain of q_c"].corrected(late, 0.1) is late


@given(
    tau=st.floats(0.05, 10.0),
    frequency=st.floats(0.0, 0.1),
    phase=st.floats(0.0, 6.3),
)
def test_a_low_pass_is_undone_below_a_tenth_of_the_sampling_frequency(
    tau: float, frequency: float, phase: float
) -> None:
    """`tau` in samples; the delay that a low-pass has as well is looked for apart."""
    fs, n = 1000.0, 800
    middle = slice(300, 500)
    s = 2.0j * np.pi * frequency * tau
    true = np.exp(1j * (2.0 * np.pi * frequency * np.arange(n) + phase))
    behind = true * np.exp(s) / (1.0 + s)
    size = 0.5 * (tau / fs) ** 2
    undone = _without_lag("q", size, fs).whole(behind.real)
    np.testing.assert_allclose(undone[middle], true.real[middle], atol=1e-4)
    # a force that acts behind a lag is its command through it
    lagged = _without_lag("q", -size, fs).whole(true.real)
    np.testing.assert_allclose(lagged[middle], behind.real[middle], atol=1e-4)


@given(tau=st.floats(0.01, 30.0), level=st.floats(-1e3, 1e3))
def test_a_constant_is_not_changed_by_a_low_pass(tau: float, level: float) -> None:
    for sign in (1.0, -1.0):
        undone = _without_lag("q", sign * 0.5 * tau**2, 1.0).whole(np.full(50, level))
        np.testing.assert_allclose(undone, level, rtol=1e-9, atol=1e-9)


def test_sizes_of_delays_and_lags_are_told_in_samples() -> None:
    delay, lag, gain = (EFFECTS[name] for name in ("delay of q_c", "bandwidth of q_c", "gain of q_c"))
    assert delay.samples(-2e-3, 1000.0) == pytest.approx(2.0)
    assert lag.samples(0.5 * 3e-3**2, 1000.0) == pytest.approx(3.0)
    assert gain.samples(0.5, 1000.0) == 0.0
    assert "by 50 us" in delay.said(50e-6)
    assert "about 86 us" in lag.said(0.5 * 86e-6**2)


def test_an_edit_reads_no_more_than_its_channel() -> None:
    record = Record({"q": np.arange(40.0), "r": np.zeros(40)}, 100.0, "run")
    lag = Effect("lag of q", "lag", "q is behind", "", "mend it", lambda simulated: {}, "q", _without_lag)
    moved = lag.corrected(record, 0.5 * 0.02**2)
    assert moved.n == record.n
    np.testing.assert_array_equal(moved.signals["r"], record.signals["r"])
    assert np.any(moved.signals["q"] != record.signals["q"])
