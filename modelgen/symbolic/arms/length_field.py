"""Factors of base parameters: fractions, or quotients of polynomials in the lengths that have names."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from modelgen.errors import signed_sum
from modelgen.symbolic.arms.expressions.prime_field import PRIME, residue
from modelgen.symbolic.equations.signals import short_text

#: A fraction, or an element of SymPy's field of fractions over the named lengths.
Factor = Any
#: A factor below this is what fractions near an irrational number leave, and not shown.
NOTHING = Fraction(1, 10**12)


def length_elements(names: Mapping[str, float | None]) -> dict[str, Factor]:
    """Return every named length as an element of the field of all of them."""
    if not names:
        return {}
    from sympy import QQ, Symbol

    # Names come from the validated spec and reach SymPy as symbols only; nothing is ever sympified.
    field = QQ.frac_field(*(Symbol(name, real=True) for name in names))
    return dict(zip(names, field.gens, strict=True))


def factor_value(factor: Factor, lengths: Mapping[str, float]) -> float:
    """Return a factor as a number, at values of the lengths [m]."""
    if isinstance(factor, int | Fraction):
        return float(factor)
    top, bottom = (
        sum(float(c) * _product(powers, lengths) for c, powers in _terms(part))
        for part in (factor.numer, factor.denom)
    )
    return float(top / bottom)


def factor_residue(factor: Factor, lengths: Mapping[str, int]) -> int:
    """Return a factor modulo the prime, at residues of the lengths."""
    if isinstance(factor, int | Fraction):
        return residue(Fraction(factor))
    top, bottom = (
        sum(residue(c) * _residue_product(powers, lengths) for c, powers in _terms(part)) % PRIME
        for part in (factor.numer, factor.denom)
    )
    return top * pow(bottom, -1, PRIME) % PRIME


def combination_text(combination: tuple[tuple[str, Factor], ...]) -> str:
    """Return a sum of factors times parameters, for example ``Izz1 + Iyy2 + (d3**2 + r3**2)*m3``.

    What is left of an angle of 45 degrees, say, whose sine is no fraction, is not shown.
    """
    shown = [
        (parameter, *_signed_text(factor))
        for parameter, factor in combination
        if not (isinstance(factor, int | Fraction) and abs(Fraction(factor)) < NOTHING)
    ]
    return signed_sum((negative, f"{size}{'*' * bool(size)}{name}") for name, negative, size in shown)


def _signed_text(factor: Factor) -> tuple[bool, str]:
    """Return whether a factor is negative (of a sum: its first term), and its size; nothing for one."""
    if isinstance(factor, int | Fraction):
        size = abs(Fraction(factor))
        text = short_text(size)
        return factor < 0, "" if text == "1" else text
    negative = _terms(factor.numer)[0][0] < 0
    if negative:
        factor = -factor
    top, bottom = _polynomial_text(factor.numer), _polynomial_text(factor.denom)
    if bottom == "1":
        return negative, "" if top == "1" else top
    return negative, f"{top}/{bottom}"


def _polynomial_text(polynomial: Any) -> str:
    parts: list[tuple[bool, str]] = []
    for coefficient, powers in _terms(polynomial):
        factors = [name if power == 1 else f"{name}**{power}" for name, power in powers.items()]
        if abs(coefficient) != 1 or not factors:
            factors.insert(0, short_text(abs(coefficient)))
        parts.append((coefficient < 0, "*".join(factors)))
    return signed_sum(parts) if len(parts) == 1 else f"({signed_sum(parts)})"


def _terms(polynomial: Any) -> list[tuple[Fraction, dict[str, int]]]:
    """Return (coefficient, power of every length) of a polynomial's terms, highest first."""
    names = [symbol.name for symbol in polynomial.ring.symbols]
    return [
        (
            Fraction(int(coefficient.numerator), int(coefficient.denominator)),
            {name: power for name, power in zip(names, powers, strict=True) if power},
        )
        for powers, coefficient in polynomial.terms()
    ]


def _product(powers: Mapping[str, int], lengths: Mapping[str, float]) -> float:
    value = 1.0
    for name, power in powers.items():
        value *= lengths[name] ** power
    return value


def _residue_product(powers: Mapping[str, int], lengths: Mapping[str, int]) -> int:
    value = 1
    for name, power in powers.items():
        value = value * pow(lengths[name], power, PRIME) % PRIME
    return value
