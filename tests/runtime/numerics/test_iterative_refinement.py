"""Refined solutions: of rows in pieces as of all of them, and few rows as one piece."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.numerics import iterative_refinement
from modelgen.runtime.numerics.iterative_refinement import ROUNDS, Parts, refined
from modelgen.runtime.numerics.regressor import Regressor

RNG = np.random.default_rng(3)
SAMPLES = RNG.standard_normal((600, 3)) @ np.array([[1.0, 1.0, 0.0], [0.0, 1e-7, 0.0], [0.0, 0.0, 1.0]])
MIX = np.array([[1.0, 0.5], [0.0, 1.0], [2.0, -1.0]])


def pieces(size: int, mix: np.ndarray | None = None) -> tuple[Parts, np.ndarray]:
    """Two blocks of rows, in pieces; the second has no part in the second column (or line of the mix)."""
    found, rows = [], []
    for start in range(0, 600, size):
        part, places = SAMPLES[start : start + size], None
        if start >= 300:
            part, places = part[:, [0, 2]], np.array([0, 2])
        one = Regressor(part, places, mix, 3 if mix is None else 2)
        found.append((one, one.dense() @ np.ones(one.columns) + 0.1 * RNG.standard_normal(len(part))))
        rows.append(one.dense())
    return found, np.concatenate(rows)


@pytest.mark.parametrize("mix", [None, MIX])
def test_pieces_give_what_one_piece_gives(mix: np.ndarray | None) -> None:
    parts, W = pieces(50, mix)
    Y = np.concatenate([one for _, one in parts])
    inverse = np.linalg.inv(W.T @ W)
    start = inverse @ (W.T @ Y) * (1.0 + 1e-9)
    x = refined(parts, start, inverse)
    apart = abs(x - refined([(W, Y)], start, inverse))
    assert np.all(apart < 1e-12 * np.sqrt(np.diag(inverse)))
    assert np.all(abs(W.T @ (Y - W @ x)) < 1e-9 * np.linalg.norm(W, axis=0))


@pytest.mark.parametrize(("most", "projections"), [(1800, ROUNDS), (1799, 12 * ROUNDS)])
def test_few_rows_are_one_piece(monkeypatch: pytest.MonkeyPatch, most: int, projections: int) -> None:
    monkeypatch.setattr(iterative_refinement, "ONE_PIECE", most)
    count, projection = [], iterative_refinement._projection

    def counted(W: np.ndarray, residual: np.ndarray) -> np.ndarray:
        count.append(len(W))
        return projection(W, residual)

    monkeypatch.setattr(iterative_refinement, "_projection", counted)
    parts, W = pieces(50)
    refined(parts, np.ones(3), np.linalg.pinv(W.T @ W))
    assert len(count) == projections


def test_a_piece_without_samples_adds_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    # a long stretch of a record may be masked as a whole
    monkeypatch.setattr(iterative_refinement, "ONE_PIECE", 0)
    parts, W = pieces(50)
    empty = (Regressor(np.empty((0, 3)), None, None, 3), np.empty(0))
    start, inverse = np.ones(3), np.linalg.inv(W.T @ W)
    found = refined([*parts[:4], empty, *parts[4:]], start, inverse)
    np.testing.assert_array_equal(found, refined(parts, start, inverse))
