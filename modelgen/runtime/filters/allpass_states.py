"""The state of a recursive filter in an orthonormal basis: a cascade of all-pass sections with its poles.

In the basis of the poles themselves, residues of poles that lie close together cancel and digits are lost:
all of them at order 4 and a hundredth of the Nyquist frequency. Here the responses phi_k = A^k b of the
states to one sample are orthonormal (the sum over k of phi_k phi_k^T is the unit matrix), so no
cut-off is bad. (The functions are those of Takenaka and Malmquist; the sections are normalised lattices,
Gray and Markel 1975.)
"""

from __future__ import annotations

import numpy as np

from modelgen.array_types import FloatArray


def allpass_states(sos: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return A, shape (n, n), and b, shape (n,), of s' = A s + b x with the poles of the sections.

    A A^T + b b^T is the unit matrix.

    Parameters
    ----------
    sos : array, shape (sections, 6)
        Stable sections of first or second order, as SciPy writes them.
    """
    A, b, c, d = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    for section in sos:
        A2, b2, c2, d2 = _section(section[4] / section[3], section[5] / section[3])
        upper = np.hstack([A, np.zeros((len(A), len(A2)))])
        A = np.vstack([upper, np.hstack([np.outer(b2, c), A2])])
        b, c, d = np.concatenate([b, b2 * d]), np.concatenate([d2 * c, c2]), d * d2
    return A, b


def responses(A: FloatArray, b: FloatArray, n: int) -> FloatArray:
    """Return phi_k = A^k b for k = 0 ... n - 1, in samples, shape (n, states).

    By doubling, so that errors stay small.
    """
    table = np.empty((n, len(b)))
    table[0] = b
    known, power = 1, A
    while known < n:
        more = min(known, n - known)
        table[known : known + more] = table[:more] @ power.T
        known += more
        power = power @ power
    return table


def _section(a1: float, a2: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return the orthogonal realisation of the all-pass section with denominator 1 + a1 z^-1 + a2 z^-2."""
    # 1 + a1 + a2 is small for a low cut-off; added in this order it is exact
    at_zero = (1.0 + a1) + a2
    k1 = a1 / (1.0 + a2)
    c1 = np.sqrt(at_zero / (1.0 + a2) * (1.0 - k1))
    if a2 == 0.0:
        return np.array([[-k1]]), np.array([c1]), np.array([c1]), float(k1)
    k2, c2 = a2, np.sqrt((1.0 - a2) * (1.0 + a2))
    A = np.array([[-k1, -c1 * k2], [c1, -k1 * k2]])
    return A, np.array([c1 * c2, k1 * c2]), np.array([0.0, c2]), float(k2)
