"""The field of integers modulo 2^61 - 1: values at samples, and elimination without any tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Self

import numpy as np
import numpy.typing as npt

#: A Mersenne prime: a product of 122 bits is reduced with shifts.
PRIME = (1 << 61) - 1

ResidueArray = npt.NDArray[np.uint64]


def residue(value: Fraction | int) -> int:
    """Return a rational as an element of the field."""
    return value.numerator * pow(value.denominator, -1, PRIME) % PRIME


def fraction_of(value: int) -> Fraction | None:
    """Return the fraction of at most 30 bits above and below the line that an element stands for, if any."""
    limit = 1 << 30
    top, bottom = (PRIME, value), (0, 1)
    while top[1] >= limit:
        ratio = top[0] // top[1]
        top = (top[1], top[0] - ratio * top[1])
        bottom = (bottom[1], bottom[0] - ratio * bottom[1])
    if not 0 < abs(bottom[1]) < limit:
        return None
    return Fraction(top[1], bottom[1])


class Residues:
    """Elements of the field, one a sample. Plain integers: at some dozens of samples faster than arrays."""

    __slots__ = ("values",)

    def __init__(self, values: list[int]) -> None:
        self.values = values

    def __add__(self, other: Self) -> Residues:
        return Residues([(a + b) % PRIME for a, b in zip(self.values, other.values, strict=True)])

    def __mul__(self, other: Self) -> Residues:
        return Residues([a * b % PRIME for a, b in zip(self.values, other.values, strict=True)])

    def __neg__(self) -> Residues:
        return Residues([-a % PRIME for a in self.values])

    def __rtruediv__(self, numerator: int) -> Residues:
        return Residues([numerator * pow(a, -1, PRIME) % PRIME for a in self.values])


def echelon(rows: Sequence[Sequence[int]]) -> tuple[ResidueArray, list[int]]:
    """Return the reduced echelon form without its zero rows, and the column of each row's leading one.

    The form has shape (rank, columns). Columns without a leading one depend on earlier ones: their entries
    say how.
    """
    matrix = np.array(rows, dtype=np.uint64)
    leading: list[int] = []
    for column in range(matrix.shape[1]):
        done = len(leading)
        candidates = np.flatnonzero(matrix[done:, column])
        if not len(candidates):
            continue
        pivot = done + int(candidates[0])
        matrix[[done, pivot]] = matrix[[pivot, done]]
        inverse = np.uint64(pow(int(matrix[done, column]), -1, PRIME))
        matrix[done, column:] = _product(matrix[done, column:], inverse)
        others = np.flatnonzero(matrix[:, column])
        others = others[others != done]
        places = column + np.flatnonzero(matrix[done, column:])
        block = np.ix_(others, places)
        factors = np.uint64(PRIME) - matrix[others, column]
        matrix[block] = _reduced(matrix[block] + _product(factors[:, None], matrix[done, places][None, :]))
        leading.append(column)
    return matrix[: len(leading)], leading


def _product(left: ResidueArray, right: ResidueArray | np.uint64) -> ResidueArray:
    """Return left * right modulo the prime, from halves of 31 bits: 2^61 is 1."""
    low, high = np.uint64((1 << 31) - 1), np.uint64(31)
    a1, a0 = left >> high, left & low
    b1, b0 = right >> high, right & low
    middle = a1 * b0 + a0 * b1  # below 2^62, to be shifted by 31 bits
    bits = np.uint64(30)
    shifted = (middle >> bits) + ((middle & np.uint64((1 << 30) - 1)) << high)
    return _reduced(((a1 * b1) << np.uint64(1)) + shifted + a0 * b0)


def _reduced(values: ResidueArray) -> ResidueArray:
    """Return values of up to 64 bits modulo the prime."""
    values = (values & np.uint64(PRIME)) + (values >> np.uint64(61))
    return np.where(values >= PRIME, values - np.uint64(PRIME), values)
