"""Numbers as people write them: the grammar's values, its refusals, and that nothing else is ever raised."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.number_expression import DEEPEST, LONGEST, PI, Misread, exact_number

NUMBERS = st.sampled_from(["1", "20", "0.01", ".5", "2.", "1e-3", "25.4E+0", "pi", "π"])


def _value(text: str) -> Fraction:
    return PI if text in ("pi", "π") else Fraction(text.rstrip(".") if text.endswith(".") else text)


@st.composite
def _sums(draw: st.DrawFn, depth: int = 3) -> tuple[str, Fraction]:
    """Return a text with its value; every sum in brackets, so that the value needs no grammar."""
    if depth == 0 or draw(st.booleans()):
        text = draw(NUMBERS)
        return text, _value(text)
    (left, a), (right, b) = draw(_sums(depth - 1)), draw(_sums(depth - 1))
    mark = draw(st.sampled_from("+-*/")) if b else draw(st.sampled_from("+-*"))
    value = {"+": a + b, "-": a - b, "*": a * b, "/": a / b if b else a}[mark]
    space = draw(st.sampled_from(["", " "]))
    return f"({left}{space}{mark}{space}{right})", value


@given(_sums())
def test_brackets_give_the_exact_value(drawn: tuple[str, Fraction]) -> None:
    text, value = drawn
    if len(text) <= LONGEST:
        assert exact_number(text) == value
        assert exact_number(f" -{text} ") == -value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2*pi/0.01", 200 * PI),
        ("1-2-3", Fraction(-4)),
        ("12/2/3", Fraction(2)),
        ("1+2*3", Fraction(7)),
        ("-2*-3", Fraction(6)),
        ("10/3", Fraction(10, 3)),
        ("0.1", Fraction(1, 10)),
        ("1e300/1e300", Fraction(1)),
    ],
)
def test_marks_bind_as_in_arithmetic(text: str, value: Fraction) -> None:
    assert exact_number(text) == value


def test_pi_is_the_double() -> None:
    assert float(PI) == math.pi


@pytest.mark.parametrize(
    ("text", "what", "remedy"),
    [
        ("", "is empty", "2*pi/0.01"),
        ("2*", "ends where a number should stand", "2*pi/0.01"),
        ("2*pii/0.01", "'pii' at character 3", "2*pi/0.01"),
        ("2^3", "'^' at character 2", "a power as a product"),
        ("2 ** 3", "** at character 3", "a power as a product"),
        ("20:1", "':' at character 3", "20/1"),
        ("0,5", "',' at character 2", "decimal point"),
        ("3 4", "'4' at character 3", "2*pi/0.01"),
        ("1/(2-2)", "divides by zero at character 3", "another number"),
        ("(1+2", "open bracket at character 1", "close it"),
        ("1)", "')' at character 2", "2*pi/0.01"),
        ("2pi", "'2pi' at character 1", "2*pi/0.01"),
        ("1e1000", "'1e1000' at character 1", "2*pi/0.01"),
        ("٣", "'٣' at character 1", "2*pi/0.01"),
        ("__import__('os')", "'__import__' at character 1", "2*pi/0.01"),
        ("(" * (DEEPEST + 1) + "1", f"more than {DEEPEST} brackets", "shorter"),
        ("-" * (DEEPEST + 1) + "1", f"more than {DEEPEST} brackets", "shorter"),
        ("1+" * LONGEST + "1", f"has {2 * LONGEST + 1} characters", f"{LONGEST}"),
    ],
)
def test_what_is_no_number_is_refused_where_it_stands(text: str, what: str, remedy: str) -> None:
    with pytest.raises(Misread) as found:
        exact_number(text)
    assert what in found.value.what
    assert remedy in found.value.remedy


@given(st.text(st.sampled_from("0123456789.eE+-*/() piπ_x\n\t,^"), max_size=40) | st.text(max_size=40))
def test_any_text_is_a_number_or_misread(text: str) -> None:
    try:
        value = exact_number(text)
    except Misread as found:
        assert found.what and found.remedy
    else:
        assert isinstance(value, Fraction)
