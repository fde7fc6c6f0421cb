"""Which physical parameters the base parameters determine.

Base parameters are quotients of polynomials in the physical ones. A physical parameter can be identified
when its gradient, a unit vector, lies in the space spanned by the gradients of the base parameters; that is
decided by exact arithmetic at a random point of a prime field, so no tolerance is involved. What can be
identified may still have several isolated solutions; those are found when numbers are there.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from sympy.polys.rings import PolyElement, PolyRing

from modelgen.symbolic.row import Composite

PRIME = 2_147_483_647
SEED = 2002


def identifiable_parameters(
    ring: PolyRing, names: Sequence[str], base: Sequence[Composite]
) -> tuple[str, ...]:
    """Return the parameters that the values of the base parameters determine, at least locally.

    Parameters
    ----------
    ring : PolyRing
        Ring of the quotients; its first generator is s, the others are `names`.
    names : sequence of str
        Physical parameters to be estimated.
    base : sequence of Composite
        The base parameters as quotients in the physical ones.
    """
    random = Random(SEED)
    point = [random.randrange(1, PRIME) for _ in ring.gens]
    gradients = [[_derivative(column, n + 1, ring, point) for n in range(len(names))] for column in base]
    reduced = row_echelon(gradients)
    return tuple(name for n, name in enumerate(names) if any(_is_unit(row, n) for row in reduced))


def row_echelon(rows: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the reduced row echelon form over the prime field, without zero rows.

    A unit vector lies in the row space exactly when it is one of the rows of this form.
    """
    matrix = [list(row) for row in rows]
    done = 0
    for column in range(len(matrix[0]) if matrix else 0):
        pivot = next((i for i in range(done, len(matrix)) if matrix[i][column]), None)
        if pivot is None:
            continue
        matrix[done], matrix[pivot] = matrix[pivot], matrix[done]
        inverse = pow(matrix[done][column], -1, PRIME)
        matrix[done] = [value * inverse % PRIME for value in matrix[done]]
        for i, row in enumerate(matrix):
            if i != done and row[column]:
                factor = row[column]
                matrix[i] = [(a - factor * b) % PRIME for a, b in zip(row, matrix[done], strict=True)]
        done += 1
    return matrix[:done]


def evaluate(poly: PolyElement, point: Sequence[int]) -> int:
    """Return the value of a polynomial at a point of the prime field."""
    total = 0
    for exponents, coefficient in poly.items():
        term = int(coefficient.numerator) * pow(int(coefficient.denominator), -1, PRIME)
        for value, exponent in zip(point, exponents, strict=True):
            term = term * pow(value, exponent, PRIME) % PRIME
        total = (total + term) % PRIME
    return total


def _derivative(column: Composite, generator: int, ring: PolyRing, point: Sequence[int]) -> int:
    top, bottom = column.numerator, column.denominator
    variable = ring.gens[generator]
    a, b = evaluate(top, point), evaluate(bottom, point)
    slope = evaluate(top.diff(variable), point) * b - a * evaluate(bottom.diff(variable), point)
    return slope * pow(b, -2, PRIME) % PRIME


def _is_unit(row: Sequence[int], column: int) -> bool:
    return row[column] == 1 and sum(1 for value in row if value) == 1
