"""Quotients of polynomials as tables of exponents: their values and slopes in a few operations on arrays.

Composites of chains with unseen bodies have hundreds of products each. Written out in Python, one evaluation
takes a millisecond and slopes by complex steps one more for every parameter; from a table, both take
microseconds. The table comes from the function itself: it is called with polynomials in place of numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray

Terms = dict[tuple[int, ...], float]

# Fewer products than this are evaluated faster as they are written.
MANY_PRODUCTS = 100
# Relative error of the table at a point, by rounding alone.
ROUNDING = 1e-9
SEED = 2002


@dataclass(frozen=True, eq=False)
class RationalFunctions:
    """Quotients of polynomials of the same variables, which have `names` and any units.

    `exponents` has shape (products, variables), `factors` (products,); products belong together from one of
    `first`, shape (2 * functions,), to the next: the numerator of each function, then its denominator.
    """

    names: Set[str]
    exponents: npt.NDArray[np.int64]
    factors: FloatArray
    first: npt.NDArray[np.int64]

    def values(self, variables: Mapping[str, float]) -> FloatArray:
        """Return the functions, shape (functions,), of variables by name; any units.

        Raises ZeroDivisionError where a denominator is zero.
        """
        with np.errstate(all="ignore"):
            sums = np.add.reduceat(self._products(self._in_order(variables)), self.first)
            if not sums[1::2].all():
                raise ZeroDivisionError
            return np.asarray(sums[0::2] / sums[1::2])

    def slopes(self, variables: Mapping[str, float]) -> FloatArray:
        """Return derivatives by the variables, shape (functions, variables), none of them zero; any units."""
        with np.errstate(all="ignore"):
            x = self._in_order(variables)
            products = self._products(x)
            sums = np.add.reduceat(products, self.first)
            grown = np.add.reduceat(products[:, None] * self.exponents, self.first) / x
            above, below = sums[0::2, None], sums[1::2, None]
            return np.asarray((grown[0::2] - above / below * grown[1::2]) / below)

    def _in_order(self, variables: Mapping[str, float]) -> FloatArray:
        return np.array([variables[name] for name in self.names], dtype=float)

    @cached_property
    def _places(self) -> npt.NDArray[np.int64]:
        """Where each power stands in a flat table, shape (variables, products)."""
        width = self.exponents.shape[1]
        return np.ascontiguousarray((self.exponents * width + np.arange(width)).T)

    def _products(self, x: FloatArray) -> FloatArray:
        powers = x ** np.arange(self.exponents.max(initial=0) + 1)[:, None]
        return np.asarray(self.factors * np.prod(powers.ravel()[self._places], axis=0))


def rational_functions(
    function: Callable[[Mapping[str, Any]], Any], names: Sequence[str]
) -> RationalFunctions | None:
    """Return the table of a function, None where it has few products or is no quotient of polynomials.

    `function` takes a mapping from names to numbers and returns an array, shape (functions,), any units.
    """
    size = len(names)
    one = {(0,) * size: 1.0}
    unit = np.eye(size, dtype=int).tolist()
    variables = {name: _Quotient({tuple(row): 1.0}, one) for name, row in zip(names, unit, strict=True)}
    try:
        found = [_as_quotient(entry, one) for entry in function(variables)]
    except TypeError:
        return None
    lists = [terms or {(0,) * size: 0.0} for entry in found for terms in (entry.above, entry.below)]
    if sum(map(len, lists)) < MANY_PRODUCTS:
        return None
    table = RationalFunctions(
        dict.fromkeys(names).keys(),
        np.array([key for terms in lists for key in terms], dtype=np.int64),
        np.array([value for terms in lists for value in terms.values()]),
        np.cumsum([0, *map(len, lists)])[:-1],
    )
    # a function that decides by the values of its variables is another one elsewhere
    point = dict(zip(names, np.random.default_rng(SEED).uniform(0.5, 2.0, size).tolist(), strict=True))
    return table if np.allclose(table.values(point), function(point), rtol=ROUNDING, atol=0.0) else None


class _Quotient:
    """A quotient of polynomials that stands in for a number; terms by exponent."""

    def __init__(self, above: Terms, below: Terms) -> None:
        self.above, self.below = above, below

    def __add__(self, other: Any) -> _Quotient:
        added = _as_quotient(other, self.below)
        if added.below == self.below:
            return _Quotient(_sum(self.above, added.above), self.below)
        across = _sum(_product(self.above, added.below), _product(added.above, self.below))
        return _Quotient(across, _product(self.below, added.below))

    def __mul__(self, other: Any) -> _Quotient:
        if not isinstance(other, _Quotient):
            return _Quotient({key: value * other for key, value in self.above.items()}, self.below)
        return _Quotient(_product(self.above, other.above), _product(self.below, other.below))

    def __truediv__(self, other: Any) -> _Quotient:
        if not isinstance(other, _Quotient):
            return self.__mul__(1.0 / other)
        return _Quotient(_product(self.above, other.below), _product(self.below, other.above))

    def __rtruediv__(self, other: float) -> _Quotient:
        return _Quotient(self.below, self.above).__mul__(other)

    def __neg__(self) -> _Quotient:
        return self.__mul__(-1.0)

    def __sub__(self, other: Any) -> _Quotient:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> _Quotient:
        return self.__neg__().__add__(other)

    def __pow__(self, power: int) -> _Quotient:
        found = self
        for _ in range(power - 1):
            found = found.__mul__(self)
        return found

    __radd__, __rmul__ = __add__, __mul__


def _as_quotient(value: Any, like: Terms) -> _Quotient:
    """Return a number as a quotient over one; `like` shows how many variables there are."""
    if isinstance(value, _Quotient):
        return value
    none = (0,) * len(next(iter(like)))
    return _Quotient({none: float(value)}, {none: 1.0})


def _sum(terms: Terms, more: Terms) -> Terms:
    found = dict(terms)
    for key, value in more.items():
        found[key] = found.get(key, 0.0) + value
    return found


def _product(terms: Terms, more: Terms) -> Terms:
    found: Terms = {}
    for key, value in terms.items():
        for other, factor in more.items():
            both = tuple(map(int.__add__, key, other))
            found[both] = found.get(both, 0.0) + value * factor
    return found
