"""Composite parameters: what a row is linear in after an elimination, as quotients of polynomials.

A row is normalised so that a measured force has the coefficient 1: dividing by the coefficient of its lowest
derivative turns the others into quotients of polynomials in the physical parameters. Equal quotients share a
name, so that rows share their columns; a quotient that is a physical parameter keeps that parameter's name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from sympy import QQ, Symbol
from sympy.polys.rings import PolyElement, PolyRing

from modelgen.spec.chain import Parameter
from modelgen.symbolic.elimination.common_factor import common_factor, exact_quotient
from modelgen.symbolic.elimination.eliminated_row import EliminatedRow
from modelgen.symbolic.elimination.polynomials import Functional, by_order
from modelgen.symbolic.equations.row import Composite
from modelgen.symbolic.equations.sensor_reading import Candidate
from modelgen.symbolic.equations.signals import Signal, Term, collect, short_text

LONGEST_NAME = 40
#: of a coefficient; 1000 squared is one that a person reads
LARGEST_WHOLE = 1_000_000


class Part(NamedTuple):
    """One derivative in a row with its coefficient; `functional` holds its coordinates, if any."""

    signal: Signal
    functional: Functional | None
    value: PolyElement
    left: bool


class Composites:
    """The composites of one sensor set, named once each, in order of appearance."""

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.named: dict[str, Composite] = {}
        self._parameters = [parameter.name for parameter in parameters]
        self._dampings = {p.name for p in parameters if p.role in ("damping", "viscous")}
        self._names: dict[str, str] = {}

    def candidate(self, row: EliminatedRow) -> Candidate:
        """Return the row with named composites, normalised by a measured force."""
        parts = list(_parts(row))
        normal = min(parts, key=self._rank)
        terms: list[Term] = []
        for part in parts:
            columns = [(None, Fraction(1))] if part is normal else self._columns(part.value, normal.value)
            for column, factor in columns:
                # what stands on one side of the equation and belongs on the other changes its sign
                sign = -1 if part.left == (column is not None) else 1
                for body, weight in part.functional or ((part.signal.name, 1),):
                    terms.append(Term(column, part.signal._replace(name=body), sign * factor * weight))
        # The derivative of sign() is zero except at reversals: a row that differentiates it must avoid those.
        differentiated = [
            s.name for s, poly in row.constants.items() if s.kind != "one" and poly.degree(0) > 0
        ]
        directed = [functional[0][0] for kind, functional in row.coordinates if kind]
        origin = f"elimination of {', '.join(row.eliminated)} from the equations of {', '.join(row.bodies)}"
        masked = tuple(dict.fromkeys([*differentiated, *directed]))
        name = f"{'+'.join(row.bodies)} without {', '.join(row.eliminated)}"
        return Candidate(name, row.bodies, collect(terms), origin, masked)

    def _rank(self, part: Part) -> tuple[bool, bool, int]:
        """Prefer the lowest derivative of a force; without a force, the highest derivative of a coordinate.

        The highest derivative is the noisiest: on the left-hand side its noise does no harm. It must not hang
        on a damping alone, which may be as good as zero.
        """
        names = [symbol.name for symbol in part.value.ring.symbols]
        weak = all(
            any(power and name in self._dampings for name, power in zip(names, powers, strict=True))
            for powers in part.value
        )
        return not part.left, weak and not part.left, part.signal.order if part.left else -part.signal.order

    def quotient(self, parameter: str, divisor: str) -> str:
        """Return the name of the quotient of two physical parameters."""
        ring = PolyRing([Symbol(parameter), Symbol(divisor)], QQ)
        return self._name(*ring.gens)

    def held(self, column: str | None) -> tuple[str, ...]:
        """Return the physical parameters in a column."""
        if column is None:
            return ()
        return self.named[column].parameters if column in self.named else (column,)

    def _columns(self, value: PolyElement, scale: PolyElement) -> list[tuple[str | None, Fraction]]:
        """Return (column, factor) pairs whose sum is value / scale; a column of None is a number.

        A sum of physical parameters becomes their columns, which other rows may hold as well; a true quotient
        or product becomes one composite.
        """
        common = common_factor(value, scale)
        numerator, denominator = exact_quotient(value, common), exact_quotient(scale, common)
        if denominator.is_ground and all(sum(exponents) <= 1 for exponents in numerator):
            names = [symbol.name for symbol in numerator.ring.symbols]
            bottom = _fraction(denominator.LC)
            return [
                (names[exponents.index(1)] if any(exponents) else None, _fraction(coefficient) / bottom)
                for exponents, coefficient in numerator.terms()
            ]
        factor = Fraction(1)
        parts = []
        for poly, power in ((numerator, 1), (denominator, -1)):
            content, normal = poly.primitive()
            if normal.LC < 0:
                content, normal = -content, -normal
            if any(abs(c) > LARGEST_WHOLE for c in normal.coeffs()):
                # of gears of many digits: the column's value would have the size of whole numbers of twenty
                content, normal = content * normal.LC, normal.monic()
            factor *= _fraction(content) ** power
            parts.append(normal)
        return [(self._name(*parts), factor)]

    def _name(self, numerator: PolyElement, denominator: PolyElement) -> str:
        # Rings differ between rows; the text of the quotient, in the order of the spec, does not.
        exact = quotient_text(numerator, denominator, str)
        if exact not in self._names:
            formula = quotient_text(numerator, denominator, short_text)
            short = len(formula) <= LONGEST_NAME and formula not in self.named
            name = formula if short else self._number()
            self._names[exact] = name
            self.named[name] = Composite(numerator, denominator, formula)
        return self._names[exact]

    def _number(self) -> str:
        index = len(self.named) + 1
        while f"C{index}" in self._parameters or f"C{index}" in self.named:
            index += 1
        return f"C{index}"


def _fraction(value: Any) -> Fraction:
    return Fraction(int(value.numerator), int(value.denominator))


def quotient_text(numerator: PolyElement, denominator: PolyElement, text: Callable[[Fraction], str]) -> str:
    """Return a quotient as text, for example ``(J_m + J_c)/K``; `text` writes the size of a coefficient."""
    top, bottom = (
        " + ".join(monomials(poly, text)).replace(" + -", " - ") for poly in (numerator, denominator)
    )
    if denominator == denominator.ring.one:
        return top
    top = f"({top})" if len(numerator) > 1 else top
    bottom = f"({bottom})" if len(denominator) > 1 or "*" in bottom else bottom
    return f"{top}/{bottom}"


def monomials(poly: PolyElement, text: Callable[[Fraction], str]) -> Iterator[str]:
    """Yield the terms of a polynomial as text, in the order of its ring."""
    names = [symbol.name for symbol in poly.ring.symbols]
    for exponents, coefficient in poly.terms():
        size = _fraction(abs(coefficient))
        factors = [] if size == 1 else [text(size)]
        factors += [n if e == 1 else f"{n}**{e}" for n, e in zip(names, exponents, strict=True) if e]
        yield ("-" if coefficient < 0 else "") + ("*".join(factors) or "1")


def _parts(row: EliminatedRow) -> Iterator[Part]:
    for (kind, functional), poly in row.coordinates.items():
        for order, value in by_order(poly):
            yield Part(Signal(kind or "coordinate", "", order), functional, value, False)  # type: ignore[arg-type]
    for name, poly in row.forces.items():
        for order, value in by_order(poly):
            yield Part(Signal("force", name, order), None, value, True)
    for signal, poly in row.constants.items():
        yield from (Part(signal, None, value, False) for order, value in by_order(poly) if order == 0)
