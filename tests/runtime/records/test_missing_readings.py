"""Readings and times that are no numbers: told with their place, mended only by name, and then everywhere."""

from __future__ import annotations

import itertools
import warnings
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.channel_checks import zero_faults
from modelgen.runtime.records.faults import time_faults
from modelgen.runtime.records.read_record import Reading, read
from modelgen.runtime.records.repair import MENDS

N, FS = 400, 1000.0
T = np.arange(N) / FS
Q, F = np.sin(40.0 * T), np.cos(40.0 * T)


def save(folder: Path, t: np.ndarray | None, q: np.ndarray = Q, f: np.ndarray = F) -> Path:
    columns = {"t": t, "q": q, "F": f}
    path = folder / "run.npz"
    np.savez(path, **{key: values for key, values in columns.items() if values is not None})
    return path


def missing(samples: np.ndarray, *places: int, value: float = np.nan) -> np.ndarray:
    changed = samples.copy()
    changed[list(places)] = value
    return changed


def in_si(path: Path, *mend: str, fs: float | None = None) -> Reading:
    return read(path, mend=mend, fs=fs, units={"q": "rad", "F": "N m"}, needed=("q", "F"))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_missing_reading_is_told_with_column_sample_and_what_mends_it(tmp_path: Path, value: float) -> None:
    path = save(tmp_path, T, q=missing(Q, 100, 101, value=value))
    with pytest.raises(DataError, match=r"run.npz: column q, sample 100: is .*\(2 of 400.*--mend gaps.*fill"):
        in_si(path)
    filled, cut = in_si(path, "fill"), in_si(path, "gaps")
    assert filled.record.n == N and cut.record.n == N - 102
    np.testing.assert_allclose(filled.record.signals["q"][100:102], Q[100:102], atol=2e-3)
    np.testing.assert_array_equal(filled.record.signals["F"], F)
    np.testing.assert_array_equal(cut.record.signals["q"], Q[102:])
    assert any("2 missing readings of q interpolated" in said for said in filled.mended)
    assert "cut where readings are missing: samples 102 to 399 kept" in cut.mended


def test_readings_missing_at_the_ends_are_cut_off(tmp_path: Path) -> None:
    path = save(tmp_path, T, q=missing(Q, 0, 1, 200), f=missing(F, N - 1))
    found = in_si(path, "fill").record
    assert found.n == N - 3
    np.testing.assert_array_equal(found.signals["F"], F[2:-1])
    assert np.isfinite(found.signals["q"]).all()


@pytest.mark.parametrize("timed", [True, False])
def test_a_slower_channel_is_interpolated_between_its_readings(tmp_path: Path, timed: bool) -> None:
    """Cutting would leave one sample, and lines between readings bend what moves: 2 % here."""
    slow = np.where(np.arange(N) % 10 == 0, Q, np.nan)
    path = save(tmp_path, T if timed else None, q=slow)
    with pytest.raises(DataError, match=r"not finite\); interpolate the missing samples \(--mend fill\)$"):
        in_si(path, fs=FS)
    found = in_si(path, "fill", fs=FS)
    np.testing.assert_allclose(found.record.signals["q"], Q[: found.record.n], atol=1e-3)
    assert "q interpolated between its readings, one in 10 samples" in found.mended


def test_readings_are_mended_without_times(tmp_path: Path) -> None:
    path = save(tmp_path, None, q=missing(Q, 100))
    assert in_si(path, "fill", fs=FS).record.n == N
    assert in_si(path, "gaps", fs=FS).record.n == N - 101
    assert in_si(save(tmp_path, None), "duplicates", fs=FS).record.n == N


def test_turns_are_added_though_a_reading_is_missing(tmp_path: Path) -> None:
    turning = np.linspace(0.0, 20.0, N)
    path = save(tmp_path, T, q=missing(np.mod(turning, 2.0 * np.pi), 50))
    found = in_si(path, "fill", "unwrap=q").record
    np.testing.assert_allclose(found.signals["q"], turning, atol=1e-9)


def test_a_time_that_is_no_number_costs_its_sample_only(tmp_path: Path) -> None:
    path = save(tmp_path, missing(T, 100))
    with pytest.raises(DataError, match=r"column t, sample 100: is nan.*--mend duplicates and --mend gaps"):
        in_si(path)
    mended = in_si(path, "duplicates", "fill")
    assert mended.record.n == N
    assert "1 samples with a repeated, backward or missing time stamp dropped" in mended.mended
    assert in_si(path, "duplicates", "gaps").record.n == N - 101


@pytest.mark.parametrize("times", [np.zeros(N), -T, np.full(N, np.nan)])
def test_no_mend_is_proposed_or_helps_where_a_column_holds_no_times(
    tmp_path: Path, times: np.ndarray
) -> None:
    assert time_faults("t", times) == ()
    path = save(tmp_path, times)
    for mend in ((), ("duplicates",), ("gaps",), ("fill",), ("duplicates", "gaps", "fill", "uneven")):
        with pytest.raises(DataError, match=r"column t.*name the right column of times"):
            in_si(path, *mend)


def test_whatever_is_missing_and_mended_ends_in_a_record_or_in_one_message(tmp_path: Path) -> None:
    wrong = {
        "reading": (T, missing(Q, 0, 7, 399)),
        "channel": (T, np.full(N, np.nan)),
        "time": (missing(T, 0, 7, 399), Q),
        "all times": (np.full(N, np.nan), Q),
        "one sample": (T[:1], Q[:1]),
        "one after nothing": (np.array([np.nan, 0.1]), Q[:2]),
    }
    for times, q in wrong.values():
        path = save(tmp_path, times, q, F[: q.size])
        for count in range(4):
            for mend in itertools.combinations(
                (*MENDS, "unwrap=q", "repeats=q", "offset=F", "offset=q"), count
            ):
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    try:
                        record = in_si(path, *mend).record
                    except DataError as error:
                        assert "run.npz" in str(error)
                    else:
                        assert np.isfinite(record.signals["q"]).all()


def test_zeros_of_channels_that_miss_a_reading_or_never_change_are_not_judged() -> None:
    units = {"a": "rad/s^2", "b": "rad/s^2", "q": "rad", "p": "rad"}
    signals = {"a": missing(Q + 1.0, 3, value=np.inf), "b": np.full(N, 0.7), "q": Q, "p": missing(Q + 9.0, 0)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert zero_faults(signals, units) == ()
