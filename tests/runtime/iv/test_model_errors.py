"""Effects that a model may lack: what physics allows, what is said of them, how channels are set right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from generated import emps_rigid_qm
from modelgen.errors import IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.iv.companion_simulation import Led, Simulated, simulated_beside
from modelgen.runtime.iv.effect import Effect, unlike
from modelgen.runtime.iv.effect_rows import simulated_records
from modelgen.runtime.iv.low_pass import low_pass, without_average, without_lag
from modelgen.runtime.iv.model_errors import effects_of, zero_effects
from modelgen.runtime.model.mechanical_parts import Role
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import FS, GEARED, RAMPS, SMALL, TRUTH, two_mass_records

BODIES = ("m", "c")
EVERY = effects_of(SMALL, BODIES, RAMPS)
EFFECTS = {effect.name: effect for effect in EVERY}
FRICTIONS = [
    f"{form} friction on {body}"
    for form in ("viscous", "Coulomb", "quadratic", "Stribeck")
    for body in BODIES
    if f"{form} friction on {body}" in EFFECTS
]


def test_every_effect_has_a_name_of_its_own_and_words() -> None:
    # a limit of a force is looked for at several levels, and what changes along several courses
    several = [effect for effect in EVERY if effect.kind == "saturation" or effect.name.startswith("drift")]
    names = [effect.name for effect in EVERY if effect not in several]
    assert len(set(names)) == len(names)
    assert len({effect.name for effect in EVERY} - set(names)) == 4
    for effect in EFFECTS.values():
        assert effect.words
        assert effect.remedy
        assert effect.possible(1.0)
        assert effect.possible(-1.0) is bool(effect.negative)
        for size in (1e-4, -1e-4) if effect.negative else (1e-4,):
            words = effect.words if size > 0.0 else effect.negative
            assert effect.said(size).startswith(words.split(": ")[0])


def test_no_force_acts_behind_a_low_pass_before_that_lets_it() -> None:
    lag = EFFECTS["lag of Gamma_m"]
    (average,) = lag.forms
    size = -0.5e-6  # a lag of 1 ms; an average over 3.5 ms, late by half of that
    for effect, least in ((lag, 0.5e-3), (average, 0.5e-3 * np.sqrt(3.0))):
        for late, follows in ((0.8 * least, False), (1.5 * least, True), (-least, False)):
            assert effect.follows(size, {"Gamma_m": -late}, FS) == follows
        # a reading may be filtered without a delay, and of other delays nothing may be known
        assert effect.follows(-size, {"Gamma_m": 0.0}, FS)
        assert effect.follows(size, {}, FS)
    assert EFFECTS["delay of q_c"].follows(-1.0, {"Gamma_m": 0.0}, FS)


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


def test_an_encoder_that_rows_differentiate_has_no_zero() -> None:
    # what a constant does to a derivative is rounding
    rigid = model_from_module(emps_rigid_qm)
    names = [effect.name for effect in effects_of(rigid, ("m",), two_mass_records())]
    assert "delay of q_m" in names
    assert not [name for name in names if name.startswith("zero")]


@pytest.mark.parametrize("samples", [0.25, -0.25, 1.0])
def test_a_late_channel_is_set_right_and_the_others_stay(samples: float) -> None:
    (late, _), (right, _) = two_mass_records(late={"q_c": samples}, noise=0.0), two_mass_records(noise=0.0)
    found = EFFECTS["delay of q_c"].corrected(late, 0, samples / FS)
    np.testing.assert_allclose(found.signals["q_c"][20:-20], right.signals["q_c"][20:-20], atol=1e-8)
    np.testing.assert_array_equal(found.signals["q_m"], late.signals["q_m"])
    assert EFFECTS["delay of q_c"].corrected(late, 0, 0.0) is late
    # what has no edit stays in the rows
    assert EFFECTS["constant force on c"].corrected(late, 0, 0.1) is late


def test_a_channel_with_a_wrong_gain_is_set_right() -> None:
    right, _ = two_mass_records(noise=0.0)
    wrong = replace(right, signals={**right.signals, "q_c": 1.03 * right.signals["q_c"]})
    found = EFFECTS["gain of q_c"].corrected(wrong, 0, 0.03)
    np.testing.assert_allclose(found.signals["q_c"], right.signals["q_c"], rtol=1e-12)
    np.testing.assert_array_equal(found.signals["q_m"], right.signals["q_m"])


@given(ppm=st.floats(-3000.0, 3000.0), frequency=st.floats(0.0, 0.1), phase=st.floats(0.0, 6.3))
def test_a_channel_of_another_clock_is_set_right(ppm: float, frequency: float, phase: float) -> None:
    n, size = 4000, 1e-6 * ppm
    samples = np.arange(n)
    wave = lambda at: np.cos(2.0 * np.pi * frequency * at + phase)  # noqa: E731
    read = Record({"q_c": wave(samples * (1.0 + size))}, 1000.0, "run")
    found = EFFECTS["clock of q_c"].corrected(read, 0, size).signals["q_c"]
    middle = slice(30, n - 30)
    np.testing.assert_allclose(found[middle], wave(samples)[middle], atol=2e-4)
    assert not EFFECTS["clock of q_c"].runs_away(size, 1000.0)
    assert EFFECTS["clock of q_c"].runs_away(0.02, 1000.0)


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
    undone = without_lag("q", size, fs).whole(behind.real)
    np.testing.assert_allclose(undone[middle], true.real[middle], atol=3e-6)
    # a force that acts behind a lag is its command through it
    lagged = without_lag("q", -size, fs).whole(true.real)
    np.testing.assert_allclose(lagged[middle], behind.real[middle], atol=3e-6)


@given(tau=st.floats(0.01, 30.0), level=st.floats(-1e3, 1e3))
def test_a_constant_is_not_changed_by_a_low_pass(tau: float, level: float) -> None:
    for sign in (1.0, -1.0):
        undone = without_lag("q", sign * 0.5 * tau**2, 1.0).whole(np.full(50, level))
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
    lag = Effect("lag of q", "lag", "q is behind", "", "mend it", lambda simulated: {}, "q",
                 lambda key, size, record: without_lag(key, size, record.fs))  # fmt: skip
    moved = lag.corrected(record, 0, 0.5 * 0.02**2)
    assert moved.n == record.n
    np.testing.assert_array_equal(moved.signals["r"], record.signals["r"])
    assert np.any(moved.signals["q"] != record.signals["q"])


@given(
    length=st.floats(0.1, 2.0),
    frequency=st.floats(0.0, 0.1),
    phase=st.floats(0.0, 6.3),
)
def test_an_average_is_made_and_undone_below_a_tenth_of_the_sampling_frequency(
    length: float, frequency: float, phase: float
) -> None:
    """`length` in samples; an average around each instant has no phase."""
    fs, n = 1000.0, 800
    middle = slice(300, 500)
    true = np.cos(2.0 * np.pi * frequency * np.arange(n) + phase)
    mean = true * np.sinc(frequency * length)
    size = (length / fs) ** 2 / 24.0
    undone = without_average("q", size, fs).whole(mean)
    np.testing.assert_allclose(undone[middle], true[middle], atol=1e-4)
    held = without_average("q", -size, fs).whole(true)
    np.testing.assert_allclose(held[middle], mean[middle], atol=1e-4)


def test_forms_of_one_thing_are_looked_for_only_beside_it() -> None:
    lag, late = low_pass("q", force=True), EFFECTS["delay of q_c"]
    (average,) = lag.forms
    assert unlike([late, lag], []) == (late, lag)
    assert unlike([late, lag], [lag]) == (late, average)
    assert unlike([late, lag], [average]) == (late, lag)
    assert unlike([late, lag], [lag, average, late]) == ()
    assert average.samples(-((3e-3) ** 2) / 24.0, 1000.0) == pytest.approx(3.0)
    assert "(over about 2e+02 us)" in average.said(-(2e-4**2) / 24.0)


def test_what_a_longer_lag_adds_is_the_change_of_what_undoes_it() -> None:
    """The column of a lag belongs to its present size: a tenth of a turn apart from that of none."""
    lag, fs, n = EFFECTS["bandwidth of q_c"], 5000.0, 4000
    t = np.arange(n) / fs
    record = Record({"q_c": np.sin(2.0 * np.pi * 150.0 * t)}, fs, "run")
    simulated = Simulated(None, record, {}, 0)  # type: ignore[arg-type]
    middle = slice(1000, 3000)
    for size in (-0.5 * 5e-4**2, 0.5 * 5e-4**2):
        step = 0.02 * abs(size)
        # set right up to a size, it still lacks a step
        back = without_lag("q_c", -size, fs).whole(record.signals["q_c"])
        less, more = (without_lag("q_c", size + by, fs).whole(back) for by in (-step, step))
        found = (less - more) / (2.0 * step)
        expected = lag.added(simulated, size)["q_c"]
        scale = float(np.max(np.abs(expected[middle])))
        np.testing.assert_allclose(found[middle], expected[middle], atol=0.02 * scale)
    np.testing.assert_array_equal(lag.added(simulated, 0.0)["q_c"], lag.changes(simulated)["q_c"])


def simulated_pair(scale: float) -> tuple[Simulated, Simulated]:
    """A noise-free record as the model reads it, and the same with the motion of all bodies scaled."""
    record = two_mass_records(noise=0.0)[0]
    one = simulated_beside(SMALL, TRUTH, record, choose_filter(SMALL, (record,)))
    one = replace(one, slow={"m": 1.0, "c": 1.0})
    motion = {key: scale * samples for key, samples in one.motion.items()}
    led = {}
    for body in one.plant.bodies:
        speed, away = one.led[body].speed, one.led[body].away
        assert away is not None
        led[body] = Led(scale * speed, replace(away, motion=scale * away.motion, noise=scale**2 * away.noise))
    return one, replace(one, motion=motion, led=led)


@pytest.mark.parametrize(
    ("name", "power"),
    [
        ("stiffening of K", 3),
        ("backlash of K", 0),
        ("quadratic friction on c", 2),
        ("viscous friction on c", 1),
        ("Coulomb friction on c", 0),
        ("constant force on c", 0),
        ("friction on m with the force in K", 1),
        ("course of K along q_m", 1),
        ("course of Coulomb friction on m along q_m", 0),
    ],
)
def test_a_size_means_the_same_in_every_record(name: str, power: int) -> None:
    """A spring is as stiff in a slow record as in a fast one: what it adds follows from the motion alone."""
    small, large = simulated_pair(3.0)
    of_small, of_large = (EFFECTS[name].changes(one) for one in (small, large))
    for key, samples in of_small.items():
        scale = float(np.max(np.abs(samples)))
        np.testing.assert_allclose(of_large[key], 3.0**power * samples, atol=1e-9 * 3.0**power * scale)


def test_a_link_without_stiffness_has_no_force_that_stiffens() -> None:
    one = simulated_pair(1.0)[0]
    without = replace(one, plant=replace(one.plant, parameters={**one.plant.parameters, "K": 0.0}))
    at = EFFECTS["stiffening of K"].at
    assert at is not None
    with pytest.raises(IdentifiabilityError, match="K: is zero at the estimate"):
        at(without, 1e-3)


def test_friction_that_falls_with_the_speed_has_one_speed_for_all_records() -> None:
    records = tuple(two_mass_records(noise=0.0))
    job = Job(SMALL, records, choose_filter(SMALL, records))
    fit = METHODS["iv"].run(job)[1]
    first, second = simulated_records(fit, job.setting())
    assert first.slow == second.slow
    assert all(speed > 0.0 for speed in first.slow.values())


def test_a_link_to_the_ground_is_named_by_both_its_ends() -> None:
    assert Role("stiffness", ("a", "b")).ends == "a and b"
    assert Role("stiffness", ("a",)).ends == "a and the ground"
