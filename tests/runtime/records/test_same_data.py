"""The same data given twice are found by content, whatever they are called and wherever they are cut."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.runtime.records.record import Record
from modelgen.runtime.records.same_data import same_data_problems

CHANNELS = ("q", "F")


def noisy(seed: int, n: int = 20000, step: float = 0.0, name: str = "run") -> Record:
    """A swing with noise; `step` is the encoder's resolution, 0 for none."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 1000.0
    q = np.sin(2.0 * np.pi * 1.3 * t) + 1e-3 * rng.standard_normal(n)
    q = np.round(q / step) * step if step else q
    return Record({"q": q, "F": np.cos(2.0 * np.pi * 1.3 * t) + 0.1 * rng.standard_normal(n)}, 1000.0, name)


def cut(record: Record, start: int, stop: int, name: str) -> Record:
    return Record({key: samples[start:stop] for key, samples in record.signals.items()}, record.fs, name)


def test_a_copy_is_named_with_its_original() -> None:
    one, other = noisy(1, name="monday"), noisy(1, name="tuesday")
    (problem,) = same_data_problems([noisy(2), one, other], CHANNELS)
    assert problem.where == "records 2 (monday) and 3 (tuesday)"
    assert problem.what == "hold the same data"
    assert "leave one of them out" in problem.remedy


@given(st.integers(0, 12000), st.integers(2500, 8000), st.sampled_from([0.0, 1e-3, 1e-2]))
@settings(max_examples=30, deadline=None)
def test_a_stretch_of_another_record_is_found_with_its_place(start: int, n: int, step: float) -> None:
    whole = noisy(3, step=step, name="whole")
    part = cut(whole, start, start + n, "part")
    for records in ([whole, part], [part, whole]):
        (problem,) = same_data_problems(records, CHANNELS)
        assert f"samples {start} to {start + n - 1} of the" in problem.what
        assert f"samples 0 to {n - 1} of the" in problem.what


def test_records_that_overlap_are_found() -> None:
    whole = noisy(4)
    (problem,) = same_data_problems([cut(whole, 0, 12000, "a"), cut(whole, 8000, 20000, "b")], CHANNELS)
    assert "samples 8000 to 11999 of the one are samples 0 to 3999 of the other" in problem.what


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-3, 1e-2, 0.1]))
@settings(max_examples=30, deadline=None)
def test_repeated_experiments_are_not_the_same_data(seed: int, step: float) -> None:
    assert not same_data_problems([noisy(seed, step=step), noisy(seed + 1, step=step)], CHANNELS)


def test_the_same_command_with_other_readings_is_another_experiment() -> None:
    one, other = noisy(5), noisy(6)
    mixed = Record({"q": other.signals["q"], "F": one.signals["F"]}, 1000.0, "mixed")
    assert not same_data_problems([one, other, mixed], CHANNELS)


def test_rest_is_alike_in_all_records() -> None:
    def resting(seed: int) -> Record:
        moving = noisy(seed, 4000)
        zeros = np.zeros(16000)
        return Record({key: np.concatenate([zeros, s]) for key, s in moving.signals.items()}, 1000.0)

    assert not same_data_problems([resting(7), resting(8)], CHANNELS)


@pytest.mark.parametrize("n", [2, 16, 17, 100])
def test_short_records_too(n: int) -> None:
    assert not same_data_problems([noisy(9, n), noisy(10, n)], CHANNELS)
    assert len(same_data_problems([noisy(9, n), noisy(9, n, name="again")], CHANNELS)) == 1
