"""Bodies weighed by how likely such a spread of mass is, beside how well they explain the rows.

What bodies can have is bounded by bodies without thickness, and the nearest of them to a noisy estimate is
one: farther from the truth than bodies inside are. The determinant of a link's second moments about its
centre, over the cube of their mean, is one for a ball and zero for a plate or a rod, whatever the size, mass
and place. Its logarithm is added to the log-likelihood, as in the density of matrices that are made of random
points (Wishart 1928), as which Wensing, Kim and Slotine (2018) write bodies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.parameters.consistent_links import LINK, PSEUDO_INERTIA, Bodies
from modelgen.runtime.parameters.thresholds import (
    CENTRED,
    CENTRING_STEPS,
    CONCAVE_SHARES,
    HELD,
    LIFTED,
    SHORTEST_STEP,
    SMALLEST_GAIN,
)


@dataclass(frozen=True, eq=False)
class Centred:
    """Parameters of bodies, shape (parameters,) in SI, and the curvature of what they make least.

    The inverse of that, shape (parameters, parameters), is the covariance of the parameters where the spread
    of mass is as likely as was taken.
    """

    parameters: FloatArray
    curvature: FloatArray


@dataclass(frozen=True, eq=False)
class _Link:
    """A pseudo-inertia: `rest`, (4, 4), and parameters at `places`, (k,), times `basis`, (k, 4, 4); SI."""

    places: FloatArray
    basis: FloatArray
    rest: FloatArray

    def at(self, x: FloatArray) -> FloatArray:
        """Return the matrix, shape (4, 4), of parameters x, shape (parameters,), in SI."""
        return np.asarray(self.rest + np.tensordot(x[self.places], self.basis, 1))


def centred_bodies(
    estimate: FloatArray,
    whitening: FloatArray,
    factors: FloatArray,
    bodies: Bodies,
    nearest: Mapping[str, float],
) -> Centred:
    """Return the parameters of bodies that are likely, and explain an estimate well.

    Parameters
    ----------
    estimate, whitening, factors
        As for `nearest_bodies`: shapes (n,), (k, n), (n, parameters).
    bodies : Bodies
    nearest : mapping of str to float
        Parameters (SI) of the nearest bodies, to begin with.
    """
    links = _links(bodies)
    kept = np.array([bodies.parameters.index(name) for name in bodies.nonnegative], dtype=int)
    white = whitening @ factors
    seen, aim = white.T @ white, white.T @ (whitening @ estimate)
    x = _inside(links, kept, np.array([nearest[name] for name in bodies.parameters]), np.diag(seen))

    def height(at: FloatArray) -> float:
        spread = sum(_unlikeliness(link.at(at)) for link in links)
        if np.any(at[kept] <= 0.0) or not np.isfinite(spread):
            return float(np.inf)
        return float(0.5 * at @ seen @ at - aim @ at + CENTRED * spread - HELD * np.sum(np.log(at[kept])))

    before = height(x)
    for _ in range(CENTRING_STEPS):
        slope, curvature = _expansion(links, kept, x, seen, aim)
        step = -np.linalg.solve(curvature, slope)
        gain, share = float(-slope @ step), 1.0
        while (after := height(x + share * step)) > before - 1e-4 * share * gain and share > SHORTEST_STEP:
            share *= 0.5
        if share <= SHORTEST_STEP or gain < SMALLEST_GAIN:
            break
        x, before = x + share * step, after
    return Centred(x, _expansion(links, kept, x, seen, aim)[1])


def _links(bodies: Bodies) -> tuple[_Link, ...]:
    found = []
    for names in bodies.links:
        pairs = list(zip(names, LINK, strict=True))
        own = [pair for pair in pairs if pair[0] in bodies.parameters]
        known = [
            bodies.known[name] * PSEUDO_INERTIA[of] for name, of in pairs if name not in bodies.parameters
        ]
        places = np.array([bodies.parameters.index(name) for name, _ in own], dtype=int)
        basis = np.array([PSEUDO_INERTIA[of] for _, of in own]).reshape(-1, 4, 4)
        found.append(_Link(places, basis, np.sum([np.zeros((4, 4)), *known], axis=0)))
    return tuple(found)


def _inside(links: Sequence[_Link], kept: FloatArray, x: FloatArray, seen: FloatArray) -> FloatArray:
    """Return parameters inside the cones: a ball about the origin is added to every link.

    As large as a share of the link, or as what the rows know of it: `seen` are the squares of the weighted
    columns, shape (parameters,).
    """
    found = x.copy()
    spread = 1.0 / np.sqrt(np.where(seen > 0.0, seen, np.inf))
    for link in links:
        own, traces = spread[link.places], np.trace(link.basis[:, :3, :3], axis1=1, axis2=2)
        moments, first = own[traces > 0.0], own[np.any(link.basis[:, :3, 3] != 0.0, axis=1)]
        P = link.at(x)
        size = max(LIFTED * float(np.trace(P[:3, :3])) / 3.0, float(np.max(moments, initial=0.0))) or 1.0
        mass = max(LIFTED * float(P[3, 3]), float(np.max(first, initial=0.0)) ** 2 / size) or 1.0
        ball = np.diag([size, size, size, mass])
        found[link.places] += np.linalg.lstsq(link.basis.reshape(-1, 16).T, ball.ravel(), rcond=None)[0]
    least = np.where(spread[kept] > 0.0, LIFTED * spread[kept], 1.0)
    found[kept] = np.maximum(found[kept], least)
    return found


def _unlikeliness(P: FloatArray) -> float:
    """Return the negative logarithm of the determinant in the head of this file; infinite outside."""
    try:
        root = np.diag(np.linalg.cholesky(P))
    except np.linalg.LinAlgError:
        return float(np.inf)
    moments = np.trace(P[:3, :3]) - P[:3, 3] @ P[:3, 3] / P[3, 3]
    return float(3.0 * np.log(moments / 3.0) + np.log(P[3, 3]) - 2.0 * np.sum(np.log(root)))


def _expansion(
    links: Sequence[_Link], kept: FloatArray, x: FloatArray, seen: FloatArray, aim: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return slope and curvature at x, shapes (parameters,) and square; what bends down counts as it may."""
    slope = seen @ x - aim
    slope[kept] -= HELD / x[kept]
    up, down = seen.copy(), np.zeros_like(seen)
    up[kept, kept] += HELD / x[kept] ** 2
    for link in links:
        own, convex, concave = _slopes(link.at(x), link.basis)
        square = np.ix_(link.places, link.places)
        slope[link.places] += CENTRED * own
        up[square] += CENTRED * convex
        down[square] += CENTRED * concave
    for share in CONCAVE_SHARES:
        curvature = up + share * down
        size = np.sqrt(np.abs(np.diag(curvature)))
        if np.all(size > 0.0) and np.linalg.eigvalsh(curvature / np.outer(size, size))[0] > 0.0:
            break
    return slope, curvature


def _slopes(P: FloatArray, basis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return slope of `_unlikeliness` and the curvatures of its convex and of its concave terms.

    P in SI, (4, 4), and its basis, (k, 4, 4); shapes (k,), (k, k), (k, k).
    """
    along = np.linalg.solve(P, basis)
    mass, centre = P[3, 3], P[:3, 3] / P[3, 3]
    masses = basis[:, 3, 3]
    moments = np.trace(P[:3, :3]) - mass * (centre @ centre)
    apart = basis[:, :3, 3] - np.outer(masses, centre)
    rise = np.trace(basis[:, :3, :3], axis1=1, axis2=2) - 2.0 * basis[:, :3, 3] @ centre
    rise = rise + (centre @ centre) * masses
    slope = 3.0 * rise / moments + masses / mass - np.trace(along, axis1=1, axis2=2)
    convex = np.einsum("iab,jba->ij", along, along)
    bent = -2.0 / mass * apart @ apart.T
    concave = 3.0 * (bent / moments - np.outer(rise, rise) / moments**2) - np.outer(masses, masses) / mass**2
    return slope, convex, concave
