"""The sampling frequency: stated, measured, or both in agreement."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.records.sampling_frequency import sampling_frequency

TIMES = np.arange(2000) / 5000.0


def test_one_source_is_enough() -> None:
    assert sampling_frequency("run", 5000.0, None) == 5000.0
    assert sampling_frequency("run", None, TIMES) == 5000.0
    assert sampling_frequency("run", None, TIMES + 17.3) == 5000.0


def test_neither_is_an_error() -> None:
    with pytest.raises(DataError, match="run: has no sampling frequency; give fs in Hz"):
        sampling_frequency("run", None, None)


@pytest.mark.parametrize("fs", [0.0, -5.0, float("nan"), float("inf"), "5000"])
def test_a_stated_frequency_must_be_positive(fs: Any) -> None:
    with pytest.raises(DataError, match="finite and positive"):
        sampling_frequency("run", fs, None)


def test_both_must_agree() -> None:
    assert sampling_frequency("run", 5004.9, TIMES) == 5004.9
    with pytest.raises(DataError, match="says 5000 Hz, but 5006 Hz is stated"):
        sampling_frequency("run", 5006.0, TIMES)


@pytest.mark.parametrize("per_second", [1e3, 1e6, 1e9])
def test_times_in_another_unit_need_a_stated_frequency(per_second: float) -> None:
    times = np.arange(100) / 500.0 * per_second
    assert sampling_frequency("run", 500.0, times) == 500.0
    with pytest.raises(DataError, match="give fs in Hz if the times are not in seconds"):
        sampling_frequency("run", None, times)
    with pytest.raises(DataError, match="but 400 Hz is stated"):
        sampling_frequency("run", 400.0, times)


@pytest.mark.parametrize("stated", [None, 5000.0])
def test_a_missing_sample_is_named(stated: float | None) -> None:
    with pytest.raises(DataError, match=r"sample 700: jumps by 0.0004 where the step is 0.0002 \(1 such"):
        sampling_frequency("run", stated, np.delete(TIMES, 700))


def test_steps_must_be_equal_to_a_thousandth() -> None:
    times = TIMES.copy()
    times[3] += 0.9e-3 / 5000.0
    assert sampling_frequency("run", None, times) == 5000.0
    times[3] += 0.2e-3 / 5000.0
    with pytest.raises(DataError, match="sample 3: jumps"):
        sampling_frequency("run", None, times)


def test_rounded_times_only_confirm() -> None:
    times = np.round(TIMES, 4) + np.tile([0.0, 4e-5], 1000)
    with pytest.raises(DataError, match="give fs too if the times are only rounded"):
        sampling_frequency("run", None, times)
    assert sampling_frequency("run", 5000.0, times) == 5000.0


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (np.array([0.0, np.nan, 2e-3]), "sample 1: is nan"),
        (TIMES[::-1], "does not increase"),
        (np.zeros(5), "does not increase"),
        (TIMES[:1], r"has 1 sample\(s\)"),
    ],
    ids=["nan", "backward", "constant", "single"],
)
def test_what_is_no_clock(times: np.ndarray[Any, Any], words: str) -> None:
    with pytest.raises(DataError, match=words):
        sampling_frequency("run", None, times)


@pytest.mark.parametrize(("step", "unit"), [(0.5, "ms"), (0.2, "ms"), (0.125, "ms")])
def test_times_without_a_unit_that_step_too_far_for_a_motion_need_one(step: float, unit: str) -> None:
    times = step * np.arange(200)
    with pytest.raises(
        DataError, match=rf"steps by {step}, as times in {unit} do.*--time-unit {unit}, or s if"
    ):
        sampling_frequency("run", None, times, in_seconds=False)
    assert sampling_frequency("run", None, times) == pytest.approx(1.0 / step)
    assert sampling_frequency("run", 1.0 / step, times, in_seconds=False) == pytest.approx(1.0 / step)


def test_times_of_a_motion_need_no_unit() -> None:
    assert sampling_frequency("run", None, 0.04 * np.arange(200), in_seconds=False) == pytest.approx(25.0)
