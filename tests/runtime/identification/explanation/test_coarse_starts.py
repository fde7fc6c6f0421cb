"""Where to start from when channels are read at quite other instants, zeros apart or not."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.explanation.coarse_starts import Start, _fit, _misfit, coarse_starts
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


def sized(start: Start) -> dict[str, float]:
    return {effect.name: size for effect, size in zip(start.effects, start.sizes, strict=True)}


def causes(start: Start) -> list[str]:
    return [effect.name for effect in start.effects if effect.kind != "zero"]


@pytest.mark.parametrize("zero", [0.0, 0.05])
def test_what_is_looked_at_has_the_misfit_of_the_fit(zero: float) -> None:
    records = read_otherwise("late", 2.0, zero)
    job = Job(SMALL, records, choose_filter(SMALL, records))
    fit, (misfit, count) = _fit(job, records), _misfit(job, records)
    assert misfit == pytest.approx(fit.misfit, rel=1e-9)
    assert count == fit.count


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "size", "zero"), CASES)
def test_one_of_the_starts_is_near_the_truth(cause: str, size: float, zero: float) -> None:
    records = read_otherwise(cause, size, zero)
    job = Job(SMALL, records, choose_filter(SMALL, records), late=("Gamma_m",))
    starts = list(coarse_starts(job))
    assert [effect.kind for effect in starts[0].effects] == ["zero", "zero"]
    # a low-pass comes with a delay of its own
    near = [one for one in starts if causes(one)[-1:] == [EFFECTS[cause]]]
    assert near
    sample = 1.0 / (records[0].n if cause == "clock" else FS)
    unit = 0.5 * (size * sample) ** 2 if cause == "low-pass" else size * sample
    assert all(abs(sized(one)[EFFECTS[cause]] - unit) < 0.3 * abs(unit) for one in near)
    # with zeros as well
    assert {len(one.effects) - len(causes(one)) for one in near} == {0, 2}
    x = dict(zip(near[0].fit.columns, near[0].fit.solution.x.tolist(), strict=True))
    assert abs(x["K"] - TRUTH["K"]) < 0.3 * TRUTH["K"]


@pytest.mark.slow
def test_records_as_they_should_be_start_with_zeros_alone() -> None:
    records = tuple(two_mass_records())
    starts = list(coarse_starts(Job(SMALL, records, choose_filter(SMALL, records))))
    assert [[effect.kind for effect in one.effects] for one in starts] == [["zero", "zero"]]
    assert np.allclose(starts[0].sizes, 0.0, atol=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.0, 1.0])
def test_zeros_may_differ_by_many_deflections(late: float) -> None:
    """What stiffness makes of a zero changes with every step towards it: rows take it off first."""
    right = two_mass_records()
    moved = [{"q_c": record.signals["q_c"] - 40.0, "Gamma_m": shift("Gamma_m", -late)} for record in right]
    records = [record.edited(edits) for record, edits in zip(right, moved, strict=True)]
    found, wanted = identify(SMALL, records), identify(SMALL, right)
    for name in ("J_m", "J_c", "K", "F_sm"):
        assert abs(found.params[name] - wanted.params[name]) < wanted.bse[name]
        assert found.bse[name] < 2.0 * wanted.bse[name]


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
