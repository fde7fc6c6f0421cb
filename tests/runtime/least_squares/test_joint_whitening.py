"""Rows that share noise, made white together."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.least_squares.joint_whitening import JointWhitener, joint_whiteners
from modelgen.runtime.least_squares.row_prediction import RowResiduals
from modelgen.runtime.least_squares.whitening import whitener

N = 6000


def low_passed(rng: np.random.Generator) -> FloatArray:
    return np.asarray(lfilter([1.0], [1.0, -0.6], rng.standard_normal(N)))


def second_difference(series: FloatArray) -> FloatArray:
    return np.asarray(np.convolve(series, [1.0, -2.0, 1.0], "same"))


def bodies(seed: int, rows: int) -> list[FloatArray]:
    """Residuals of a chain of bodies: noise of each encoder in the rows of its neighbours."""
    rng = np.random.default_rng(seed)
    noise = [low_passed(rng) for _ in range(rows)]
    inertia, stiffness = rng.uniform(0.2, 3.0, rows), rng.uniform(0.2, 3.0, rows)
    found = []
    for k in range(rows):
        e = inertia[k] * second_difference(noise[k])
        for other in (k - 1, k + 1):
            if 0 <= other < rows:
                e = e + stiffness[max(k, other)] * (noise[k] - noise[other])
        found.append(e)
    return found


def masked(seed: int, rows: int) -> list[IntArray]:
    """Places with gaps of their own for every second row."""
    rng = np.random.default_rng((7, seed))
    places = []
    for k in range(rows):
        there = np.ones(N, dtype=bool)
        for start in rng.integers(0, N - 200, 6 * (k % 2)):
            there[start : start + 150] = False
        places.append(np.flatnonzero(there))
    return places


def whitened(seed: int, rows: int) -> tuple[JointWhitener, list[FloatArray], list[IntArray]]:
    places = masked(seed, rows)
    residuals = [e[place] for e, place in zip(bodies(seed, rows), places, strict=True)]
    return joint_whitener(residuals, places, N, [0.0] * rows, [0] * rows), residuals, places


def joint_whitener(
    residuals: list[FloatArray], places: list[IntArray], grid: int, least: list[float], rises: list[int]
) -> JointWhitener:
    (one,) = joint_whiteners([RowResiduals(tuple(residuals), tuple(places), grid, tuple(least))], rises)
    return one


def largest_correlation(parts: list[FloatArray], places: list[IntArray]) -> float:
    """The largest correlation between rows, or of one with its own past, over five lags."""
    series = np.zeros((len(parts), N))
    for line, part, place in zip(series, parts, places, strict=True):
        line[place] = part / np.std(part) / np.sqrt(len(place))
    most = 0.0
    for lag in range(6):
        found = np.abs(series[:, lag:] @ series[:, : N - lag].T)
        if lag == 0:
            np.fill_diagonal(found, 0.0)
        most = max(most, float(np.max(found)))
    return most


@pytest.mark.parametrize(("seed", "rows"), [(seed, rows) for seed in range(2) for rows in (2, 3, 5)])
def test_what_is_left_is_white_in_time_and_across_rows(seed: int, rows: int) -> None:
    places, residuals = [np.arange(N)] * rows, bodies(seed, rows)
    white_of = joint_whitener(residuals, places, N, [0.0] * rows, [0] * rows)
    alone = [whitener([e], [place])(e, place) for e, place in zip(residuals, places, strict=True)]
    before = largest_correlation(alone, places)
    assert before > 0.3
    # where rows nearly cancel at some frequency, no finite past is enough
    assert largest_correlation(list(white_of(residuals)), places) < 0.4 * before


@pytest.mark.parametrize("seed", range(3))
def test_it_is_one_linear_map_of_all_rows(seed: int) -> None:
    white_of, residuals, places = whitened(seed, 3)
    rng = np.random.default_rng(seed)
    other = [rng.standard_normal((len(place), 2)) for place in places]
    both = [np.column_stack([e, more]) for e, more in zip(residuals, other, strict=True)]
    together = white_of(both)
    for row, alone in enumerate(white_of(residuals)):
        np.testing.assert_allclose(together[row][:, 0], alone, rtol=1e-9, atol=1e-12)
    for row, alone in enumerate(white_of(other)):
        np.testing.assert_allclose(together[row][:, 1:], alone, rtol=1e-9, atol=1e-12)


def test_rows_that_share_nothing_are_made_white_alone() -> None:
    rng = np.random.default_rng(4)
    residuals, place = [low_passed(rng) for _ in range(3)], np.arange(N)
    white_of = joint_whitener(residuals, [place] * 3, N, [0.0] * 3, [0] * 3)
    for white, e in zip(white_of(residuals), residuals, strict=True):
        np.testing.assert_allclose(white, whitener([e], [place])(e, place), rtol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_differentiated_rows_do_not_cost_a_sum_what_it_knows_of_a_mean(seed: int) -> None:
    # the differentiated rows of two bodies add up to the second derivative of their sum's
    rng = np.random.default_rng(seed)
    first, second = low_passed(rng), low_passed(rng)
    residuals = [second_difference(first), second_difference(second), first + second]
    place = np.arange(N)
    white_of = joint_whitener(residuals, [place] * 3, N, [0.0] * 3, [2, 2, 0])
    constant = [np.zeros(N), np.zeros(N), np.ones(N)]
    told = sum(float(white @ white) for white in white_of(constant))
    alone = whitener([residuals[2]], [place])(np.ones(N), place)
    assert told > 0.9 * float(alone @ alone)


def test_rows_that_cancel_exactly_do_not_outweigh_all_others() -> None:
    e, place = low_passed(np.random.default_rng(1)), np.arange(N)
    residuals = [e, -e]
    white_of = joint_whitener(residuals, [place] * 2, N, [0.0] * 2, [0] * 2)
    step = white_of([np.ones(N), np.ones(N)])
    alone = whitener([e], [place])(np.ones(N), place)
    assert np.max(np.abs(step[1])) < 1000.0 * np.max(np.abs(alone))


def test_few_samples_and_silence_leave_finite_rows() -> None:
    place = np.arange(12)
    short = [np.random.default_rng(0).standard_normal(12) for _ in range(2)]
    for residuals in (short, [np.zeros(12), np.zeros(12)]):
        white_of = joint_whitener(residuals, [place] * 2, 12, [0.0] * 2, [0, 0])
        assert all(np.all(np.isfinite(white)) for white in white_of([np.ones(12), np.ones(12)]))


def records_of(seed: int, lengths: list[int], louder: list[float], rows: int = 2) -> list[RowResiduals]:
    """Stretches of a chain's residuals as records, each so many times as loud."""
    whole = bodies(seed, rows)
    ends = np.cumsum([0, *lengths])
    return [
        RowResiduals(
            tuple(size * e[first:last] for e in whole),
            (np.arange(last - first),) * rows,
            last - first,
            (0.0,) * rows,
        )
        for first, last, size in zip(ends[:-1].tolist(), ends[1:].tolist(), louder, strict=True)
    ]


