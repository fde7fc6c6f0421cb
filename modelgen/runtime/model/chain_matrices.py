"""The chain's matrices M, D, K with M q'' + D q' + K q = forces, each linear in the parameters.

A generated module gives A = [0 1; -K/M -D/M]: with all inertias set to one its lower half is linear in all
other parameters, so that each one's share is that of the parameter alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.model import Model

BOTH_WAYS = (1, -1)


@dataclass(frozen=True, eq=False)
class ChainMatrices:
    """Bodies in the order of the state with the parameter of each one's inertia, and what the others add.

    `stiffness` and `damping` map a parameter to its matrix per unit, shape (bodies, bodies). Friction that
    depends on the direction counts with the mean of both: what an oscillation feels.
    """

    bodies: tuple[str, ...]
    inertias: tuple[str, ...]
    stiffness: Mapping[str, FloatArray]
    damping: Mapping[str, FloatArray]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Every parameter that the matrices depend on."""
        return tuple(dict.fromkeys((*self.inertias, *self.stiffness, *self.damping)))

    def at(self, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the inertias, shape (bodies,), D and K, shape (bodies, bodies), in SI units."""
        none = np.zeros((len(self.bodies),) * 2)
        D = sum((values[name] * matrix for name, matrix in self.damping.items()), none)
        K = sum((values[name] * matrix for name, matrix in self.stiffness.items()), none)
        return np.array([values[name] for name in self.inertias]), D, K


@lru_cache(maxsize=8)  # many estimates ask for those of one model
def chain_matrices(model: Model) -> ChainMatrices:
    """Return the matrices of a model's chain, linear about rest: cubes have no part in them."""
    order = body_inertias(model)
    names = model.every_parameter
    heavy = {name: float(name in {inertia for _, inertia in order}) for name in names}
    n = len(order)
    stiffness, damping = {}, {}
    for name in names:
        if heavy[name]:
            continue
        lower = [-_A(model, {**heavy, name: 1.0}, way)[n:] for way in BOTH_WAYS]
        mean = 0.5 * (lower[0] + lower[1])
        if mean[:, :n].any():
            stiffness[name] = mean[:, :n]
        if mean[:, n:].any():
            damping[name] = mean[:, n:]
    return ChainMatrices(
        tuple(body for body, _ in order), tuple(inertia for _, inertia in order), stiffness, damping
    )


@lru_cache(maxsize=8)
def body_inertias(model: Model) -> tuple[tuple[str, str], ...]:
    """Return pairs of body and parameter of its inertia, in the order of the state.

    A body is the row of velocities that answers to its inertia, whatever the values of the other parameters.
    """
    ones = dict.fromkeys(model.every_parameter, 1.0)
    directions = {friction.body: 1 for friction in model.friction}
    light = model.state_space(ones, directions)
    count = len(light.A) // 2
    found = [("", "")] * count
    for name, role in model.roles.items():
        if role.role != "inertia":
            continue
        heavy = model.state_space({**ones, name: 2.0}, directions)
        changed = [(getattr(light, key) != getattr(heavy, key)).any(axis=1) for key in ("A", "B", "E")]
        rows = np.flatnonzero(np.any(changed, axis=0)) - count
        for row, body in zip(rows, role.bodies, strict=True):
            found[row] = body, name
    return tuple(found)


def _A(model: Model, values: Mapping[str, float], way: int) -> FloatArray:
    directions = {friction.body: way for friction in model.friction}
    return np.asarray(model.state_space(values, directions).A, dtype=float)
