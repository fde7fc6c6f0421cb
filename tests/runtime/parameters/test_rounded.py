from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.runtime.parameters.rounded import with_interval


@pytest.mark.parametrize(
    ("value", "low", "high", "text"),
    [
        (15150.3, 14911.0, 15389.6, "15150 +- 240"),
        (9.87e-6, 9.85e-6, 9.89e-6, "(9.870 +- 0.020)e-06"),
        (-2e-5, -3e-5, -1e-5, "(-2.0 +- 1.0)e-05"),
        (2.0, 1.5, 4.0, "2.00 (1.50 to 4.0)"),
        (0.0, -0.5, 0.5, "0.00 +- 0.50"),
        (99.6, 0.1, 199.1, "100 +- 100"),
        (3.0, 2.0, math.inf, "3 (2 to open)"),
        (3.0, 3.0, 3.0, "3"),
        (2.5e9, 2.4e9, 2.6e9, "(2.50 +- 0.10)e+09"),
        (2e-6, 1e-6, 5e-6, "(2.0, 1.0 to 5.0)e-06"),
        # bounds and rounding leave numbers beside their interval
        (1.0, 1.1, 1.3, "1.00 (1.10 to 1.30)"),
        (1.0, 0.8, 0.9, "1.000 (0.80 to 0.900)"),
    ],
)
def test_digits_are_those_that_the_interval_leaves(value: float, low: float, high: float, text: str) -> None:
    assert with_interval(value, low, high) == text


@given(
    st.floats(-1e12, 1e12).filter(lambda x: abs(x) > 1e-12),
    st.floats(1e-9, 1e3),
)
def test_what_is_shown_is_what_was_found(value: float, share: float) -> None:
    half = share * abs(value)
    text = with_interval(value, value - half, value + half)
    found = re.fullmatch(r"\(?(-?[\d.]+) \+- ([\d.]+)(?:\)e([+-]\d+))?", text)
    assert found is not None, text
    scale = 10.0 ** int(found[3] or 0)
    assert abs(float(found[1]) * scale - value) <= 0.051 * half + 1e-9 * abs(value)
    assert float(found[2]) * scale == pytest.approx(half, rel=0.051)