def test_records_of_the_same_noise_are_predicted_together_each_at_its_size() -> None:
    # at a tenth as loud the coefficients of all records still serve, its spread is its own
    records = records_of(0, [1500, 1500, 1500], [1.0, 1.0, 0.1])
    found = joint_whiteners(records, [0, 0])
    for row in range(2):
        together = [one.together[row] for one in found]
        assert all(one is not None and one.lost == len(one.terms) / 3 for one in together)
        assert len({tuple(one.shares.tolist()) for one in together if one is not None}) == 1
    for one, parts in zip(found, records, strict=True):
        assert all(0.9 < float(np.std(white)) < 1.1 for white in one(parts.residuals))
    assert sum(one.lost for one in found) == pytest.approx(joint_whiteners(records[:1], [0, 0])[0].lost)


def test_a_record_whose_noise_has_another_colour_keeps_its_own() -> None:
    first, other = records_of(1, [3000, 3000], [1.0, 1.0])
    rng = np.random.default_rng(5)
    white = tuple(rng.standard_normal(3000) for _ in range(2))
    other = RowResiduals(white, other.places, other.grid, other.least)
    common = joint_whiteners([first, other], [0, 0])
    alone = [joint_whiteners([one], [0, 0])[0] for one in (first, other)]
    for one, own, parts in zip(common, alone, (first, other), strict=True):
        for ours, theirs in zip(one(parts.residuals), own(parts.residuals), strict=True):
            # in tenths of a percent: what a row is predicted from is found in both records
            assert float(ours @ ours) == pytest.approx(float(theirs @ theirs), rel=0.05)


def test_what_is_in_few_rows_is_made_white_as_if_all_had_something() -> None:
    white, _, places = whitened(2, 6)
    rng, only = np.random.default_rng(1), np.zeros(1, dtype=np.int64)
    noise = [rng.standard_normal((len(place), 1)) for place in places]
    alone = [part if row == 1 else np.zeros_like(part) for row, part in enumerate(noise)]
    rest = [part - own for part, own in zip(noise, alone, strict=True)]
    every, few, others = (white.columns(one, [only] * 6) for one in (noise, alone, rest))
    assert any(part.any() for part, _ in few)
    assert not all(part.any() for part, _ in few)
    for (whole, _), (one, _), (other, _) in zip(every, few, others, strict=True):
        np.testing.assert_allclose(one + other, whole, atol=1e-12)
