"""Order and cut-off from the spectra: what is chosen is checked in the time domain."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc, tree_mixed
from modelgen.runtime.filter_choice.derivative_noise import highest_derivatives
from modelgen.runtime.filter_choice.explain import percent
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter, distortion_bound_hz
from modelgen.runtime.filter_choice.thresholds import CUTOFF_STEP, LEAST_KEPT
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate

CHAIN, WITH_ACCELERATION = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
FS = 5000.0
T = np.arange(20000) / FS
# what the two bodies do: a sweep of their acceleration from 5 to 150 Hz, alike for both
PHASE = 2.0 * np.pi * (5.0 * T + 0.5 * 145.0 / T[-1] * T**2)
SWEEP_HZ = 5.0 + 145.0 / T[-1] * T
POSITION = -np.sin(PHASE) / (2.0 * np.pi * SWEEP_HZ) ** 2


def sweep(noise: float = 0.0, disturbance: np.ndarray | float = 0.0, seed: int = 0) -> Record:
    """The sweep as encoders read it, with white noise of `noise` rms and a disturbance in both."""
    rng = np.random.default_rng(seed)
    signals = {key: POSITION + disturbance + noise * rng.standard_normal(T.size) for key in ("q_m", "q_c")}
    return Record({**signals, "Gamma_m": np.sin(PHASE)}, FS, "sweep")


def behind(
    samples: np.ndarray, choice: FilterChoice, cutoff_hz: float | None = None, order: int = 0
) -> float:
    """Return the rms of a second derivative behind the filter, away from the ends."""
    smooth = zero_phase(samples, order or choice.filter_order, cutoff_hz or choice.cutoff_hz, FS)
    return float(np.std(differentiate(smooth, 1.0 / FS, 2)[2000:-2000]))


def white(noise: float) -> np.ndarray:
    return noise * np.random.default_rng(5).standard_normal(T.size)


def test_a_sensor_that_stands_still_takes_nothing_off_the_cutoff() -> None:
    """Noise that a cut-off leaves of it has no signal at any: a joint held still had ended at a tenth."""
    moving = sweep(1e-10)
    loud = 1e-6 * np.random.default_rng(3).standard_normal(T.size)
    record = Record({**moving.signals, "q_c": loud}, FS, "held")
    # by chance a line far beyond the dynamics stands out of it
    hum = Record({**record.signals, "q_c": loud + 1e-6 * np.sin(2.0 * np.pi * 800.0 * T)}, FS, "held")
    for one in (record, hum):
        choice = choose_filter(CHAIN, [one])
        assert choice.dynamics_hz is not None
        bound = distortion_bound_hz(choice.dynamics_hz, choice.filter_order)
        # a record of four seconds needs a higher one for its ends
        assert any(one.startswith(f"Cut-off {bound:.4g} Hz: a Butterworth") for one in choice.sentences)


def test_a_quiet_record_gets_what_its_dynamics_ask_for() -> None:
    choice = choose_filter(CHAIN, [sweep(1e-10)])
    assert choice.dynamics_hz is not None
    assert choice.filter_order == 4
    assert choice.cutoff_hz == distortion_bound_hz(choice.dynamics_hz, 4)
    said = " ".join(choice.sentences)
    assert "Order 4: the highest derivative and 2 more" in said
    assert "takes 5 % off" in said
    assert "The 2nd derivative of q_c stands out of its noise up to" in said
    assert choice.notes == ()


def test_the_cutoff_goes_down_until_noise_is_one_percent_of_the_highest_derivative() -> None:
    noise = 1e-7
    choice = choose_filter(CHAIN, [sweep(noise)])
    assert choice.dynamics_hz is not None
    ceiling = distortion_bound_hz(choice.dynamics_hz, 4)
    assert behind(white(noise), choice, ceiling) > 0.014 * behind(POSITION, choice, ceiling)
    assert choice.cutoff_hz < 0.95 * ceiling
    # the highest that does, within the ends that are left out here: two steps up and it is more than 1 %
    assert behind(white(noise), choice) <= 0.0108 * behind(POSITION, choice)
    above = choice.cutoff_hz / CUTOFF_STEP**2
    assert behind(white(noise), choice, above) > 0.0108 * behind(POSITION, choice, above)
    said = " ".join(choice.sentences)
    assert f"instead of {ceiling:.4g} Hz" in said
    assert "2nd derivative of q_" in said


def test_half_of_the_power_is_kept_however_loud_the_noise() -> None:
    choice = choose_filter(CHAIN, [sweep(1e-6)])
    assert choice.filter_order == 4  # white noise is no matter of the order
    whole = float(np.std(np.sin(PHASE)[2000:-2000]))
    assert (behind(POSITION, choice) / whole) ** 2 > 0.97 * LEAST_KEPT
    assert (behind(POSITION, choice, CUTOFF_STEP**2 * choice.cutoff_hz) / whole) ** 2 < LEAST_KEPT
    assert behind(white(1e-6), choice) > 0.01 * behind(POSITION, choice)


@pytest.mark.parametrize("amplitude", [1e-7, 1e-6])
def test_a_tone_beyond_the_cutoff_asks_for_a_higher_order(amplitude: float) -> None:
    hum = amplitude * np.sin(2.0 * np.pi * 280.0 * T)
    choice = choose_filter(CHAIN, [sweep(1e-10, hum)])
    dynamics = choice.dynamics_hz
    assert dynamics is not None
    assert 4 < choice.filter_order < 8
    assert behind(hum, choice) <= 0.0102 * behind(POSITION, choice)
    lower = choice.filter_order - 1
    cutoff = distortion_bound_hz(dynamics, lower)
    assert behind(hum, choice, cutoff, lower) > 0.0098 * behind(POSITION, choice, cutoff, lower)
    said = " ".join(choice.sentences)
    assert f"Order {choice.filter_order} instead of 4: of tones in q_" in said


def test_a_given_order_or_cutoff_is_left_alone() -> None:
    hum = 1e-6 * np.sin(2.0 * np.pi * 280.0 * T)
    assert choose_filter(CHAIN, [sweep(1e-6, hum)], filter_order=3).filter_order == 3
    given = choose_filter(CHAIN, [sweep(1e-6, hum)], cutoff_hz=200.0)
    assert (given.filter_order, given.cutoff_hz) == (4, 200.0)


def test_broad_motion_beyond_the_cutoff_is_no_tone() -> None:
    # what friction stirs up: no single lines, and as much of it as a tone that would count
    broad = zero_phase(white(1e-5), 6, 420.0, FS) - zero_phase(white(1e-5), 6, 260.0, FS)
    hum = np.sqrt(2.0) * float(np.std(broad)) * np.sin(2.0 * np.pi * 300.0 * T)
    assert choose_filter(CHAIN, [sweep(1e-10, broad)]).filter_order == 4
    assert choose_filter(CHAIN, [sweep(1e-10, hum)]).filter_order > 4
    # nor has a periodic motion one line alone
    comb = sum(np.sin(2.0 * np.pi * hz * T + hz**2) for hz in np.arange(260.0, 420.0, 4.0))
    periodic = float(np.std(broad)) / float(np.std(comb)) * comb
    assert choose_filter(CHAIN, [sweep(1e-10, periodic)]).filter_order == 4


def test_a_tone_that_the_force_excites_is_signal() -> None:
    tone = np.sin(2.0 * np.pi * 230.0 * T)
    quiet = sweep(1e-11, -0.5 * tone / (2.0 * np.pi * 230.0) ** 2)
    acceleration = np.sin(PHASE) + 0.5 * tone
    signals = {"q_m": quiet.signals["q_m"], "a_c": acceleration, "Gamma_m": np.sin(PHASE)}
    unexplained = choose_filter(WITH_ACCELERATION, [Record(signals, FS)])
    # of the force itself 0.08 % lie there, of its second derivative, which the rows need, 2 %
    driven = {**signals, "Gamma_m": np.sin(PHASE) + 0.028 * tone}
    explained = choose_filter(WITH_ACCELERATION, [Record(driven, FS)])
    assert explained.bands[0].force_hz < 150.0
    assert unexplained.filter_order > 6
    assert explained.filter_order == 6


def test_the_highest_derivative_that_rows_need_counts() -> None:
    orders = {one.channel: one.order for one in highest_derivatives(WITH_ACCELERATION, [])}
    assert orders == {"q_m": 4, "a_c": 2, "Gamma_m": 2}


def test_noise_of_the_force_does_not_widen_its_band() -> None:
    quiet, rng = sweep(1e-10), np.random.default_rng(2)
    force_hz = choose_filter(CHAIN, [quiet]).bands[0].force_hz
    for noise in (0.1, 0.5):
        force = quiet.signals["Gamma_m"] + noise * rng.standard_normal(T.size)
        loud = choose_filter(CHAIN, [Record({**quiet.signals, "Gamma_m": force}, FS)])
        # with the noise in it, a hundredth of its power would lie above 1000 Hz
        assert 0.9 * force_hz < loud.bands[0].force_hz <= force_hz
        # nor does it lower the cut-off: it is in no column of W
        assert loud.dynamics_hz is not None
        assert loud.cutoff_hz == distortion_bound_hz(loud.dynamics_hz, 4)


def test_noise_of_a_differentiated_force_does_not_lower_the_cutoff() -> None:
    force = np.sin(PHASE) + 0.05 * np.random.default_rng(3).standard_normal(T.size)
    quiet = {"q_m": POSITION, "a_c": np.sin(PHASE), "Gamma_m": force}
    choice = choose_filter(WITH_ACCELERATION, [Record(quiet, FS)])
    assert choice.dynamics_hz is not None
    assert any("The 2nd derivative of Gamma_m" in sentence for sentence in choice.sentences)
    assert choice.cutoff_hz == distortion_bound_hz(choice.dynamics_hz, 6)


def test_a_derivative_that_no_record_shows_is_warned_of() -> None:
    blind = {**sweep(1e-10).signals, "q_c": white(1e-6)}
    choice = choose_filter(CHAIN, [Record(blind, FS, "blind")])
    (note,) = choice.notes
    assert "the 2nd derivative of q_c, which the rows need, does not stand out of its noise in blind" in note
    assert "use a better sensor" in note
    # the other body's dynamics are still those of the sweep
    assert choice.dynamics_hz == choose_filter(CHAIN, [sweep(1e-10)]).dynamics_hz


def test_a_long_record_gets_its_filter_from_stretches(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = choose_filter(CHAIN, [sweep(1e-7)])
    monkeypatch.setattr("modelgen.runtime.records.record_facts.WHOLE", 8192)
    record = sweep(1e-7)
    assert {len(part) for part in record.facts.stretches("q_m")} == {2048}
    cut = choose_filter(CHAIN, [record])
    # stretches end before the sweep does
    assert 0.8 * whole.cutoff_hz < cut.cutoff_hz <= whole.cutoff_hz
    assert len(cut.decimation) == len(cut.bands) == 1


@lru_cache
def loud_records() -> tuple[Record, ...]:
    """The lightly damped axis, with fifty times the encoder noise of benchmarks/interval_coverage.py."""
    return tuple(
        simulate(
            CHAIN,
            CHAIN.parameter_sets["light"],
            kind,
            fs=FS,
            duration_s=2.0,
            oversample=oversample,
            noise={"q_m": 1e-3, "q_c": 1e-3, "Gamma_m": 1e-4},
        ).record
        for kind, oversample in (("chirp", 32), ("trapezoid", 8))
    )


def test_least_squares_errs_less_where_the_noise_sets_the_cutoff() -> None:
    truth = CHAIN.parameter_sets["light"]
    chosen = identify(CHAIN, loud_records(), **values_of("wls", drift_check=False))
    dynamics = chosen.fit.filtering.dynamics_hz
    assert dynamics is not None
    before = identify(
        CHAIN,
        loud_records(),
        **values_of("wls", drift_check=False, cutoff_hz=distortion_bound_hz(dynamics, 4)),
    )
    for name in ("J_m", "F_vm", "F_sm"):
        errors = [abs(estimate.params[name] / truth[name] - 1.0) for estimate in (chosen, before)]
        assert errors[0] < 0.4 * errors[1], name


def test_a_steady_drift_in_noise_asks_for_no_cutoff() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(4000) / 1000.0
    drifting = {key: 5.0 * t + 1e-2 * rng.standard_normal(t.size) for key in ("q_m", "q_c")}
    force = np.sin(2.0 * np.pi * 3.0 * t) + np.sin(2.0 * np.pi * 11.0 * t) + 1.0
    record = Record({**drifting, "Gamma_m": force}, 1000.0, "drift")
    choice = choose_filter(CHAIN, [record])
    assert choice.cutoff_hz > 0.1
    assert sum("does not stand out of its noise" in note for note in choice.notes) == 2
    # what is warned of is not praised as well
    assert not any("stands out" in sentence and "q_" in sentence for sentence in choice.sentences)


def test_a_force_at_rest_is_no_lost_derivative() -> None:
    chain = model_from_module(tree_mixed)
    resting = simulate(chain, chain.parameter_sets["nominal"], "chirp").record
    assert not resting.signals["Gamma_b"].any()
    said = choose_filter(chain, [resting])
    assert not any("Gamma_b" in line for line in (*said.notes, *said.sentences))


@pytest.mark.parametrize(
    ("level_db", "text"), [(-40.0, "1 %"), (0.0, "100 %"), (1.0, "110 %"), (30.0, "3200 %")]
)
def test_levels_are_written_out(level_db: float, text: str) -> None:
    assert percent(level_db) == text
