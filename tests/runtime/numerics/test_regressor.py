"""Columns kept as the few that make them do what the columns themselves do."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.numerics.regressor import Regressors, plain_regressors

C, M = 7, 5


def sparse(seed: int, mixed: bool) -> tuple[Regressors, list[np.ndarray]]:
    """Three blocks that have some of the columns each, and the same with all columns."""
    rng = np.random.default_rng(seed)
    lines = M if mixed else C
    mix = rng.standard_normal((lines, C)) if mixed else None
    places = [np.sort(rng.permutation(lines)[:3]) for _ in range(3)]
    samples = tuple(rng.standard_normal((n, 3)) for n in (4, 6, 9))
    every = np.eye(C) if mix is None else mix
    dense = [part @ every[own] for part, own in zip(samples, places, strict=True)]
    return Regressors(samples, tuple(places), mix, C), dense


@pytest.mark.parametrize("mixed", [False, True])
def test_it_multiplies_as_its_columns_do(mixed: bool) -> None:
    found, dense = sparse(1, mixed)
    rng = np.random.default_rng(2)
    x, share = rng.standard_normal(C), rng.standard_normal((C, 4))
    for one, R in zip(found, dense, strict=True):
        rows = rng.standard_normal((len(R), 2))
        np.testing.assert_allclose(one.dense(), R, atol=1e-14)
        np.testing.assert_allclose(one.times(x), R @ x, atol=1e-13)
        np.testing.assert_allclose(one.across(rows), R.T @ rows, atol=1e-13)
        np.testing.assert_allclose(one.within(slice(1, 3)).dense(), R[1:3], atol=1e-14)
        some = np.array([4, 0, 6])
        np.testing.assert_allclose(one.chosen(some), R[:, some], atol=1e-14)
    for one, R in zip(found.mixed(share), dense, strict=True):
        np.testing.assert_allclose(one.dense(), R @ share, atol=1e-13)
    for one, R in zip(found.chosen([5, 2]), dense, strict=True):
        np.testing.assert_allclose(one.dense(), R[:, [5, 2]], atol=1e-14)
    for one, R, weight in zip(found.weighted((1.0, 2.0, 3.0)), dense, (1.0, 2.0, 3.0), strict=True):
        np.testing.assert_allclose(one.dense(), weight * R, atol=1e-13)


@pytest.mark.parametrize("mixed", [False, True])
def test_further_columns_stand_behind_its_own(mixed: bool) -> None:
    found, dense = sparse(3, mixed)
    rng = np.random.default_rng(4)
    everywhere = [rng.standard_normal(len(R)) for R in dense]
    once = [np.zeros(len(R)) for R in dense]
    once[1] = rng.standard_normal(len(once[1]))
    larger = found.joined([everywhere, once])
    assert larger.columns == C + 2
    assert [part.shape[1] for part in larger.samples] == [4, 5, 4]
    for index, one in enumerate(larger):
        expected = np.column_stack([dense[index], everywhere[index], once[index]])
        np.testing.assert_allclose(one.dense(), expected, atol=1e-14)


def test_arrays_with_all_columns_stay_what_they_are() -> None:
    _, dense = sparse(5, False)
    found = plain_regressors(tuple(dense))
    assert found.plain and found.dense() is found
    assert found.mixed(np.eye(C)[:, :2]).plain and found.joined([[R[:, 0] for R in dense]]).plain
    assert all(one.dense() is R for one, R in zip(found, dense, strict=True))


@pytest.mark.parametrize("plain", [False, True])
def test_they_know_what_they_were_mixed_of(plain: bool) -> None:
    first, dense = sparse(5, mixed=False)
    first = plain_regressors(tuple(dense)) if plain else first
    rng = np.random.default_rng(6)
    further = [[rng.standard_normal(len(R)) for R in dense]]
    shares = rng.standard_normal((C, C)), rng.standard_normal((C + 1, C))
    assert first.made is None
    found = first.mixed(shares[0]).joined(further).mixed(shares[1]).chosen([5, 0, 2])
    assert found.made is not None
    for one, R, more in zip(found, dense, further[0], strict=True):
        np.testing.assert_allclose(one.dense(), np.column_stack([R, more]) @ found.made, atol=1e-12)
