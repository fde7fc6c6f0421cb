"""Coulomb friction of an arm, found from its rows: what jumps where a speed changes its sign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model
from modelgen.runtime.simulation.arms.arm_coordinates import ArmCoordinates
from modelgen.runtime.simulation.arms.thresholds import LEAST_FRICTION, PROBED_SPEED, PROBES

#: Balances at positions, speeds and accelerations, shape (coordinates, N) all.
Balance = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Rubbing:
    """Coulomb friction: forces between middle - half and middle + half, by the sign of a speed each.

    Attributes
    ----------
    names : tuple of str
        Joints, or motors of several joints, whose speeds these are.
    levers : ndarray, shape (C, coordinates)
        Every speed as a sum of those of the coordinates.
    middle : ndarray, shape (coordinates,)
        What does not depend on a sign: the mean of forward and backward.
    half : ndarray, shape (coordinates, C)
    """

    names: tuple[str, ...]
    levers: FloatArray
    middle: FloatArray
    half: FloatArray


@dataclass(frozen=True, eq=False)
class Sides:
    """What each speed adds to the balances while it is forward, and while it is backward.

    `levers` is that of every speed, shape (C, coordinates), the others have the shape (coordinates, C).
    """

    names: tuple[str, ...]
    levers: FloatArray
    forward: FloatArray
    backward: FloatArray

    def rubbing(self, mass: FloatArray) -> Rubbing:
        """Return the friction of the speeds that have any.

        `mass` is the matrix at rest, shape (coordinates, coordinates), in SI.
        """
        half, middle = 0.5 * (self.forward - self.backward), 0.5 * (self.forward + self.backward).sum(axis=1)
        pushes = np.linalg.solve(mass, half)
        # friction that would push is none: an estimate may have one
        kept = [c for c in range(len(self.names)) if self.levers[c] @ pushes[:, c] > 0.0]
        return Rubbing(tuple(self.names[c] for c in kept), self.levers[kept], middle, half[:, kept])


def sides_of_friction(model: Model, coordinates: ArmCoordinates, balance: Balance) -> Sides:
    """Return what jumps with the speeds, from balances at speeds next to nothing.

    Of solutions that are alike it is the smallest.
    """
    names, levers = _speeds(model, coordinates)
    n = len(coordinates.names)
    signs = np.random.default_rng(0).integers(-1, 2, (n, PROBES * len(levers))).astype(float)
    signs = np.hstack((np.eye(n), -np.eye(n), signs))
    still = np.zeros_like(signs)
    at_rest = balance(still[:, :1], still[:, :1], still[:, :1])
    once, twice = (balance(still, share * PROBED_SPEED * signs, still) - at_rest for share in (1.0, 2.0))
    directions = np.sign(levers @ signs)
    chosen = np.vstack((directions > 0.0, directions < 0.0)).astype(float)
    # what grows with the speed is the same in both, but for its size
    found = np.linalg.lstsq(chosen.T, (2.0 * once - twice).T, rcond=None)[0].T
    found[np.abs(found) < LEAST_FRICTION * np.max(np.abs(at_rest), initial=np.abs(found).max())] = 0.0
    return Sides(names, levers, found[:, : len(levers)], found[:, len(levers) :])


def _speeds(model: Model, coordinates: ArmCoordinates) -> tuple[tuple[str, ...], FloatArray]:
    """Return names of the drives whose speeds may rub, and these as sums of those of the coordinates."""
    reads = dict(zip(coordinates.channels, coordinates.reads, strict=True))
    names, levers = [], []
    if hasattr(model.module, "SPEEDS"):
        for name, terms in model.module.SPEEDS.items():
            names.append(name)
            levers.append(np.sum([weight * reads[key] for weight, key, _ in terms], axis=0))
        return tuple(names), np.array(levers)
    names, levers = [*coordinates.joints], [*np.eye(len(coordinates.joints))]
    for key, terms in model.derived.items():
        names.append(key.removeprefix("q_"))
        levers.append(np.sum([weight * reads[of] for weight, of in terms], axis=0))
    return tuple(names), np.array(levers)
