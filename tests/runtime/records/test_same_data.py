"""The same data given twice are found by content, whatever they are called and wherever they are cut."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.errors import DataError, Problem
from modelgen.runtime.records.channels import RecordChannels
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.same_data import refuse_same_data

CHANNELS = ("q", "F")


def noisy(seed: int, n: int = 20000, step: float = 0.0, name: str = "run") -> Record:
    """A swing with noise; `step` is the encoder's resolution, 0 for none."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 1000.0
    q = np.sin(2.0 * np.pi * 1.3 * t) + 1e-3 * rng.standard_normal(n)
    q = np.round(q / step) * step if step else q
    return Record({"q": q, "F": np.cos(2.0 * np.pi * 1.3 * t) + 0.1 * rng.standard_normal(n)}, 1000.0, name)


def problems_of(records: list[Record]) -> tuple[Problem, ...]:
    try:
        refuse_same_data([RecordChannels(record) for record in records], CHANNELS)
    except DataError as error:
        return error.problems
    return ()


def cut(record: Record, start: int, stop: int, name: str) -> Record:
    return Record({key: samples[start:stop] for key, samples in record.signals.items()}, record.fs, name)


def test_a_copy_is_named_with_its_original() -> None:
    one, other = noisy(1, name="monday"), noisy(1, name="tuesday")
    (problem,) = problems_of([noisy(2), one, other])
    assert (problem.where, problem.what) == ("tuesday", "holds the same data as monday")
    assert "leave one of them out" in problem.remedy


@given(st.integers(0, 12000), st.integers(2500, 8000), st.sampled_from([0.0, 1e-3, 1e-2]))
@settings(max_examples=30, deadline=None)
def test_a_stretch_of_another_record_is_found_with_its_place(start: int, n: int, step: float) -> None:
    whole = noisy(3, step=step, name="whole")
    part = cut(whole, start, start + n, "part")
    for records in ([whole, part], [part, whole]):
        (problem,) = problems_of(records)
        assert problem.what == f"shares {n} samples with {records[0].name}"


def test_a_table_of_seven_digits_and_another_unit_are_the_same_data() -> None:
    binary = noisy(11, name="binary")
    table = {"q": np.array([float(f"{1e3 * x:.7g}") for x in binary.signals["q"]]), "F": binary.signals["F"]}
    (problem,) = problems_of([binary, Record(table, 1000.0, "table")])
    assert problem.what == "holds the same data as binary"


def test_records_that_overlap_are_found() -> None:
    whole = noisy(4)
    (problem,) = problems_of([cut(whole, 0, 12000, "a"), cut(whole, 8000, 20000, "b")])
    assert problem.what == "shares 4000 samples with a"


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-3, 1e-2, 0.1]))
@settings(max_examples=30, deadline=None)
def test_repeated_experiments_are_not_the_same_data(seed: int, step: float) -> None:
    assert not problems_of([noisy(seed, step=step), noisy(seed + 1, step=step)])


def test_the_same_command_with_other_readings_is_another_experiment() -> None:
    one, other = noisy(5), noisy(6)
    mixed = Record({"q": other.signals["q"], "F": one.signals["F"]}, 1000.0, "mixed")
    assert not problems_of([one, other, mixed])


def test_rest_is_alike_in_all_records() -> None:
    def resting(seed: int) -> Record:
        moving = noisy(seed, 4000)
        zeros = np.zeros(16000)
        return Record({key: np.concatenate([zeros, s]) for key, s in moving.signals.items()}, 1000.0)

    assert not problems_of([resting(7), resting(8)])


@pytest.mark.parametrize("n", [2, 16, 17, 100])
def test_short_records_too(n: int) -> None:
    assert not problems_of([noisy(9, n), noisy(10, n)])
    assert len(problems_of([noisy(9, n), noisy(9, n, name="again")])) == 1
