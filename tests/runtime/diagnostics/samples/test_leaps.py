"""Leaps of positions: wrong readings are interpolated, records cut where samples are missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generated import three_mass_va_vb_vc
from modelgen.report.page import report_page
from modelgen.runtime.curves.rebuilt import rebuild
from modelgen.runtime.diagnostics.samples.leaps import leaps_of, told_leaps, without_leaps
from modelgen.runtime.diagnostics.thresholds import MOST_CUTS
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.channels import EditedChannels
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import FS, NOISE, SMALL, TRUTH, assert_truth_inside, two_mass_records

SPEEDS = model_from_module(three_mass_va_vb_vc)


def without(record: Record, *gaps: slice) -> Record:
    """Return the record with samples lost in all channels."""
    kept = np.ones(record.n, bool)
    for gap in gaps:
        kept[gap] = False
    signals = {key: samples[kept] for key, samples in record.signals.items()}
    return Record(signals, record.fs, record.name, record.tag)


def wrong(record: Record, key: str, places: list[int], by: float) -> Record:
    """Return the record with readings of a channel off at some samples."""
    samples = record.signals[key].copy()
    samples[places] += by
    return record.edited({key: samples})


def standing(record: Record, keys: tuple[str, ...], places: list[int], more: int) -> Record:
    """Return the record with a reading of some channels repeated for so many samples more."""
    signals = {key: record.signals[key].copy() for key in keys}
    for samples in signals.values():
        for place in places:
            samples[place + 1 : place + 1 + more] = samples[place]
    return record.edited(signals)


def test_of_sound_records_nothing_is_changed() -> None:
    records = two_mass_records()
    assert all(new is old for new, old in zip(without_leaps(SMALL, records), records, strict=True))


def test_a_velocity_that_a_switched_force_bends_does_not_leap() -> None:
    t = np.arange(4000) / FS
    force = np.where((t * 7.0) % 1.0 < 0.5, 1.0, -1.0)
    noise = 1e-7 * np.random.default_rng(3).standard_normal((2, t.size))
    speed = np.cumsum(force) / FS
    record = Record({"v_a": speed + noise[0], "v_b": speed + noise[1], "v_c": speed, "tau_a": force}, FS)
    assert leaps_of(SPEEDS, record) == ()
    (leap,) = leaps_of(SPEEDS, wrong(record, "v_b", [1000], 1e-3))
    assert leap.bridged and leap.first < 1000 < leap.last


@pytest.mark.parametrize("in_file", [False, True])
@pytest.mark.parametrize("places", [[3000], [3000, 3001, 3002], [10, 4000, 9150], list(range(90, 9000, 130))])
def test_wrong_readings_are_interpolated(places: list[int], in_file: bool) -> None:
    record = two_mass_records()[0]
    off = wrong(record, "q_c", places, 1.0)
    if in_file:
        off = Record.over(EditedChannels(off, off.name, off.n))
    (mended,) = without_leaps(SMALL, [off])
    moved = mended.signals["q_c"] - record.signals["q_c"]
    assert set(places) <= set(np.flatnonzero(moved).tolist())
    assert np.count_nonzero(moved) <= 5 * len(places)
    assert np.max(np.abs(moved)) < 12.0 * NOISE["q_c"]
    assert mended.in_memory is not in_file


@pytest.mark.parametrize("in_file", [False, True])
@pytest.mark.parametrize("keys", [("q_c",), ("q_m", "q_c", "Gamma_m")])
def test_frames_that_were_lost_are_interpolated(keys: tuple[str, ...], in_file: bool) -> None:
    record, places = two_mass_records()[1], [2000, 2012, 2600, 3400]
    lossy = standing(record, keys, places, 5)
    if in_file:
        lossy = Record.over(EditedChannels(lossy, lossy.name, lossy.n))
    leaps = leaps_of(SMALL, lossy)
    assert [(leap.first, leap.last, leap.keys) for leap in leaps] == [(p, p + 6, keys) for p in places]
    (mended,) = without_leaps(SMALL, [lossy])
    for key in keys:
        moved = np.abs(mended.signals[key] - record.signals[key])
        assert np.count_nonzero(moved) == 5 * len(places)
        was = np.max(np.abs(lossy.signals[key] - record.signals[key]))
        assert np.max(moved) < (12.0 * NOISE[key] if key != "Gamma_m" else was)
    told = next(told_leaps(SMALL, lossy))
    assert told.kind == "leap" and told.what.endswith("these readings are interpolated")


def test_a_position_that_no_row_needs_tells_of_frames_that_speeds_lost() -> None:
    chirp = two_mass_records()[1]
    speeds = {f"v_{body}": np.gradient(chirp.signals["q_m"], chirp.dt) for body in "abc"}
    record = Record({**speeds, "q_a": chirp.signals["q_m"], "Gamma_a": chirp.signals["Gamma_m"]}, FS)
    lossy = standing(record, ("v_a", "q_a", "Gamma_a"), [2500], 4)
    needed = replace(
        SPEEDS, sensors=(*SPEEDS.sensors, replace(SPEEDS.sensors[0], key="q_a", measures="position"))
    )
    assert [leap.keys for leap in leaps_of(needed, lossy)] == [("v_a", "Gamma_a", "q_a")]


def test_a_mass_that_rests_or_sticks_does_not_stand_in_its_motion() -> None:
    record = two_mass_records()[1]
    coarse = {key: 1e-3 * np.round(record.signals[key] / 1e-3) for key in ("q_m", "q_c")}
    t = np.arange(5000) / FS
    slips = np.concatenate([np.full(500, 0.2), 0.2 + 3.0 * t**2])  # force breaks it away at once
    sticks = {key: slips + noise for key, noise in (("q_m", 0.0), ("q_c", 1e-9))}
    force = np.sin(np.arange(5500.0))
    for one in (record.edited(coarse), Record({**sticks, "Gamma_m": force}, FS)):
        assert leaps_of(SMALL, one) == ()


def test_a_reading_that_is_lost_at_rest_or_next_to_another_is_interpolated() -> None:
    t = np.arange(5000) / FS
    moved = 1e-6 * np.round(1e6 * (0.3 + 0.2 * np.cumsum(np.sin(2.0 * np.pi * 3.0 * t).clip(0.0)) / FS))
    record = Record({"q_m": moved, "q_c": moved, "Gamma_m": np.cos(t)}, FS)
    resting = int(np.flatnonzero((np.diff(moved) == 0.0) & (t[1:] > 0.2))[40])
    places = [resting, 2000, 2010]
    lost = record.signals["q_c"].copy()
    for place in places:
        lost[place : place + 3] = 0.0
    (mended,) = without_leaps(SMALL, [record.edited({"q_c": lost})])
    np.testing.assert_allclose(mended.signals["q_c"], record.signals["q_c"], atol=4e-6)


def test_a_record_is_cut_where_samples_are_missing() -> None:
    record = two_mass_records()[0]
    parts = without_leaps(SMALL, [without(record, slice(3000, 3037))])
    (leap,) = leaps_of(SMALL, without(record, slice(3000, 3037)))
    assert leap.first < 3000 <= leap.last
    assert [part.name for part in parts] == ["chirp from sample 0", f"chirp from sample {leap.last}"]
    np.testing.assert_array_equal(parts[0].signals["q_m"], record.signals["q_m"][: leap.first + 1])
    np.testing.assert_array_equal(parts[1].signals["q_m"], record.signals["q_m"][37 + leap.last :])


def test_an_encoder_that_loses_steps_cuts_too_and_short_parts_are_left_out() -> None:
    record = two_mass_records()[0]
    shifted = record.signals["q_c"] + 0.5 * (np.arange(record.n) > record.n - 500)
    (part,) = without_leaps(SMALL, [record.edited({"q_c": shifted})])
    assert part.name == "chirp from sample 0"
    assert abs(part.n - (record.n - 499)) < 4


def test_a_record_of_many_pieces_stays_one() -> None:
    chirp = two_mass_records()[0]
    # there and back, twice
    signals = {key: np.tile(np.r_[samples, samples[::-1]], 2) for key, samples in chirp.signals.items()}
    gaps = [slice(start, start + 40) for start in range(1500, 4 * chirp.n, 4000)]
    lossy = without(Record(signals, FS, "chirps"), *gaps)
    assert len(leaps_of(SMALL, lossy)) > MOST_CUTS
    assert without_leaps(SMALL, [lossy]) == (lossy,)


@pytest.mark.slow
def test_missing_samples_and_wrong_readings_spoil_no_estimate() -> None:
    chirp, trapezoid = two_mass_records()
    records = [without(chirp, slice(4000, 4037)), wrong(trapezoid, "q_c", [2000, 5000], 0.3)]
    estimate = identify(SMALL, records)
    assert_truth_inside(estimate, TRUTH)
    assert {one.kind for one in estimate.checks.advice} == {"leap"}
    assert estimate.bse["K"] < 0.01 * TRUTH["K"]
    rows, _ = rebuild(SMALL, records, estimate)
    assert {one.record for one in rows} == set(estimate.records)
    assert len(estimate.records) == 3
    page = report_page(SMALL, records, estimate)
    assert all(f"{name}, row m" in page for name in estimate.records)
    axes = estimate.plot.residuals(records, model=SMALL)
    assert len(axes) >= 3
