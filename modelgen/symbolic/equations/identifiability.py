"""Which physical parameters the base parameters determine.

Base parameters are quotients of polynomials in the physical ones. A physical parameter can be identified
when its gradient, a unit vector, lies in the space spanned by the gradients of the base parameters; that is
decided by exact arithmetic at a random point of a prime field, so no tolerance is involved. What can be
identified may still have several isolated solutions; those are found when numbers are there.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, MutableMapping, Sequence
from fractions import Fraction
from random import Random
from typing import Any, TypeVar

from sympy import GF
from sympy.polys.rings import PolyElement

from modelgen.spec.chain import ChainSpec
from modelgen.symbolic.equations.row import Composite

PRIME = 2_147_483_647
FIELD = GF(PRIME)
SEED = 2002

Key = TypeVar("Key", bound=Hashable)
#: a sparse vector over the prime field
Vector = dict[Key, int]


def identifiable_parameters(
    names: Sequence[str], base: Sequence[Sequence[tuple[str | Composite, Fraction | int]]]
) -> tuple[str, ...]:
    """Return the parameters that the values of the base parameters determine, at least locally.

    Parameters
    ----------
    names : sequence of str
        Physical parameters to be estimated.
    base : sequence of sequences of (str or Composite, factor)
        Each base parameter as a sum of factors times physical parameters (by name) or quotients of them.
    """
    point = random_point(names)
    pivots: dict[str, Vector[str]] = {}
    for combination in base:
        vector: Vector[str] = {}
        for column, factor in combination:
            weight = modular(factor)
            slopes = {column: 1} if isinstance(column, str) else _gradient(column, point)
            add_modular(vector, slopes, weight)
        reduce_modular(vector, pivots)
        if vector:
            pivots[next(iter(vector))] = vector
    # A unit vector lies in the row space exactly when it is a row of the fully reduced echelon form.
    for lead in reversed(list(pivots)):
        later = {key: pivot for key, pivot in pivots.items() if key != lead}
        reduce_modular(pivots[lead], later)
    return tuple(name for name in names if name in pivots and len(pivots[name]) == 1)


def random_point(names: Sequence[str]) -> dict[str, int]:
    """Return a random element of the prime field for every name."""
    random = Random(SEED)
    return {name: random.randrange(1, PRIME) for name in names}


def reduce_modular(vector: MutableMapping[Key, int], pivots: Mapping[Key, Mapping[Key, int]]) -> None:
    """Subtract multiples of the pivot rows until the vector has no entry at any pivot, in place."""
    pending = [key for key in vector if key in pivots]
    while pending:
        key = pending[0]
        pivot = pivots[key]
        add_modular(vector, pivot, -vector[key] * pow(pivot[key], -1, PRIME))
        pending = [key for key in vector if key in pivots]


def random_values(spec: ChainSpec, field: Any) -> dict[str, Any]:
    """Return a random element of a SymPy field for every parameter; known ones have their value."""
    point = {name: field(value) for name, value in random_point([p.name for p in spec.parameters]).items()}
    for name, value in spec.known.items():
        known = Fraction(str(value))
        point[name] = field(known.numerator) / field(known.denominator)
    return point


def value_at(poly: PolyElement, point: Mapping[str, Any], field: Any) -> Any:
    """Return the value of a polynomial in the parameters at a point of a SymPy field."""
    return sum((value for _, value in _terms(poly, point, field)), field.zero)


def _terms(poly: PolyElement, point: Mapping[str, Any], field: Any) -> Iterator[tuple[tuple[int, ...], Any]]:
    """Yield (exponents, value) of every term."""
    values = [point.get(symbol.name) for symbol in poly.ring.symbols]
    for exponents, coefficient in poly.items():
        term = field(int(coefficient.numerator)) / field(int(coefficient.denominator))
        for value, exponent in zip(values, exponents, strict=True):
            term = term * value**exponent if exponent else term
        yield exponents, term


def _slopes(poly: PolyElement, point: Mapping[str, int]) -> tuple[int, Vector[str]]:
    """Return the value of a polynomial and its gradient; a term's slope is exponent times value over x."""
    total, slopes = 0, [0] * poly.ring.ngens
    for exponents, element in _terms(poly, point, FIELD):
        term = int(element)
        total += term
        for place, exponent in enumerate(exponents):
            if exponent:
                slopes[place] += exponent * term
    names = [symbol.name for symbol in poly.ring.symbols]
    return total % PRIME, {
        name: slope * pow(point[name], -1, PRIME) % PRIME
        for name, slope in zip(names, slopes, strict=True)
        if slope % PRIME
    }


def _gradient(column: Composite, point: Mapping[str, int]) -> Vector[str]:
    a, top = _slopes(column.numerator, point)
    b, bottom = _slopes(column.denominator, point)
    square = pow(b, -2, PRIME)
    slopes = {name: (top.get(name, 0) * b - a * bottom.get(name, 0)) * square for name in {**top, **bottom}}
    return {name: slope % PRIME for name, slope in slopes.items() if slope % PRIME}


def add_modular(vector: MutableMapping[Key, int], other: Mapping[Key, int], factor: int) -> None:
    """Add a multiple of another vector, in place; entries that become zero are dropped."""
    for key, value in other.items():
        total = (vector.get(key, 0) + factor * value) % PRIME
        if total:
            vector[key] = total
        else:
            vector.pop(key, None)


def modular(value: Fraction | int) -> int:
    """Return a rational as an element of the prime field."""
    return value.numerator * pow(value.denominator, -1, PRIME) % PRIME
