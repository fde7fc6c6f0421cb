"""Rows with open forces hold next to nothing of their pulses, and are the same however they are cut."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.rows.left_open.open_forces import (
    OpenedRows,
    OpenForces,
    joined,
    least_certain,
    with_open_forces,
)
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.rows.thresholds import PULSE_LEFT, PULSE_WINDOW

START, FACTOR, GRID = 30, 5, 700


def block(place: IntArray | None = None) -> RowBlock:
    """Return a block of noise with three columns."""
    rng, own = np.random.default_rng(5), np.arange(GRID) if place is None else place
    Y, W = rng.standard_normal(len(own)), rng.standard_normal((len(own), 3))
    return RowBlock(
        record=0,
        row=0,
        record_name="r",
        row_name="row",
        unit="N m",
        place=own,
        grid=GRID,
        Y=Y,
        W=W,
        masked=GRID - len(own),
        has_force=True,
        force_scale=1.0,
        differentiated=0,
        start=START,
    )


def pulse() -> FloatArray:
    return np.exp(-((np.arange(-40, 41) / 12.0) ** 2))


def forces() -> OpenForces:
    rng = np.random.default_rng(6)
    return OpenForces(np.sort(rng.choice(3600, 60, replace=False)), pulse()[None], START, FACTOR)


def felt(at: OpenForces, place: IntArray) -> FloatArray:
    """Return the pulses at points of the grid, shape (points, samples)."""
    apart = START + FACTOR * place[:, None] - at.samples + 40
    return np.where((apart >= 0) & (apart <= 80), pulse()[np.clip(apart, 0, 80)], 0.0)


@pytest.mark.parametrize("gaps", [False, True])
def test_a_force_that_is_open_is_in_no_row(gaps: bool) -> None:
    place = np.setdiff1d(np.arange(GRID), np.arange(200, 350)) if gaps else np.arange(GRID)
    at, one = forces(), block(place)
    opened = with_open_forces(one, at, 256)
    pulses = felt(at, place)
    size = float(np.sum(pulse()[::FACTOR] ** 2))
    for column in pulses.T:
        bumped = with_open_forces(RowBlock(**{**vars(one), "Y": one.Y + 7.0 * column}), at, 256)
        assert np.linalg.norm(bumped.Y - opened.Y) <= 7.0 * PULSE_LEFT * np.sqrt(size / 2.0)
    # by its definition, window by window
    taken = 0.0
    for window in range(-(-GRID // PULSE_WINDOW)):
        own = place // PULSE_WINDOW == window
        powers, ways = np.linalg.eigh(pulses[own] @ pulses[own].T)
        less = PULSE_LEFT**2 * size / (powers + PULSE_LEFT**2 * size)
        taken += float(np.sum(1.0 - less))
        for before, behind in ((one.Y, opened.Y), (one.W, opened.W)):
            expected = (ways * less) @ (ways.T @ before[own])
            np.testing.assert_allclose(behind[own], expected, rtol=0.0, atol=1e-10)
    assert opened.opened == pytest.approx(taken, rel=1e-3)


@pytest.mark.parametrize("gaps", [False, True])
def test_cuts_change_nothing(gaps: bool) -> None:
    place = np.setdiff1d(np.arange(GRID), np.arange(200, 350)) if gaps else None
    one, at = block(place), forces()
    whole, rows = with_open_forces(one, at, 256), OpenedRows(one, at)
    for cut in (64, 100, 333):
        parts = [rows.between(start, min(start + cut, GRID)) for start in range(0, GRID, cut)]
        np.testing.assert_array_equal(np.concatenate([part.place for part in parts]), whole.place)
        np.testing.assert_allclose(np.concatenate([part.Y for part in parts]), whole.Y, atol=1e-12)
        np.testing.assert_allclose(np.concatenate([part.W for part in parts]), whole.W, atol=1e-12)
        assert [part.rows.start for part in parts[1:]] == [part.rows.stop for part in parts[:-1]]
    longest = rows.longest_run(100)
    assert len(longest.place) == 100
    np.testing.assert_allclose(longest.Y, whole.between(int(longest.place[0]), GRID).Y[:100], atol=1e-12)


def test_the_least_certain_samples_are_taken_first() -> None:
    near = np.array([0, 1, 12, 13, 25, 40])
    certain = np.array([0.5, 0.1, 2.0, 1.9, 0.3, 1.0])
    assert least_certain(near, certain, 10, 10).tolist() == [0, 12, 25, 40]
    assert least_certain(near, certain, 10, 2).tolist() == [0, 25]
    assert least_certain(near, certain, 10, 0).tolist() == []
    found = joined([(near, certain), (np.array([1, 26]), np.array([0.05, 0.2]))])
    assert found[0].tolist() == [0, 1, 12, 13, 25, 26, 40]
    assert found[1].tolist() == [0.5, 0.05, 2.0, 1.9, 0.3, 0.2, 1.0]
