"""Principal directions of a series, of many instants or of fewer than it has columns."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.decorrelation import principal_directions, square_root


@pytest.mark.parametrize("shape", [(40, 6), (6, 6), (6, 40)])
def test_directions_are_those_of_the_products(shape: tuple[int, int]) -> None:
    series = np.random.default_rng(1).normal(size=shape)
    power, directions = principal_directions(series)
    assert len(power) == min(shape)
    assert (directions * power) @ directions.T == pytest.approx(series.T @ series, abs=1e-12)
    assert directions.T @ directions == pytest.approx(np.eye(len(power)), abs=1e-12)


def test_what_only_rounding_fills_is_no_direction() -> None:
    series = np.random.default_rng(2).normal(size=(30, 5))
    series[:, 4] = series[:, 0] + series[:, 1]
    assert principal_directions(series)[1].shape == (5, 4)


def test_the_part_that_is_never_negative() -> None:
    """What two numbers share adds to a sum of them and takes from their difference, which is left."""

    def never_negative(covariance: FloatArray, scale: FloatArray) -> FloatArray:
        root = square_root(covariance, scale)
        return np.asarray(root @ root.T)

    scale = np.array([1.0, 1e3])
    found = never_negative(np.array([[0.0, 1.0], [1.0, 0.0]]) * np.outer(scale, scale), scale)
    assert found / np.outer(scale, scale) == pytest.approx(np.full((2, 2), 0.5))
    given = np.array([[2.0, -1.0], [-1.0, 1.0]])
    assert never_negative(given, np.ones(2)) == pytest.approx(given)
    assert never_negative(given, np.array([1.0, 0.0])) == pytest.approx(np.diag([2.0, 0.0]))
