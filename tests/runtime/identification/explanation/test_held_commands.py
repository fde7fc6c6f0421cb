"""Commands that a drive holds: found by their half sample, undone with the average that goes with it."""

from __future__ import annotations

import pytest

from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.iv.low_pass import without_lag
from modelgen.runtime.least_squares.time_shifts import shift
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.two_mass_records import NOISE, SMALL, TRUTH

FS = 2000.0


def told_held(estimate: Estimate) -> list[str]:
    return [one.where for one in estimate.checks.advice if "held over every sample" in one.what]


def chirp(drive: Drive | None, fs: float = FS) -> Record:
    options = {"fs": fs, "duration_s": 3.0, "noise": NOISE, "seed": 3}
    return simulate(SMALL, TRUTH, "chirp", drive=drive, **options).record  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_held_command_is_taken_for_one_without_being_told() -> None:
    record = chirp(Drive(rate_hz=FS))
    estimate, told = identify(SMALL, record), identify(SMALL, record, Auto(held=("Gamma_m",)))
    assert told_held(estimate) == ["Gamma_m"]
    assert not told_held(told)
    for name in ("J_m", "J_c", "K"):
        assert abs(estimate.params[name] - TRUTH[name]) < 3.0 * estimate.bse[name]
        assert estimate.bse[name] < 2e-3 * TRUTH[name]
        assert abs(estimate.params[name] - told.params[name]) < 2.0 * estimate.bse[name]


@pytest.mark.slow
def test_a_force_that_is_on_time_is_none() -> None:
    assert not told_held(identify(SMALL, chirp(None)))


@pytest.mark.slow
def test_a_command_that_acts_a_sample_later_is_held_as_well() -> None:
    record = chirp(Drive(rate_hz=FS, delay_s=1.0 / FS))
    estimate = identify(SMALL, record)
    assert told_held(estimate) == ["Gamma_m"]
    for name in ("J_m", "J_c", "K"):
        assert abs(estimate.params[name] - TRUTH[name]) < 3.0 * estimate.bse[name]
        assert estimate.bse[name] < 2e-3 * TRUTH[name]


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1.5, 8.0])
def test_a_current_loop_that_lags_is_no_hold(samples: float) -> None:
    # a lag of one and a half samples is late by as much as a hold that acts a sample later
    estimate = identify(SMALL, behind_lag(chirp(None), samples))
    assert not told_held(estimate)
    assert "acts behind a lag" in " ".join(one.what for one in estimate.checks.advice)
    for name in ("J_m", "J_c", "K"):
        assert abs(estimate.params[name] - TRUTH[name]) < 3.0 * estimate.bse[name]
        assert estimate.bse[name] < 1e-2 * TRUTH[name]


def behind_lag(record: Record, samples: float) -> Record:
    """Return a record of the command whose force, behind a lag of so many samples, is what is recorded."""
    key, size = "Gamma_m", 0.5 * (samples / record.fs) ** 2
    record = record.edited({key: without_lag(key, size, record.fs)})
    return record.edited({key: shift(key, samples)})


@pytest.mark.slow
def test_a_hold_that_a_low_pass_would_undo_is_none() -> None:
    record = chirp(None)
    early = record.edited({"Gamma_m": shift("Gamma_m", 1.5)})
    assert not told_held(identify(SMALL, early))
