"""The exponential of a small matrix: scaling and squaring with the Pade approximant of order 13.

Higham 2005, "The scaling and squaring method for the matrix exponential revisited". SciPy has it as well, but
its import takes as long as the simulation of a short record.
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray

# Coefficients of the numerator's powers; below this norm the approximant is exact to rounding.
COEFFICIENTS = (
    64764752532480000.0,
    32382376266240000.0,
    7771770303897600.0,
    1187353796428800.0,
    129060195264000.0,
    10559470521600.0,
    670442572800.0,
    33522128640.0,
    1323241920.0,
    40840800.0,
    960960.0,
    16380.0,
    182.0,
    1.0,
)
LARGEST_NORM = 5.371920351148152


def matrix_exponential(A: FloatArray) -> FloatArray:
    """Return exp(A), shape (n, n)."""
    norm = float(np.linalg.norm(A, 1)) if A.size else 0.0
    halvings = max(0, int(np.ceil(np.log2(norm / LARGEST_NORM)))) if norm > 0.0 else 0
    A = A / 2.0**halvings
    square = A @ A
    even, odd = np.zeros_like(A), np.zeros_like(A)
    power = np.eye(len(A))
    for k in range(0, len(COEFFICIENTS), 2):
        even, odd = even + COEFFICIENTS[k] * power, odd + COEFFICIENTS[k + 1] * power
        power = power @ square
    odd = A @ odd
    # what is added to the unit matrix alone is rounded: a position at rest stays where it is
    found = np.eye(len(A)) + np.linalg.solve(even - odd, 2.0 * odd)
    for _ in range(halvings):
        found = found @ found
    return np.asarray(found)
