"""Warnings about samples: every fault is named with channel and samples, and a good record has none."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.samples.stuck_readings import equal_runs
from modelgen.runtime.diagnostics.samples.suspicious_samples import misread, suspicions
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from tests.runtime import measured_records
from tests.runtime.faulty_records import (
    AC,
    BENCH,
    QC,
    RIGID,
    TREE,
    VELOCITIES,
    FloatArray,
    clipped,
    cut_off,
    faulty,
    held,
    only,
    simulated,
)


@pytest.fixture(scope="module")
def trapezoid() -> Record:
    return simulated(AC, "trapezoid", noise=True)


@pytest.fixture(scope="module")
def chirp() -> Record:
    return simulated(AC, "chirp", noise=True)


# Good records -------------------------------------------------------------------------------------


def test_measured_records_are_not_suspected(emps: Record, bench: Record) -> None:
    assert suspicions(RIGID, [emps]) == ()
    assert suspicions(BENCH, [bench]) == ()


@pytest.mark.parametrize("axis", range(1, 7))
def test_an_axis_of_a_robot_at_rest_is_not_suspected(axis: int, shared_data: Path) -> None:
    model, record = measured_records.robot_axis(shared_data, axis)
    assert equal_runs(record.signals["q_a"]).lengths.max() > 50
    assert suspicions(model, [record]) == ()


def dwells(seed: int, turns: int, digits: int) -> Record:
    """An encoder of a drive that rests between its moves, in a file with so many significant digits."""
    rng = np.random.default_rng(seed)
    stops = 50.0 * turns * rng.uniform(-1.0, 1.0, 8)
    share = np.clip(np.linspace(-0.5, 1.5, 3000), 0.0, 1.0)
    moves = [a + (b - a) * (3.0 - 2.0 * share) * share**2 for a, b in pairwise(stops.tolist())]
    counts = 2.0 * np.pi / 65536
    wobble = np.repeat(rng.integers(0, 2, 7 * 100), 30)
    exact = (np.round(np.concatenate(moves) / counts) + wobble) * counts
    written = np.array([float(f"{reading:.{digits}g}") for reading in exact.tolist()])
    force = rng.normal(size=len(written))
    force[:900] = 0.5  # until its amplifier is switched on
    return Record({"q_m": written, "F": force}, 1000.0, "dwells")


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("turns", "digits"), [(1, 5), (1, 7), (10, 6), (30, 12)])
def test_a_drive_that_rests_between_its_moves_is_not_suspected(turns: int, digits: int, seed: int) -> None:
    assert [one for one in suspicions(RIGID, [dwells(seed, turns, digits)]) if one.kind != "unit"] == []


def test_a_filtered_reading_of_an_axis_that_sticks_where_it_turns_is_not_suspected() -> None:
    fs, n, held_for = 2000.0, 16000, 60
    turning = np.arange(n) % 1000 < 1000 - held_for  # half a swing, and a while at its end
    phase = np.pi * np.cumsum(turning) / (1000 - held_for)
    counts = np.round(2**17 * np.cos(phase) / 6.0) * 6.0 / 2**17
    read = lfilter([0.7], [1.0, -0.3], counts, zi=[0.3 * counts[0]])[0]
    load = np.cos(phase + 0.01 * np.sin(0.05 * np.arange(n)))  # goes on meanwhile
    force = np.sin(phase) + 0.01 * np.random.default_rng(0).standard_normal(n)
    sound = {"q_m": read, "q_c": load, "Gamma_m": force}
    assert only_kinds(Record(sound, fs)).isdisjoint({"clipped", "stuck"})
    assert "clipped" in only_kinds(Record(sound | {"q_m": np.clip(read, -0.9, 0.9)}, fs))


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_a_noisy_encoder_that_is_stuck_during_a_move_is_told(share: float) -> None:
    record = dwells(0, 1, 12)
    noise = 1e-3 * np.random.default_rng(1).normal(size=record.n)
    first = 3000 + 750 + int(1500 * share)
    stuck = Record({"q_m": held(first, 60)(record.signals["q_m"] + noise), "F": record.signals["F"]}, 1000.0)
    assert f"samples {first} to {first + 59}" in "".join(
        one.where for one in suspicions(RIGID, [stuck]) if one.kind == "stuck"
    )


@pytest.mark.parametrize("noise", [False, True])
@pytest.mark.parametrize("kind", ["chirp", "trapezoid"])
@pytest.mark.parametrize("model", [QC, AC], ids=["qm_qc", "qm_ac"])
def test_true_stick_slip_is_not_suspected(model: Model, kind: str, noise: bool) -> None:
    record = simulated(model, kind, noise)
    if not noise and kind == "trapezoid":  # the case that this is about: the axis stands during the dwells
        assert equal_runs(record.signals["q_m"]).lengths.max() > 50
    assert suspicions(model, [record]) == ()


@pytest.mark.parametrize("kind", ["chirp", "trapezoid"])
def test_encoders_of_usual_resolution_are_not_suspected(kind: str) -> None:
    step = 2.0 * np.pi / 20_000
    assert suspicions(QC, [simulated(QC, kind, resolution={"q_m": step, "q_c": step})]) == ()


def test_an_actuator_that_rests_beside_another_is_not_suspected() -> None:
    record = simulated(TREE, "chirp")
    assert np.ptp(record.signals["Gamma_b"]) == 0.0
    assert suspicions(TREE, [record]) == ()


def test_a_square_wave_and_a_ramp_with_plateaus_are_commands_not_clipped() -> None:
    t = np.arange(4000) / 1000.0
    position = np.sin(2.0 * np.pi * t)
    square = np.where(np.sin(2.0 * np.pi * 1.5 * t) >= 0.0, 20.0, -20.0)
    assert suspicions(RIGID, [Record({"q_m": position, "F": square}, 1000.0)]) == ()
    ramp = np.clip(80.0 * np.abs((t % 1.0) - 0.5) - 20.0, -10.0, 10.0)
    assert suspicions(RIGID, [Record({"q_m": position, "F": ramp}, 1000.0)]) == ()


def beside(force: FloatArray) -> Record:
    """The force beside an encoder of an axis that it moves, with noise."""
    rng = np.random.default_rng(0)
    moved = np.cumsum(np.cumsum(force - force.mean()))
    moved *= 1.0 / np.ptp(moved)
    return Record({"q_m": moved + 1e-5 * rng.normal(size=len(force)), "F": force}, 1000.0, "run")


def felt_counts(seed: int, often: float, seldom: float, periods: int) -> FloatArray:
    """A force under a controller that feels its encoder's counts, many a second and in a tenth of it few."""
    rng = np.random.default_rng(seed)
    rates = np.tile([often] * 9 + [seldom], periods).repeat(200)
    pulses = np.where(rng.uniform(size=len(rates)) < rates, -30.0, 0.0)
    wanted = 120.0 * np.sin(2.0 * np.pi * np.arange(len(rates)) / len(rates))
    return np.round(wanted + lfilter([1.0], [1.0, -0.5], pulses))


