"""The poles of a chain, two for every body: each pair by its sum and product, which are smooth.

Two poles that meet (critical damping) have infinite slopes by the parameters, but not their sum and their
product. Pairs are told apart by the undamped modes that they grew out of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from math import perm

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.modes.thresholds import ALONE, FEW_WAYS, RIGID_SHARE, ROUNDS_OF_ITERATION

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class UndampedModes:
    """Squared circular frequencies, shape (n,), 0 where the chain turns freely, and shapes, (bodies, n).

    Shapes have a modal mass of one: the column k moves the bodies so that sum of J v^2 is 1.
    """

    squares: FloatArray
    shapes: FloatArray


@dataclass(frozen=True)
class PolePair:
    """Two poles of s^2 + `sum` s + `product` = 0: minus their sum in 1/s, their product in 1/s^2."""

    sum: float
    product: float


def undamped_modes(inertia: FloatArray, K: FloatArray) -> UndampedModes:
    """Return the modes without damping, lowest first.

    Parameters
    ----------
    inertia : array, shape (bodies,) or (bodies, bodies)
        In SI, above zero; a mass matrix, where it is not diagonal, is positive definite.
    K : array, shape (bodies, bodies)
        Stiffness, in SI.
    """
    if inertia.ndim > 1:
        lower = np.linalg.inv(np.linalg.cholesky(inertia))
        whitened = undamped_modes(np.ones(len(inertia)), lower @ K @ lower.T)
        return UndampedModes(whitened.squares, lower.T @ whitened.shapes)
    root = np.sqrt(inertia)
    symmetric = K / np.outer(root, root)
    squares, shapes = np.linalg.eigh(0.5 * (symmetric + symmetric.T))
    squares[np.abs(squares) <= RIGID_SHARE * np.abs(squares).max(initial=0.0)] = 0.0
    return UndampedModes(squares, shapes / root[:, None])


def pole_pairs(inertia: FloatArray, D: FloatArray, K: FloatArray, modes: UndampedModes) -> list[PolePair]:
    """Return the pair of poles of every mode, in the order of `modes`.

    Inertias, damping D and stiffness K (SI) have shape (bodies, bodies); inertias alone may be (bodies,).

    `modes` may be those of other values of the parameters, not far away: they show which pair is which.
    """
    A, unit = _modal(inertia, D, K, modes)
    poles, vectors = np.linalg.eig(A)
    n = len(A) // 2
    shares = np.abs(vectors[:n]) ** 2
    shares /= np.maximum(shares.sum(axis=0), np.finfo(float).tiny)
    pairs: dict[int, PolePair] = {}
    upper = np.flatnonzero(poles.imag > 0.0)
    # a free motion keeps a pole at zero: it never swings
    bound = np.flatnonzero(modes.squares != 0.0)
    for place, row in _assigned(shares[np.ix_(bound, upper)]):
        pole, k = poles[upper[place]], int(bound[row])
        pairs[k] = PolePair(-2.0 * float(pole.real) * unit, float(abs(pole)) ** 2 * unit**2)
    left = [k for k in range(n) if k not in pairs]
    real = np.flatnonzero(poles.imag == 0.0)
    taken: dict[int, list[float]] = {k: [] for k in left}
    twice = np.repeat(np.array(left, dtype=int), 2)
    for place, slot in _assigned(shares[np.ix_(twice, real)]):
        taken[int(twice[slot])].append(float(poles[real[place]].real))
    for k, (one, other) in taken.items():
        pairs[k] = PolePair(-(one + other) * unit, one * other * unit**2)
    return [pairs[k] for k in range(n)]


def pair_slopes(
    inertia: FloatArray,
    D: FloatArray,
    K: FloatArray,
    modes: UndampedModes,
    pairs: Sequence[PolePair],
    changes: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
) -> FloatArray:
    """Return the derivatives of each pair's sum and product by parameters, shape (pairs, 2, parameters).

    To first order a change of A moves the poles of a pair as it moves A in their invariant subspace, which is
    where A^2 + sum A + product vanishes: no eigenvector is needed, and none has to exist.

    Parameters
    ----------
    pairs : sequence of PolePair
        Some of `pole_pairs`; `modes` are those of these matrices.
    changes : sequence of (inertia, D, K)
        What each parameter adds to them per unit; inertias as a vector, or as a matrix, here and above.
    """
    A, unit = _modal(inertia, D, K, modes)
    n, shapes = len(A) // 2, modes.shapes
    # a parameter touches few entries of three matrices: each is looked up in their gradients
    entries = [_entries([change[kind] for change in changes]) for kind in range(3)]
    slopes = np.zeros((len(pairs), 2, len(changes)))
    poles, vectors = np.linalg.eig(A)
    try:
        rows = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:  # no pair has vectors of its own
        rows = np.zeros_like(vectors)
    for k, pair in enumerate(pairs):
        total, product = pair.sum / unit, pair.product / unit**2
        left, right = _swinging(poles, vectors, rows, total, product) or _invariant(A, total, product)
        S = left @ A @ right
        adjugate = np.array([[S[1, 1], -S[0, 1]], [-S[1, 0], S[0, 0]]])
        for row, share in enumerate((-unit * np.eye(2), unit**2 * adjugate)):
            # trace(share left[:, n:] dA right): dA = -(M A[n:] + [K / unit^2, D / unit])
            moved = (A[n:] @ right, right[n:] / unit, right[:n] / unit**2)
            ends = (share @ left[:, n:] @ shapes.T).T
            for (parameter, i, j, value), one in zip(entries, moved, strict=True):
                gradient = -np.sum((shapes @ one)[j] * ends[i], axis=1)
                slopes[k, row] += np.bincount(parameter, value * gradient, len(changes))
    return slopes


def _swinging(
    poles: ComplexArray, vectors: ComplexArray, rows: ComplexArray, total: float, product: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return what `_invariant` does of a pair that swings, from all poles, their vectors and its inverse.

    None where the vectors of the pair are nearly one: it is nearly critical, or like another.
    """
    swing = product - 0.25 * total**2
    if not swing > 0.0:
        return None
    place = int(np.argmin(np.abs(poles - complex(-0.5 * total, swing**0.5))))
    right = np.column_stack((vectors[:, place].real, vectors[:, place].imag))
    lines = np.stack((rows[place].real, rows[place].imag))
    both = lines @ right
    told = float(np.linalg.norm(lines) * np.linalg.norm(right))
    if not (told <= ALONE and np.linalg.cond(both) <= ALONE):
        return None
    return np.asarray(np.linalg.solve(both, lines)), right


