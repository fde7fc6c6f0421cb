"""Rows that have few of many columns give with instruments what they give with zeros for the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.least_squares.efficient_weights import efficient
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.further_columns import with_columns, without_columns
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.spanned import Spanned
from modelgen.runtime.least_squares.wls import fit_matched, refit
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock

BODIES, N = 6, 400


def chain(seed: int) -> tuple[Fit, tuple[FloatArray, ...], list[list[FloatArray]]]:
    """A chain's rows by least squares, their instruments, and a delay's column of each row.

    Every row has an inertia of its own and the springs to both neighbours.
    """
    rng = np.random.default_rng(seed)
    names = [f"J{k}" for k in range(BODIES)] + [f"K{k}" for k in range(BODIES - 1)]
    blocks, Z, late = [], [], []
    shared = rng.standard_normal((BODIES + 1, N))
    for k in range(BODIES):
        touched = np.array([k, *(BODIES + j for j in (k - 1, k) if 0 <= j < BODIES - 1)])
        z = np.cumsum(rng.standard_normal((N, len(touched))), axis=0)
        W = z + 0.1 * rng.standard_normal(z.shape)
        # neighbours share noise
        noise = shared[k] + 0.7 * shared[k + 1]
        Y = z @ (1.0 + touched) + noise
        place = np.delete(np.arange(N + 5), rng.permutation(N)[:5])
        more = {"touched": touched}
        blocks.append(RowBlock(0, k, "run", f"b{k}", "N", place, N + 5, Y, W, 0, True, 1.0, 0, **more))
        Z.append(z)
        late.append([np.gradient(Y) if j == k else np.zeros(N) for j in range(BODIES)])
    return fit_matched(Observation(tuple(names), tuple(blocks))), tuple(Z), late


def dense(fit: Fit, Z: Sequence[FloatArray]) -> tuple[Fit, tuple[FloatArray, ...]]:
    """The same with all columns."""
    wide = []
    for block, z in zip(fit.blocks, Z, strict=True):
        every = np.zeros((len(z), len(fit.columns)))
        every[:, block.touched] = z
        wide.append(every)
    return fit.dense(), tuple(wide)


def alike(found: Fit, expected: Fit) -> None:
    np.testing.assert_allclose(found.solution.x, expected.solution.x, rtol=1e-10)
    np.testing.assert_allclose(found.solution.inverse, expected.solution.inverse, rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(hac_covariance(found), hac_covariance(expected), rtol=1e-8, atol=1e-12)
    for one, other in zip(found.regressors, expected.regressors, strict=True):
        np.testing.assert_allclose(one.dense(), other.dense(), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_instruments_delays_and_white_rows_give_the_same(seed: int) -> None:
    fit, Z, late = chain(seed)
    wide, wide_Z = dense(fit, Z)
    found, expected = two_stage(fit, Z), two_stage(wide, wide_Z)
    assert not found.regressors.plain and expected.regressors.plain
    alike(found, expected)
    alike(refit(found, found.columns[1:-1]), refit(expected, expected.columns[1:-1]))
    columns = [list(one) for one in zip(*late, strict=True)]
    larger, other = with_columns(found, found.regressors, columns), with_columns(expected, wide_Z, columns)
    alike(larger, other)
    alike(without_columns(larger, found), without_columns(other, expected))
    white, all_white = efficient(larger), efficient(other)
    alike(white, all_white)
    last = without_columns(white, found)
    alike(last, without_columns(all_white, expected))
    # a fit without delays as the instruments of another: more lines are mixed than there are columns
    weights = tuple(float(k + 1) for k in range(BODIES))
    alike(
        two_stage(replace(last, weights=weights), last.regressors),
        two_stage(replace(last.dense(), weights=weights), last.dense().regressors),
    )


def test_what_lies_outside_of_the_regressors_is_the_same() -> None:
    fit, Z, late = chain(7)
    found = two_stage(fit, Z)
    extra = [list(one) for one in zip(*late, strict=True)]
    few = Spanned(found.regressors.joined(extra).weighted(found.weights))
    every = Spanned(found.regressors.dense().joined(extra).weighted(found.weights))
    column = np.random.default_rng(8).standard_normal(BODIES * N)
    np.testing.assert_allclose(few.apart(column), every.apart(column), atol=1e-9)
    np.testing.assert_allclose(few.sizes, every.sizes)
    parts = few.parts(column)
    lengths = []
    for one in (few, every):
        across = sum((one.across(index, part) for index, part in enumerate(parts)), np.zeros(one.width))
        lengths.append(np.linalg.norm(one.coordinates(across)))
        # parameters of the regression
        np.testing.assert_allclose(one.back @ one.coordinates(across), every.back @ _sum(every, parts))
    assert lengths[0] == pytest.approx(lengths[1])


def _sum(spanned: Spanned, parts: Sequence[FloatArray]) -> FloatArray:
    across = [spanned.across(index, part) for index, part in enumerate(parts)]
    return spanned.coordinates(np.sum(across, axis=0))
