"""Histories that are simulated: what changes is found where it does, what does not is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.trend.trend import QuantityTrend, Trend, trend
from tests.runtime.made_estimates import estimate_of

# how systematic errors are in truth: others in every entry, the same in all, others from some entry on
ERRORS = ("every entry", "all alike", "another setting")


def history(
    rng: np.random.Generator,
    count: int,
    quantities: int = 4,
    share: float = 0.0,
    errors: str = "every entry",
    shifts: Mapping[int, float] | None = None,
) -> list[Estimate]:
    """Estimates of standard deviation 1; `share` of the variance is systematic, `shifts` add to the first."""
    noise, drift = (1.0 - share) ** 0.5, share**0.5
    setting = rng.integers(1, count)
    shared = rng.standard_normal((2, quantities))
    found = []
    for k in range(count):
        own = {
            "every entry": rng.standard_normal(quantities),
            "all alike": shared[0],
            "another setting": shared[int(k >= setting)],
        }[errors]
        values = 100.0 + noise * rng.standard_normal(quantities) + drift * own
        values[0] += (shifts or {}).get(k, 0.0)
        found.append(estimate_of({f"p{j}": float(v) for j, v in enumerate(values)}, noise, drift))
    return found


def judged(estimates: list[Estimate]) -> Trend:
    return trend(estimates, [f"e{k}" for k in range(len(estimates))])


def first(found: Trend) -> QuantityTrend:
    return next(one for one in found.quantities if one.series.name == "p0")


def since(count: int, start: int, size: float) -> dict[int, float]:
    return dict.fromkeys(range(start, count), size)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("errors", ERRORS)
def test_false_alarms_are_rare(share: float, errors: str) -> None:
    rng = np.random.default_rng(5)
    alarms = sum(bool(judged(history(rng, 6, 4, share, errors)).changed) for _ in range(200))
    assert alarms <= 18  # 5 % are 10 of 200, and 18 are passed by chance in 1 % of such tests


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_lasting_change_of_four_deviations_is_found_where_it_is(share: float) -> None:
    rng = np.random.default_rng(6)
    found = [
        first(judged(history(rng, 12, 4, share, "all alike", since(12, 6, 4.0)))).changes for _ in range(20)
    ]
    changes = [one for one in found if one]
    assert len(changes) >= 19
    assert sum(abs(one[0].entry - 6) <= 1 for one in changes) >= 18
    assert sum(one[0].interval[0] < 4.0 < one[0].interval[1] for one in changes) >= 17
    assert sum(one[0].last is None for one in changes) >= 17


def test_a_change_of_the_last_entry_one_alone_and_a_run() -> None:
    rng = np.random.default_rng(7)
    for shifts, entry, last in (
        ({9: 8.0}, 9, None),
        ({4: 8.0}, 4, 4),
        (dict.fromkeys((3, 4, 5), 8.0), 3, 5),
    ):
        (change,) = first(judged(history(rng, 10, 4, 0.2, "all alike", shifts))).changes
        assert (change.entry, change.last) == (entry, last)
        assert change.difference == pytest.approx(8.0, abs=3.0)


def test_two_changes_are_told_in_their_order() -> None:
    rng = np.random.default_rng(8)
    shifts = {**since(16, 5, 8.0), **since(16, 11, 20.0)}
    found = first(judged(history(rng, 16, 3, 0.1, "all alike", shifts)))
    assert [change.entry for change in found.changes] == [5, 11]
    assert len(set(found.levels.tolist())) == 3


@pytest.mark.slow
def test_what_scatters_is_no_change() -> None:
    rng = np.random.default_rng(9)
    changed = scattered = 0
    for _ in range(10):
        shifts = dict(enumerate(5.0 * rng.standard_normal(14)))
        found = first(judged(history(rng, 14, 3, 0.2, "all alike", shifts)))
        changed += bool(found.changes)
        scattered += found.scatters
    assert scattered >= 9
    assert changed <= 2


def test_the_same_history_gives_the_same_numbers() -> None:
    estimates = history(np.random.default_rng(1), 8, 3, 0.3, shifts=since(8, 4, 5.0))
    once, again = (first(judged(estimates)) for _ in range(2))
    assert once.changes == again.changes
    assert once.p_value == again.p_value


def test_of_two_entries_the_difference_is_judged() -> None:
    apart = [estimate_of({"p0": value}) for value in (0.0, 6.0)]
    (change,) = first(judged(apart)).changes
    assert (change.entry, change.last, change.difference) == (1, None, 6.0)
    assert change.std == pytest.approx(2.0**0.5)
    near = [estimate_of({"p0": value}) for value in (0.0, 2.0)]
    assert not judged(near).changed


def test_a_mean_is_no_more_precise_than_what_entries_share() -> None:
    """The systematic part of a hundred entries of one setting does not average out."""
    estimates = [estimate_of({"p0": float(k >= 100)}, noise=0.1, drift=1.0) for k in range(200)]
    assert not judged(estimates).changed
    own = [estimate_of({"p0": float(k >= 100)}, noise=1.0, drift=0.0) for k in range(200)]
    assert judged(own).changed


def test_what_is_not_in_every_entry_is_compared_where_it_is() -> None:
    values = [{"p0": 1.0, "p1": 1.0}, {"p1": 1.0}, {"p0": 9.0, "p1": 1.0}]
    found = judged([estimate_of(one) for one in values])
    (change,) = first(found).changes
    assert change.entry == 2
    assert found.notes == ("p0 is not known at e1",)


def test_another_method_is_said_to_be_one() -> None:
    one = estimate_of({"p0": 1.0})
    other = replace(one, fit=replace(one.fit, method="iv"))
    said = "e1: the method is iv, before wls, which may be a change by itself"
    assert judged([one, other]).notes == (said,)


def test_parts_of_a_deviation_that_are_not_known_count_as_shared() -> None:
    document = {
        **estimate_of({"p0": 1.0}).to_dict(),
        **{f"{of}{part}_std": {"p0": None} for of in ("", "physical_") for part in ("noise", "drift")},
    }
    old = Estimate.from_dict(document)
    series = first(judged([old, old])).series
    assert series.noise.tolist() == [0.0, 0.0]
    assert series.drift.tolist() == [1.0, 1.0]


def test_what_cannot_be_compared_is_refused() -> None:
    one = estimate_of({"p0": 1.0})
    with pytest.raises(DataError, match="estimates: are 1"):
        trend([one], ["a"])
    other = replace(one, model=replace(one.model, chain="press"))
    with pytest.raises(DataError, match="different chains"):
        trend([one, other], ["a", "b"])
    with pytest.raises(DataError, match="no quantity in common"):
        trend([one, estimate_of({"q": 1.0})], ["a", "b"])