def _invariant(A: FloatArray, total: float, product: float) -> tuple[FloatArray, FloatArray]:
    """Return bases of a pair's invariant subspace: left, shape (2, 2n), right, shape (2n, 2), left right = 1.

    By inverse iteration on A^2 + total A + product, whose zeros are no multiple ones.
    """
    size = len(A)
    polynomial = A @ A + total * A + product * np.eye(size)
    # it is singular, or nearly so; the shift changes no eigenvector
    shifted = polynomial + np.finfo(float).eps * np.linalg.norm(A) ** 2 * np.eye(size)
    # any start will do that lies in no other subspace
    start = np.random.default_rng(0).standard_normal((size, 2))
    bases = list[FloatArray]()
    for matrix in (shifted, shifted.T):
        basis = start
        for _ in range(ROUNDS_OF_ITERATION):
            basis = np.asarray(np.linalg.qr(np.linalg.solve(matrix, basis))[0])
        bases.append(basis)
    right, left = bases
    return np.asarray(np.linalg.solve(left.T @ right, left.T)), right


def _entries(parts: Sequence[FloatArray]) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Return parameter, row, column and value of all entries that are not zero; a vector is a diagonal."""
    places = [np.nonzero(part) for part in parts]
    counts = [len(place[0]) for place in places]
    rows = np.concatenate([place[0] for place in places])
    columns = np.concatenate([place[-1] for place in places])
    values = np.concatenate([part[place] for part, place in zip(parts, places, strict=True)])
    return np.repeat(np.arange(len(parts)), counts), rows, columns, values


def _modal(
    inertia: FloatArray, D: FloatArray, K: FloatArray, modes: UndampedModes
) -> tuple[FloatArray, float]:
    """Return A in coordinates of the modes and in time units of its fastest motion, and 1/s of these."""
    n = len(inertia)
    mass = np.diag(inertia) if inertia.ndim == 1 else inertia
    M, damping, stiffness = (modes.shapes.T @ part @ modes.shapes for part in (mass, D, K))
    free = modes.squares == 0.0
    # what rounding leaves of a free motion's stiffness would be a frequency
    stiffness[:, free] = 0.0
    stiffness[free] = 0.0
    fastest = max(float(np.abs(modes.squares).max()) ** 0.5, float(np.abs(damping).max()))
    unit = fastest or 1.0
    lower = -np.linalg.solve(M, np.hstack((stiffness / unit**2, damping / unit)))
    return np.vstack((np.hstack((np.zeros((n, n)), np.eye(n))), lower)), unit


def _assigned(shares: FloatArray) -> list[tuple[int, int]]:
    """Return pairs of column and row of (modes, poles), one to one, with the largest sum of shares."""
    rows, poles = np.arange(len(shares)), shares.shape[1]
    columns = shares.argmax(axis=1) if poles else rows
    if len(rows) > poles or len(set(columns.tolist())) < len(rows):
        # more than one wants the same: what is best for all
        if 0 < perm(poles, len(rows)) <= FEW_WAYS:
            ways = np.array(list(permutations(range(poles), len(rows))))
            columns = ways[np.argmax(shares[rows, ways].sum(axis=1))]
        else:
            from scipy.optimize import linear_sum_assignment

            rows, columns = linear_sum_assignment(-shares)
    return list(zip(columns.tolist(), rows.tolist(), strict=True))
