"""Angles lie on the unit circle exactly, where they should; lengths are numbers or multiples of a name."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.number_expression import Misread
from modelgen.spec.arms.angles import RIGHT_ANGLE_RAD, angle_of, nearly_right, read_angle
from modelgen.spec.arms.arm import Length
from modelgen.spec.arms.lengths import read_length


@given(st.fractions(-1000, 1000, max_denominator=10**9))
def test_any_angle_is_on_the_circle_and_as_near_as_a_double(degrees: Fraction) -> None:
    angle = angle_of(degrees)
    assert angle.cosine**2 + angle.sine**2 == 1
    off_by = RIGHT_ANGLE_RAD if 0 in (angle.cosine, angle.sine) else 0
    # a multiple of 360 less, so that the reduction is exact; of small angles no digit is lost
    exact = math.radians(float((degrees + 180) % 360 - 180))
    assert float(angle.cosine) == pytest.approx(math.cos(exact), abs=1e-15 + off_by)
    assert float(angle.sine) == pytest.approx(math.sin(exact), abs=1e-15 + off_by)


@given(st.integers(-20, 20))
def test_multiples_of_a_right_angle_are_exact_however_they_are_written(quarters: int) -> None:
    right = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    radians = quarters * math.pi / 2
    written = (90 * quarters, 90.0 * quarters, f"{quarters}*pi/2", f"{radians:.7f} rad", f"{90 * quarters}°")
    for value in written:
        angle = read_angle(value)
        assert (angle.cosine, angle.sine) == right
        assert not nearly_right(angle)


@pytest.mark.parametrize("value", ["1.57 rad", "-3.14 rad", 89.95])
def test_what_is_nearly_right_is_noticed_and_left(value: object) -> None:
    angle = read_angle(value)
    assert nearly_right(angle) and 0 not in (angle.cosine, angle.sine)


@given(st.sampled_from((2, 3, 4, 6, 8, 9, 10, 12, 18, 24)), st.sampled_from((-1, 1)), st.integers(3, 12))
def test_radians_without_a_unit_are_refused(twelfths: int, sign: int, digits: int) -> None:
    with pytest.raises(Misread, match="looks like"):
        read_angle(sign * round(twelfths * math.pi / 12, digits))


@given(st.text(max_size=30))
def test_any_text_is_an_angle_or_a_length_or_misread(text: str) -> None:
    for reader in (read_angle, read_length):
        try:
            reader(text)
        except Misread as found:
            assert found.what and found.remedy


@pytest.mark.parametrize(
    ("value", "factor", "name"),
    [
        (0.4318, Fraction("0.4318"), None),
        ("L2", Fraction(1), "L2"),
        ("-L2/2", Fraction(-1, 2), "L2"),
        ("2*L2 / 3", Fraction(2, 3), "L2"),
        ("(1+2)*L", Fraction(3), "L"),
        ("0*L", Fraction(0), None),
        ("431.8/1000", Fraction("0.4318"), None),
    ],
)
def test_lengths(value: object, factor: Fraction, name: str | None) -> None:
    assert read_length(value) == Length(factor, name)


@pytest.mark.parametrize(
    "text", ["L2+1", "L*2", "def", "__import__('os')", "L2/0", "1/0*L", "L" * 65, "9" * 201]
)
def test_what_is_no_length(text: str) -> None:
    with pytest.raises(Misread):
        read_length(text)
