"""Where to start from when channels are read at quite other instants, zeros apart or not."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.explanation.coarse_starts import coarse_starts
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.iv.low_pass import without_lag
from modelgen.runtime.least_squares.time_shifts import on_one_clock, shift
from modelgen.runtime.records.record import Record
from tests.runtime.two_mass_records import FS, SMALL, TRUTH, two_mass_records


def read_otherwise(cause: str, size: float, zero: float = 0.0) -> tuple[Record, ...]:
    """Records whose load encoder is late, behind a low-pass, or read by another clock; size in samples."""
    found = []
    for record in two_mass_records():
        slow = on_one_clock("q_c", -size / record.n, record)
        record = record.edited({"q_c": slow if cause == "clock" else shift("q_c", -size)})
        if cause == "low-pass":
            record = record.edited({"q_c": without_lag("q_c", -0.5 * (size / FS) ** 2, FS)})
        found.append(record.edited({"q_c": record.signals["q_c"] + zero}))
    return tuple(found)


CASES = [
    ("late", 5.0, 0.0), ("late", -3.3, 0.05), ("clock", 7.0, 0.05), ("clock", -4.6, 0.0),
    ("low-pass", 5.0, 0.0), ("low-pass", 5.0, 0.05),
]  # fmt: skip
EFFECTS = {"late": "delay of q_c", "clock": "clock of q_c", "low-pass": "bandwidth of q_c"}


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "size", "zero"), CASES)
def test_one_of_the_starts_is_near_the_truth(cause: str, size: float, zero: float) -> None:
    records = read_otherwise(cause, size, zero)
    job = Job(SMALL, records, choose_filter(SMALL, records), late=("Gamma_m",))
    starts = list(coarse_starts(job))
    assert [effect.kind for effect in starts[0].effects] == ["zero", "zero"]
    near = [
        one for one in starts if one.effects[len(one.sizes) - 1 :][0].name == EFFECTS[cause] and one.sizes
    ]
    assert near
    sample = 1.0 / (records[0].n if cause == "clock" else FS)
    unit = 0.5 * (size * sample) ** 2 if cause == "low-pass" else size * sample
    assert all(abs(one.sizes[-1] - unit) < 0.3 * abs(unit) for one in near)
    # with zeros as well
    assert {len(one.effects) - len(one.sizes) for one in near} == {0, 2}
    x = dict(zip(near[0].fit.columns, near[0].fit.solution.x.tolist(), strict=True))
    assert abs(x["K"] - TRUTH["K"]) < 0.3 * TRUTH["K"]


@pytest.mark.slow
def test_records_as_they_should_be_start_with_zeros_alone() -> None:
    records = tuple(two_mass_records())
    starts = list(coarse_starts(Job(SMALL, records, choose_filter(SMALL, records))))
    assert [len(one.sizes) for one in starts] == [0]


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "size"), [("late", 3.0), ("clock", 7.0)])
def test_zero_and_instant_of_one_sensor_are_estimated_together(cause: str, size: float) -> None:
    estimate = identify(SMALL, read_otherwise(cause, size, 0.05))
    said = " ".join(str(one) for one in estimate.checks.advice)
    assert "zero of its own" in said
    assert {"late": "q_c is late", "clock": "clock of its own"}[cause] in said
    for entry in estimate.parameters.physical:
        assert abs(entry.value - TRUTH[entry.name]) < 3.5 * entry.std
        assert np.isfinite(entry.std)
