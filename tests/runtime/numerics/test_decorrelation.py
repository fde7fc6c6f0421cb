"""Principal directions of a series, of many instants or of fewer than it has columns."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.numerics.decorrelation import principal_directions


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
