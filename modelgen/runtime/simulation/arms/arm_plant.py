"""ArmPlant: a model of an arm with values of its base parameters, ready to be moved.

Everything comes from the rows of the generated module: balance(q, q', q'') = A tau, whose left side is linear
in the accelerations. Coulomb friction is what jumps where a speed changes its sign; all else is smooth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.magnitudes import REMEDY, is_usable, shown_number
from modelgen.runtime.model.model import Model
from modelgen.runtime.simulation.arms.thresholds import (
    BLOCK,
    LEAST_FRICTION,
    LEAST_SHARE,
    PROBED_SPEED,
    PROBES,
    STILL,
)


@dataclass(frozen=True, eq=False)
class Rubbing:
    """Coulomb friction: forces between middle - half and middle + half, by the sign of a speed each.

    Attributes
    ----------
    names : tuple of str
        Joints, or motors of several joints, whose speeds these are.
    levers : ndarray, shape (C, joints)
        Every speed as a sum of those of the joints.
    middle : ndarray, shape (joints,)
        What does not depend on a sign: the mean of forward and backward.
    half : ndarray, shape (joints, C)
    """

    names: tuple[str, ...]
    levers: FloatArray
    middle: FloatArray
    half: FloatArray


@dataclass(frozen=True, eq=False)
class ArmPlant:
    """An arm in motion: balance(q, q', q'') = A tau, in the rows of the module; SI throughout.

    Attributes
    ----------
    model : Model
    base : ndarray, shape (columns,)
        Values of the base parameters.
    joints, forces : tuple of str
        Names of the joints that move, and keys of the forces that move them.
    least_inertia : ndarray, shape (joints,), optional
        The mass matrix is raised to this where it has less: an estimate may be bent by noise.
    """

    model: Model
    base: FloatArray
    joints: tuple[str, ...]
    forces: tuple[str, ...]
    least_inertia: FloatArray | None = None

    @cached_property
    def _values(self) -> FloatArray:
        """Every entry's base parameter in the row that it stands in, shape (rows, entries)."""
        places = self.model.module.ENTRIES
        found = np.zeros((len(self.model.rows), len(places)))
        for line, (row, column) in enumerate(places):
            found[row, line] = self.base[column]
        return found

    def rows(self, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray | None = None) -> FloatArray:
        """Return regressor times base parameters less the left side, shape (rows, N).

        Positions, speeds, accelerations and forces have the shape (joints, N); without forces they are zero.
        """
        module, count = self.model.module, q.shape[1]
        found = np.empty((len(self.model.rows), count))
        for start in range(0, count, BLOCK):
            part = slice(start, min(start + BLOCK, count))
            still = np.zeros(part.stop - start)
            signals = dict.fromkeys(module.SIGNALS, still)
            for k, name in enumerate(self.joints):
                signals |= {f"q_{name}": q[k, part], f"d1_q_{name}": v[k, part], f"d2_q_{name}": a[k, part]}
            if tau is not None:
                signals |= {key: tau[k, part] for k, key in enumerate(self.forces)}
            left = np.asarray(module.measurement(signals)).T
            found[:, part] = self._values @ np.asarray(module.entries(signals)) - left
        return found

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Places of the rows that are balances of joints (or motors), in the order of the joints."""
        names = [row.name for row in self.model.rows]
        return tuple(names.index(name) for name in self.joints)

    @cached_property
    def gears(self) -> FloatArray:
        """A, shape (joints, forces): what forces do in the rows."""
        n, still = len(self.joints), np.zeros((len(self.joints), len(self.forces) + 1))
        unit = np.hstack((np.zeros((len(self.forces), 1)), np.eye(len(self.forces))))
        found = -self.rows(still, still, still, unit)[list(self.moving)]
        assert len(self.forces) == n
        return np.asarray(found[:, 1:] - found[:, :1])

    def smooth(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the balance without what jumps with the sign of a speed, shape (joints, N)."""
        levers, (forward, backward) = self._levers[1], self._sides
        speeds = levers @ v
        # what rounding leaves of a speed that sticks may have one sign here and another in the module
        still = (np.abs(speeds) < STILL).any(axis=0)
        if still.any():
            aside = 2.0 * STILL * np.linalg.lstsq(levers, np.ones(len(levers)), rcond=None)[0]
            v = v + np.where(still, aside[:, None], 0.0)
            speeds = levers @ v
        jumps = forward @ (speeds > 0.0) + backward @ (speeds < 0.0)
        return self.rows(q, v, a)[list(self.moving)] - jumps + self.rubbing.middle[:, None]

    @cached_property
    def _levers(self) -> tuple[tuple[str, ...], FloatArray]:
        """Names of the coordinates that have a speed of their own, and their levers, shape (C, joints)."""
        place = {f"q_{name}": k for k, name in enumerate(self.joints)}
        names, levers = [*self.joints], [*np.eye(len(self.joints))]
        for key, terms in self.model.derived.items():
            lever = np.zeros(len(self.joints))
            for weight, of in terms:
                lever[place[of]] = weight
            names.append(key.removeprefix("q_"))
            levers.append(lever)
        return tuple(names), np.array(levers)

    @cached_property
    def _sides(self) -> tuple[FloatArray, FloatArray]:
        """What each speed adds while it is forward, and while it is backward, shape (joints, C) each.

        Found from the rows at speeds next to nothing; of solutions that are alike the smallest.
        """
        n, levers = len(self.joints), self._levers[1]
        signs = np.random.default_rng(0).integers(-1, 2, (n, PROBES * len(levers))).astype(float)
        signs = np.hstack((np.eye(n), -np.eye(n), signs))
        still, rest = np.zeros_like(signs), list(self.moving)
        at_rest = self.rows(still[:, :1], still[:, :1], still[:, :1])[rest]
        once, twice = (
            self.rows(still, share * PROBED_SPEED * signs, still)[rest] - at_rest for share in (1.0, 2.0)
        )
        directions = np.sign(levers @ signs)
        chosen = np.vstack((directions > 0.0, directions < 0.0)).astype(float)
        # what grows with the speed is the same in both, but for its size
        found = np.linalg.lstsq(chosen.T, (2.0 * once - twice).T, rcond=None)[0].T
        found[np.abs(found) < LEAST_FRICTION * np.max(np.abs(at_rest), initial=np.abs(found).max())] = 0.0
        return found[:, : len(levers)], found[:, len(levers) :]

    def driving_forces(self, q: FloatArray, v: FloatArray, a: FloatArray) -> dict[str, FloatArray]:
        """Return what the drives report (and the base feels) along a motion, shape (N,) each, by key."""
        found = self.rows(q, v, a)
        tau = np.asarray(np.linalg.solve(self.gears, found[list(self.moving)]), dtype=float)
        return dict(zip(self.forces, tau, strict=True)) | self.base_forces(q, v, a, tau)

    def base_forces(
        self, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray
    ) -> dict[str, FloatArray]:
        """Return what the base feels, where the module has rows of it, shape (N,) each, by key."""
        further = [one.key for one in self.model.actuators if one.key not in self.forces]
        if not further:
            return {}
        names = [row.name for row in self.model.rows]
        rows = self.rows(q, v, a, tau)
        return {key: rows[names.index(key)] for key in further}

    @cached_property
    def rubbing(self) -> Rubbing:
        """Coulomb friction, of the speeds that have any."""
        (names, levers), (forward, backward) = self._levers, self._sides
        half, middle = 0.5 * (forward - backward), 0.5 * (forward + backward).sum(axis=1)
        n = len(self.joints)
        still = np.zeros((n, 1))
        pushes = np.linalg.solve(self.mass(still, still)[0], half)
        # friction that would push is none: an estimate may have one
        kept = [c for c in range(len(names)) if levers[c] @ pushes[:, c] > 0.0]
        return Rubbing(tuple(names[c] for c in kept), levers[kept], middle, half[:, kept])

    def mass(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return the derivative of the balance by the accelerations, shape (N, joints, joints)."""
        n, count = q.shape
        units = np.hstack((np.zeros((n, 1)), np.eye(n)))
        at, fast = (np.tile(one, n + 1) for one in (q, v))
        found = self.rows(at, fast, np.repeat(units, count, axis=1))[list(self.moving)]
        found = found.reshape(n, n + 1, count)
        mass = np.transpose(found[:, 1:] - found[:, :1], (2, 0, 1))
        return mass if self.least_inertia is None else _raised(mass, self.least_inertia)

    def slopes(self, q: FloatArray, v: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of the smooth balance by q and by q', shape (N, joints, joints) each."""
        n, count = q.shape
        here = self.smooth(q, v, a)
        found = []
        for moved in (0, 1):
            step = 1e-6 * max(1.0, float(np.abs((q, v)[moved]).max()))
            motion = [np.tile(one, n) for one in (q, v, a)]
            motion[moved] = motion[moved] + step * np.repeat(np.eye(n), count, axis=1)
            beside = self.smooth(motion[0], motion[1], motion[2]).reshape(n, n, count)
            found.append(np.transpose((beside - here[:, None]) / step, (2, 0, 1)))
        return found[0], found[1]


def _raised(mass: FloatArray, least: FloatArray) -> FloatArray:
    """Return mass matrices none of whose principal values is below a share of the least inertias."""
    root = np.sqrt(least)
    scaled = mass / root[:, None] / root
    values, vectors = np.linalg.eigh(0.5 * (scaled + np.transpose(scaled, (0, 2, 1))))
    low = values < 1.0
    if not low.any():
        return mass
    lift = np.where(low, 1.0 - values, 0.0)
    return np.asarray(
        mass + (vectors * lift[:, None, :]) @ np.transpose(vectors, (0, 2, 1)) * root[:, None] * root
    )


def arm_plant(model: Model, base: FloatArray, tame: bool = False) -> ArmPlant:
    """Return the plant of an arm's model with these base parameters, shape (columns,), SI.

    With `tame` its mass matrix is kept positive definite, whatever the parameters: to follow a record with.

    Raises
    ------
    DataError
        When rows and forces of the module are not those of its joints.
    """
    joints, forces = _joints(model), _forces(model)
    if not follows(model):
        what = "has not a position, a force and a row a joint: an arm with springs, say"
        raise DataError.at(model.chain, what, "give the module of an arm with rigid joints")
    plant = ArmPlant(model, np.asarray(base, dtype=float), joints, forces)
    if not tame:
        return plant
    n = len(joints)
    postures = np.random.default_rng(0).uniform(-np.pi, np.pi, (n, PROBES * n))
    own = np.abs(np.diagonal(plant.mass(postures, np.zeros_like(postures)), axis1=1, axis2=2)).mean(axis=0)
    return ArmPlant(model, plant.base, joints, forces, LEAST_SHARE * np.maximum(own, LEAST_SHARE * own.max()))


def _joints(model: Model) -> tuple[str, ...]:
    return tuple(str(one.body) for one in model.sensors if one.key not in model.derived)


def _forces(model: Model) -> tuple[str, ...]:
    return tuple(one.key for one in model.actuators if one.key.startswith("tau_"))


def follows(model: Model) -> bool:
    """Tell whether an arm's motion follows from its rows: a position, a force and a row a joint."""
    joints = _joints(model)
    read = {f"{order}_{name}" for order in ("q", "d1_q", "d2_q") for name in joints}
    read |= {one.key for one in model.actuators}
    rows = {row.name for row in model.rows}
    return len(_forces(model)) == len(joints) and rows >= {*joints} and read >= {*model.module.SIGNALS}


def checked_base(model: Model, parameters: Mapping[str, float]) -> FloatArray:
    """Return base parameters from physical ones (SI); known ones may be left out.

    Raises
    ------
    DataError
        With one problem per parameter that is missing, no number, or impossible.
    """
    problems = [
        problem for name in model.parameters if (problem := _problem(model, name, parameters.get(name)))
    ]
    if problems:
        raise DataError(*problems)
    return model.base_from_physical({name: float(parameters[name]) for name in model.parameters})


def _problem(model: Model, name: str, value: float | None) -> Problem | None:
    where, unit = f"parameters: {name}", model.units.get(name, "SI")
    if value is None:
        return Problem(where, "is missing", f"give its value in {unit}")
    if not is_usable(value):
        return Problem(where, f"is {shown_number(value)}", f"give a finite number in {unit}; {REMEDY}")
    role = model.roles[name].role
    if role == "inertia" and value < 0.0:
        return Problem(where, f"is {float(value)!r} {unit}", "an inertia must not be negative")
    if role == "coulomb" and value < 0.0:
        return Problem(where, f"is {float(value)!r} {unit}", "a friction force must be zero or positive")
    return None
