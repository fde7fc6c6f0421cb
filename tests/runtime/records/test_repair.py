"""Faults of times and zeros are told with their size, and mended only by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.channel_checks import zero_faults
from modelgen.runtime.records.faults import time_faults
from modelgen.runtime.records.read_record import read

N = 400
T = np.arange(N) / 1000.0


def wave(times: np.ndarray) -> np.ndarray:
    return np.sin(40.0 * times)


def save(folder: Path, times: np.ndarray, offset: float = 0.0) -> Path:
    path = folder / "run.csv"
    lines = [f"{t:.9f},{q:.12g}" for t, q in zip(times, wave(times) + offset, strict=True)]
    path.write_text("\n".join(["t,q", *lines]), encoding="utf-8")
    return path


def test_nothing_to_find() -> None:
    assert time_faults("t", T) == ()


def test_every_fault_of_the_times_has_its_size() -> None:
    times = np.delete(T, range(100, 110))
    times = np.insert(times, 50, times[50])
    times[200] += 2e-4
    kinds = {finding.kind: finding.what for finding in time_faults("t", times)}
    assert kinds == {
        "duplicates": "t repeats 1 time stamp(s), first at sample 51",
        "gaps": "t has 1 gap(s), 10 samples missing, longest 0.011 s, first at sample 101",
        "uneven": "t steps by 0.001 s, uneven by up to 20 %",
    }


def test_nothing_is_mended_unasked(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"jumps by 0.011.*--mend gaps"):
        read(save(tmp_path, np.delete(T, range(100, 110))))


@pytest.mark.parametrize("late", [0, 1])
def test_records_that_follow_one_another_are_no_times_to_be_dropped(tmp_path: Path, late: int) -> None:
    path = save(tmp_path, np.concatenate([T, T[late:300], T]))
    for mend in ((), ("duplicates",), ("duplicates", "gaps", "uneven")):
        with pytest.raises(
            DataError, match="sample 400: begins again: 3 records follow one another; cut the"
        ):
            read(path, mend=mend)
    # a stamp that falls back alone, and a clock that is set back, are mended as before
    for times in (np.insert(T, 50, 0.0), np.concatenate([T, T[50:]])):
        assert read(save(tmp_path, times), mend=("duplicates",)).record.n == N


@pytest.mark.parametrize(
    ("mend", "count", "first", "words"),
    [
        ("gaps", N - 110, 0.110, "cut at 1 gap(s): samples 100 to 389 kept"),
        ("fill", N, 0.0, "gaps filled: 390 samples became 400, 10 interpolated"),
    ],
)
def test_gaps(tmp_path: Path, mend: str, count: int, first: float, words: str) -> None:
    reading = read(save(tmp_path, np.delete(T, range(100, 110))), mend=(mend,))
    assert (reading.record.n, reading.record.fs, reading.mended) == (count, 1000.0, (words,))
    assert [finding.kind for finding in reading.findings] == ["gaps"]
    expected = wave(first + np.arange(count) / 1000.0)
    np.testing.assert_allclose(reading.record.signals["q"], expected, atol=0.03)


def test_duplicates(tmp_path: Path) -> None:
    reading = read(save(tmp_path, np.insert(T, 7, T[6])), mend=("duplicates",))
    assert reading.mended == ("1 samples with a repeated, backward or missing time stamp dropped",)
    np.testing.assert_allclose(reading.record.signals["q"], wave(T), atol=1e-9)


def test_repeated_stamps_leave_gaps_and_both_mends_are_named(tmp_path: Path) -> None:
    times = T.copy()
    times[[20, 90]] = times[[19, 89]]
    path = save(tmp_path, times)
    with pytest.raises(DataError, match=r"there \(--mend duplicates and --mend gaps \(or fill\)\)"):
        read(path)
    assert read(path, mend=("duplicates", "fill")).record.n == N


def test_uneven_steps(tmp_path: Path) -> None:
    jitter = np.random.default_rng(1).uniform(-3e-4, 3e-4, N)
    jitter[[0, -1]] = 0.0
    path = save(tmp_path, T + jitter)
    with pytest.raises(DataError, match=r"--mend uneven\)"):
        read(path)
    reading = read(path, mend=("uneven",))
    assert reading.record.fs == pytest.approx(1000.0, rel=1e-6)
    np.testing.assert_allclose(reading.record.signals["q"], wave(T), atol=2e-6)


def test_offsets(tmp_path: Path) -> None:
    reading = read(save(tmp_path, T, offset=2.5), mend=("offset=q",), units={"q": "rad"})
    assert reading.mended == ("first reading 2.5 taken off q",)
    np.testing.assert_allclose(reading.record.signals["q"], wave(T), atol=1e-9)
    reading = read(save(tmp_path, T, offset=2.5), mend=("offset=q",), units={"q": "rad/s^2"})
    assert float(np.mean(reading.record.signals["q"])) == pytest.approx(0.0, abs=1e-12)
    assert [finding.kind for finding in reading.findings] == ["offset=q"]


@pytest.mark.parametrize("start", [0.0, 4.0])
def test_unlike_zeros_of_encoders(start: float) -> None:
    signals = {"q_m": wave(T) + start, "q_c": wave(T) + start + 1.5, "tau": wave(T) + 9.0}
    finding, *others = zero_faults(signals, {"q_m": "rad", "q_c": "rad", "tau": "N m"})
    assert finding.kind == "offset=q_c"
    assert "starts 1.5 rad from q_m" in finding.what
    # what is taken off is the first reading: the other encoder has to begin at zero, too
    assert [other.kind for other in others] == ["offset=q_m"] * (start != 0.0)


def test_a_mend_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(DataError) as caught:
        read(save(tmp_path, T), mend=("everything", "offset=z"))
    assert [problem.where for problem in caught.value.problems] == ["--mend everything", "--mend offset=z"]


def table(folder: Path, **columns: np.ndarray) -> Path:
    path = folder / "run.csv"
    lines = [",".join(f"{value:.12g}" for value in row) for row in zip(T, *columns.values(), strict=True)]
    path.write_text("\n".join([",".join(["t", *columns]), *lines]), encoding="utf-8")
    return path


def test_an_encoder_that_begins_again_is_refused_and_mended(tmp_path: Path) -> None:
    path, units = table(tmp_path, q=8.0 * wave(T) % (2.0 * np.pi)), {"q": "rad"}
    with pytest.raises(DataError, match=r"q jumps \d+ time.*by 6.28319 rad.*--mend unwrap=q"):
        read(path, units=units)
    reading = read(path, mend=("unwrap=q",), units=units)
    assert reading.mended[0].startswith("q begins again after 6.28319: turns added at ")
    np.testing.assert_allclose(reading.record.signals["q"], 8.0 * wave(T), atol=1e-9)


def test_a_sensor_that_repeats_its_readings_is_refused_and_mended(tmp_path: Path) -> None:
    held = wave(T)[np.arange(N) // 4 * 4]
    path, units = table(tmp_path, q=held, tau=held), {"q": "rad", "tau": "N m"}
    with pytest.raises(DataError, match=r"q has a new reading only every 4 .*--mend repeats=q") as caught:
        read(path, units=units)
    assert len(caught.value.problems) == 1  # a force may be a command
    reading = read(path, mend=("repeats=q", "repeats=tau"), units=units)
    assert len(reading.mended) == 2
    for key in units:
        np.testing.assert_allclose(reading.record.signals[key][:-8], wave(T)[:-8], atol=1e-4)


def test_stamps_that_scatter_are_no_gaps_and_all_samples_are_kept(tmp_path: Path) -> None:
    """At normal stamps of a fifth of a step many steps are longer than one and a half."""
    times = T + np.random.default_rng(2).normal(0.0, 2e-4, N)
    assert np.sum(np.diff(times) > 1.5e-3) > 10
    kinds = [finding.kind for finding in time_faults("t", times)]
    assert "gaps" not in kinds
    mended = read(save(tmp_path, times), mend=("duplicates", "gaps", "uneven"))
    assert mended.record.n == np.sum(times > np.r_[-1.0, np.maximum.accumulate(times)[:-1]])
    assert not any("gap" in said for said in mended.mended)


def test_a_stamp_that_is_late_alone_is_no_gap_and_a_missing_sample_is_one_in_stamps_that_scatter() -> None:
    late = T.copy()
    late[[60, 200, 201]] += 0.9e-3
    late[201] += 1e-5
    assert [finding.kind for finding in time_faults("t", late)] == ["uneven"]
    scattered = T + np.random.default_rng(3).normal(0.0, 5e-5, N)
    (gap, uneven) = time_faults("t", np.delete(scattered, 300))
    assert gap.what.startswith("t has 1 gap(s), 1 samples missing")
    assert uneven.kind == "uneven"


def test_steps_of_a_clock_that_scatters_become_even_at_their_mean(tmp_path: Path) -> None:
    """The median of such steps is known to half a percent."""
    times = T + np.random.default_rng(4).normal(0.0, 1.5e-4, N)
    times = np.sort(times)
    record = read(save(tmp_path, times), mend=("uneven",)).record
    assert record.n == N
    assert record.fs == pytest.approx(1000.0, rel=2e-3)


@pytest.mark.parametrize(("zero", "start"), [(0.0, 0.0), (2.9, 0.0), (2.9, 0.5), (-900.0, 7.0), (0.0, 7.0)])
def test_zeros_of_an_angle_and_of_the_place_that_it_moves(zero: float, start: float) -> None:
    angle = 30.0 * np.sin(np.arange(500) / 80.0)
    signals = {"q_m": angle + zero, "x_t": 0.02 * angle + 1e-5 * np.cos(np.arange(500) / 9.0) + start}
    found = zero_faults(signals, {"q_m": "rad", "x_t": "m"})
    wanted = [] if zero == start == 0.0 else ["offset=q_m"] + ["offset=x_t"] * (start != 0.0)
    assert [finding.kind for finding in found] == wanted
    # what moves on its own has a zero of its own
    signals["x_t"] = np.cos(np.arange(500) / 30.0) + start
    assert zero_faults(signals, {"q_m": "rad", "x_t": "m"}) == ()
