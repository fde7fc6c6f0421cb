"""Tables of exponents give what a function gives, and its slopes."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.numerics.rational_functions import rational_functions

NAMES = ("J", "K", "F")
POINT = {"J": 0.7, "K": 3.0, "F": -1.3}


def long_function(p: Mapping[str, Any]) -> Any:
    """Return quotients of many products, with every operation that a module may write."""
    J, K, F = (p[name] for name in NAMES)
    sums = [
        sum(J**i * K**j * F**k * (i - 2.0 * j + 0.5) for i, j, k in product((1, 2, 3, 4), repeat=3))
        for _ in range(2)
    ]
    return 1.0 * np.array(
        [sums[0] / (J + K), 2.0 - sums[1] / (3.0 * K) / 4.0, -F + J / K - 1.0, 5.0 / (K - J), 3.0]
    )


def test_values_and_slopes_are_those_of_the_function() -> None:
    table = rational_functions(long_function, NAMES)
    assert table is not None
    assert table.values(POINT) == pytest.approx(long_function(POINT), rel=1e-12)
    slopes = [long_function({**POINT, name: POINT[name] + 1e-20j}).imag / 1e-20 for name in NAMES]
    assert table.slopes(POINT) == pytest.approx(np.array(slopes).T, rel=1e-12, abs=1e-12)


def test_a_denominator_of_zero_is_an_error() -> None:
    table = rational_functions(long_function, NAMES)
    assert table is not None
    with pytest.raises(ZeroDivisionError):
        table.values({**POINT, "J": 3.0})


def decides(p: Mapping[str, Any]) -> FloatArray:
    return np.asarray(long_function(p) if isinstance(p["J"], float) else 2.0 * long_function(p))


@pytest.mark.parametrize(
    "function",
    [lambda p: long_function(p)[2:], lambda p: [*long_function(p), np.exp(p["J"])], decides],
    ids=["few products", "no quotient", "another one for numbers"],
)
def test_other_functions_have_no_table(function: Any) -> None:
    assert rational_functions(function, NAMES) is None