@pytest.mark.parametrize("seed", range(4))
def test_a_force_that_jumps_when_a_controller_feels_a_count_is_not_stuck_between(seed: int) -> None:
    assert suspicions(RIGID, [beside(felt_counts(seed, 0.3, 0.03, 2))]) == ()


@pytest.mark.parametrize("seed", range(4))
def test_repeated_readings_of_which_there_are_many_tell_how_long_they_last(seed: int) -> None:
    found = suspicions(RIGID, [beside(felt_counts(seed, 0.4, 0.05, 10))])
    assert "stuck" not in [one.kind for one in found]


@pytest.mark.parametrize("lag", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("hold", [10, 30])
def test_a_binary_command_behind_a_current_loop_is_not_clipped(lag: float, hold: int) -> None:
    command = np.repeat(np.random.default_rng(1).choice([-1.0, 1.0], 4000 // hold), hold)
    force = 1e-3 * np.round(1e3 * lfilter([1.0 - lag], [1.0, -lag], command))
    assert suspicions(RIGID, [beside(force)]) == ()


def test_a_force_that_is_cut_off_is_clipped_all_the_same() -> None:
    force = 1e-3 * np.round(1e3 * np.sin(2.0 * np.pi * 3.0 * np.arange(4000) / 1000.0))
    found = suspicions(RIGID, [beside(np.clip(force, -0.95, 0.95))])
    assert [one.kind for one in found] == ["clipped", "clipped"]


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize(
    ("first", "last", "told"), [(3000, 4000, False), (0, 900, False), (1500, 2550, True)]
)
def test_a_force_before_its_drive_is_on_or_after_that_is_not_stuck(
    noise: float, first: int, last: int, told: bool
) -> None:
    """To let an axis coast down is a good experiment; what reads nothing in the middle may be a cable."""
    times, rng = np.arange(4000) / 1000.0, np.random.default_rng(0)
    moved = times + 1e-5 * rng.standard_normal(4000)
    force = np.sin(2.0 * np.pi * 3.0 * times) + noise * rng.standard_normal(4000)
    force[first:last] = 0.0
    found = suspicions(RIGID, [Record({"q_m": moved, "F": force}, 1000.0, "run")])
    assert ("stuck" in [one.kind for one in found]) == told


@pytest.mark.parametrize("n", [2, 3, 4, 5, 10])
def test_records_of_a_few_samples_are_examined(n: int) -> None:
    samples = np.arange(float(n)) ** 2
    assert suspicions(RIGID, [Record({"q_m": samples, "F": samples}, 1000.0)])[1:] == ()


# Faults -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["q_m", "a_c", "Gamma_m"])
def test_a_stuck_sensor_is_named_with_its_samples(chirp: Record, key: str) -> None:
    found = only(AC, faulty(chirp, key, held(6000, 300)))
    assert (found.kind, found.where) == ("stuck", f"chirp, channel {key}, samples 6000 to 6299")
    assert "stays at one reading" in found.what
    assert found.remedy == "check its cable, or cut the record there"


@pytest.mark.parametrize("key", ["q_m", "a_c", "Gamma_m"])
def test_a_cable_that_comes_off_is_a_stuck_sensor(chirp: Record, key: str) -> None:
    found = only(AC, faulty(chirp, key, cut_off(6000, 100)))
    assert (found.kind, found.where) == ("stuck", f"chirp, channel {key}, samples 6000 to 6099")
    assert "one reading (0)" in found.what


def test_a_channel_that_holds_the_readings_of_another_is_named() -> None:
    record = simulated(QC, "trapezoid", noise=True)
    assert only_kinds(record) == set()
    copied = Record({**record.signals, "q_c": record.signals["q_m"].copy()}, record.fs, "trapezoid")
    (found,) = (one for one in suspicions(QC, [copied]) if one.kind == "copied")
    assert found.where == f"trapezoid, channel q_c, samples 0 to {record.n - 1}"
    assert found.what == "holds the readings of q_m"
    nearly = copied.signals["q_c"].copy()
    nearly[17] = nearly[18]
    assert only_kinds(Record({**record.signals, "q_c": nearly}, record.fs)) == set()


def only_kinds(record: Record) -> set[str]:
    return {one.kind for one in suspicions(QC, [record])}


def test_a_sensor_without_noise_that_sticks_is_named() -> None:
    record = simulated(QC, "trapezoid")
    found = only(QC, faulty(record, "q_c", held(1500, 200)))
    assert (found.kind, found.where) == ("stuck", "trapezoid, channel q_c, samples 1500 to 1699")
    speeds = simulated(VELOCITIES, "chirp")
    found = only(VELOCITIES, faulty(speeds, "v_b", cut_off(5000, 60)))
    assert (found.kind, found.where) == ("stuck", "chirp, channel v_b, samples 5000 to 5059")


def test_a_position_that_stops_at_full_speed_until_the_end_is_stuck(emps: Record) -> None:
    found = only(RIGID, faulty(emps, "q_m", held(16_000, 10_000)))
    assert (found.kind, found.where) == ("stuck", "emps, channel q_m, samples 16000 to 24840")


@pytest.mark.parametrize("key", ["q_m", "i"])
def test_a_measured_channel_that_sticks_is_named(bench: Record, key: str) -> None:
    found = only(BENCH, faulty(bench, key, held(25_137, 200)))
    assert (found.kind, found.where) == ("stuck", f"bench, channel {key}, samples 25137 to 25336")


@pytest.mark.parametrize(("key", "noise"), [("a_c", True), ("a_c", False), ("Gamma_m", False)])
def test_clipped_readings_are_counted_at_both_ends(key: str, noise: bool) -> None:
    record = faulty(simulated(AC, "chirp", noise), key, clipped(0.1, 0.8))
    largest, smallest = suspicions(AC, [record])
    samples = record.signals[key]
    assert (largest.kind, smallest.kind) == ("clipped", "clipped")
    assert largest.where.startswith(f"chirp, channel {key}, samples ")
    assert "more stretches" in largest.where
    at_limit = np.sum(samples == samples.max())
    told = int(largest.what.split(" for ")[1].split(" ")[0])
    assert 0.9 * at_limit < told <= at_limit
    assert f"largest reading {samples.max():.6g}" in largest.what
    assert f"smallest reading {samples.min():.6g}" in smallest.what


def test_a_clipped_position_is_named(emps: Record) -> None:
    found = only(RIGID, faulty(emps, "q_m", clipped(0.0, 0.9)))
    assert (found.kind, found.what.split(" for ")[0]) == ("clipped", "stays at its largest reading 0.221738")


def test_a_coarse_sensor_is_told_its_resolution(emps: Record) -> None:
    step = np.ptp(emps.signals["q_m"]) / 40.0
    found = only(RIGID, faulty(emps, "q_m", lambda samples: np.round(samples / step) * step))
    assert (found.kind, found.where) == ("coarse", "emps, channel q_m, samples 0 to 24840")
    assert found.what == "spans 40 steps of its resolution 0.00616 m only"


def test_a_position_in_counts_is_told_to_be_one(emps: Record) -> None:
    found = only(RIGID, faulty(emps, "q_m", lambda samples: np.round(samples * 1e5)))
    assert (found.kind, found.what) == ("unit", "reads whole numbers of m only: it may be in counts")


@pytest.mark.parametrize(("lost", "channels"), [(1, "q_m and q_c"), (50, "q_m and q_c")])
def test_a_clock_that_jumps_shows_in_all_positions(lost: int, channels: str) -> None:
    record = simulated(QC, "chirp", noise=True)
    signals = {key: np.delete(samples, slice(5000, 5000 + lost)) for key, samples in record.signals.items()}
    found = only(QC, Record(signals, record.fs, "run1"))
    place = re.fullmatch(rf"run1, channel {channels}, samples (\d+)\D+(\d+)", found.where)
    assert found.kind == "leap" and place, found
    first, last = map(int, place.groups())
    assert 4997 <= first < 5000 <= last <= 5002
    assert "the clock jumped" in found.what


def test_a_wrong_reading_leaps_alone(bench: Record) -> None:
    record = bench
    for place in (8000, 16_000, 24_000, 32_000, 40_000):
        record = faulty(
            record,
            "q_c",
            lambda samples, place=place: np.where(np.arange(samples.size) == place, 0.0, samples),
        )
    *first, rest = suspicions(BENCH, [record])
    assert [advice.where for advice in first] == [
        f"bench, channel q_c, samples {place - 2} to {place + 2}" for place in (8000, 16_000, 24_000)
    ]
    assert {advice.what for advice in first} == {
        "leaps and comes back: the readings between are wrong, and are interpolated"
    }
    assert (rest.where, rest.what) == ("bench, samples 31998 to 40002", "holds 2 more leaps")


# Readings that no estimate stands -------------------------------------------------------------------


def every_fourth(samples: FloatArray) -> FloatArray:
    return samples[np.arange(samples.size) // 4 * 4]


def test_repeated_readings_are_refused_but_commands_that_are_held(chirp: Record) -> None:
    assert misread(AC, chirp, ()) == []
    for key, remedy in (("a_c", "(--mend repeats=a_c)"), ("Gamma_m", "(--held Gamma_m)")):
        repeated = faulty(chirp, key, every_fourth)
        (problem,) = misread(AC, repeated, ())
        assert problem.what.startswith(f"{key} has a new reading only every 4 samples")
        assert remedy in problem.remedy
        assert len(misread(AC, repeated, ("Gamma_m",))) == (key == "a_c")
    with pytest.raises(DataError, match="--mend repeats=a_c"):
        identify(AC, faulty(chirp, "a_c", every_fourth))


# In the result ------------------------------------------------------------------------------------


def test_suspicions_stand_in_summary_and_json(emps: Record) -> None:
    estimate = identify(RIGID, faulty(emps, "q_m", held(8000, 300)), **values_of(drift_check=False))
    sentence = estimate.checks.advice[0].sentence
    assert sentence.startswith("stuck: emps, channel q_m, samples 8000 to 8299 stays at one reading")
    assert sentence.split(";")[0] in " ".join(estimate.summary().split())
    assert estimate.to_dict()["checks"]["advice"][0]["where"] == "emps, channel q_m, samples 8000 to 8299"


def test_a_constant_sensor_is_named_in_the_error(emps: Record) -> None:
    with pytest.raises(DataError) as caught:
        identify(RIGID, faulty(emps, "q_m", lambda samples: np.full(samples.size, 0.1)))
    assert "no sensor of a body moves" in str(caught.value)
    assert "emps, channel q_m, samples 0 to 24840: reads 0.1 in every sample" in str(caught.value)


def test_a_constant_force_is_named_in_the_result(emps: Record) -> None:
    estimate = identify(RIGID, faulty(emps, "F", lambda samples: np.full(samples.size, 0.25)), "wls")
    found = estimate.checks.advice[0]
    assert (found.kind, found.where) == ("constant", "emps, channel F, samples 0 to 24840")
    assert found.what == "reads 0.25 in every sample"


def test_what_is_suspicious_is_told_where_nothing_is_identifiable() -> None:
    t = np.arange(4000) / 1000.0
    record = Record({"q_m": np.sin(t), "F": np.zeros(4000)}, 1000.0, "dead")
    with pytest.raises(IdentifiabilityError) as caught:
        identify(RIGID, record, cutoff_hz=50.0)
    assert "dead, channel F, samples 0 to 3999: reads 0 in every sample" in str(caught.value)


def test_an_option_out_of_range_is_not_blamed_on_the_data(emps: Record) -> None:
    record = faulty(emps, "q_m", held(8000, 300))
    with pytest.raises(DataError) as caught:
        identify(RIGID, record, cutoff_hz=900.0)
    assert [problem.where for problem in caught.value.problems] == ["cutoff_hz"]


def test_the_record_is_left_as_it_was(chirp: Record) -> None:
    before = {key: samples.copy() for key, samples in chirp.signals.items()}
    suspicions(AC, [chirp])
    assert all(np.array_equal(before[key], chirp.signals[key]) for key in before)
