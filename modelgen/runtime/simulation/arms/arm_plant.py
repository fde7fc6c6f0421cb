"""ArmPlant: a model of an arm with values of its base parameters, ready to be moved.

Everything comes from the rows of the generated module: balance(q, q', q'') = A tau, whose left side is linear
in the accelerations. Coulomb friction is what jumps where a speed changes its sign; all else is smooth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.model.model import Model
from modelgen.runtime.simulation.arms.arm_coordinates import ArmCoordinates, arm_coordinates
from modelgen.runtime.simulation.arms.coulomb_friction import Rubbing, Sides, sides_of_friction
from modelgen.runtime.simulation.arms.thresholds import BLOCK, LEAST_SHARE, PROBES, STILL
from modelgen.runtime.simulation.plant import checked_values


@dataclass(frozen=True, eq=False)
class ArmPlant:
    """An arm in motion: balance(x, x', x'') = A tau in its coordinates x; SI throughout.

    Attributes
    ----------
    model : Model
    base : ndarray, shape (columns,)
        Values of the base parameters.
    coordinates : ArmCoordinates
        Positions of links, and of motors in front of springs.
    least_inertia : ndarray, shape (coordinates,), optional
        The mass matrix is raised to this where it has less: an estimate may be bent by noise.
    carried : mapping of str to float
        Payloads that it carries all the time, by the key of their channel: 1, or 0.
    """

    model: Model
    base: FloatArray
    coordinates: ArmCoordinates
    least_inertia: FloatArray | None = None
    carried: Mapping[str, float] = field(default_factory=dict)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move."""
        return self.coordinates.joints

    @property
    def forces(self) -> tuple[str, ...]:
        """Keys of the forces that move them."""
        return self.coordinates.forces

    @cached_property
    def _values(self) -> FloatArray:
        """Every entry's base parameter in the row that it stands in, shape (rows, entries)."""
        places = self.model.module.ENTRIES
        found = np.zeros((len(self.model.module.ROWS), len(places)))
        for line, (row, column) in enumerate(places):
            found[row, line] = self.base[column]
        return found

    def rows(self, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray | None = None) -> FloatArray:
        """Return regressor times base parameters less the left side, shape (rows, N).

        Positions, speeds and accelerations have the shape (coordinates, N), forces (joints, N); without
        forces they are zero.
        """
        return self._sums(np.eye(len(self.model.rows)), q, v, a, tau)

    def balance(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the balances of the coordinates without what drives exert, shape (coordinates, N)."""
        return self._sums(self.coordinates.balances, q, v, a)

    def _sums(
        self, weights: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray | None = None
    ) -> FloatArray:
        """Return sums of `rows`, shape (sums, N); weights have the shape (sums, rows)."""
        module, count, own = self.model.module, q.shape[1], self.coordinates
        of_entries = weights @ self._values
        found = np.zeros((len(weights), count))
        for start in range(0, count, BLOCK):
            part = slice(start, min(start + BLOCK, count))
            still = np.zeros(part.stop - start)
            signals = dict.fromkeys(module.SIGNALS, still)
            signals |= {key: np.full_like(still, share) for key, share in self.carried.items()}
            for order, one in zip(("", "d1_", "d2_"), (q, v, a), strict=True):
                read = _combined(own.reads, one[:, part])
                signals |= {f"{order}{key}": line for key, line in zip(own.channels, read, strict=True)}
            for key, rate in own.rates.items():
                signals |= {key: rate @ v[:, part], f"d1_{key}": rate @ a[:, part]}
            if tau is not None:
                signals |= {key: tau[k, part] for k, key in enumerate(self.forces)}
            left = np.asarray(module.measurement(signals)).T
            right = _combined(of_entries, np.asarray(module.entries(signals)))
            found[:, part] = right - _combined(weights, left)
        return found

    @cached_property
    def gears(self) -> FloatArray:
        """A, shape (joints, forces): what forces do to the coordinates that drives push, in their order."""
        still = np.zeros((len(self.coordinates.names), len(self.forces) + 1))
        unit = np.hstack((np.zeros((len(self.forces), 1)), np.eye(len(self.forces))))
        found = -self._sums(self.coordinates.balances, still, still, still, unit)
        return np.asarray(found[:, 1:] - found[:, :1])[list(self.coordinates.driven)]

    def pushed(self, forces: FloatArray) -> FloatArray:
        """Return forces on the driven coordinates, shape (joints, N), among all, (coordinates, N)."""
        found = np.zeros((len(self.coordinates.names), forces.shape[1]))
        found[list(self.coordinates.driven)] = forces
        return found

    def exerted(self, push: FloatArray) -> FloatArray:
        """Return what the drives exert, shape (forces, N), from the push on all coordinates."""
        return np.asarray(np.linalg.solve(self.gears, push[list(self.coordinates.driven)]), dtype=float)

    def smooth(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the balance without what jumps with the sign of a speed, shape (coordinates, N)."""
        sides = self._sides
        speeds = _combined(sides.levers, v)
        # what rounding leaves of a speed that sticks may have one sign here and another in the module
        still = (np.abs(speeds) < STILL).any(axis=0)
        if still.any():
            aside = 2.0 * STILL * np.linalg.lstsq(sides.levers, np.ones(len(sides.levers)), rcond=None)[0]
            v = v + np.where(still, aside[:, None], 0.0)
            speeds = sides.levers @ v
        jumps = _combined(sides.forward, speeds > 0.0) + _combined(sides.backward, speeds < 0.0)
        return self.balance(q, v, a) - jumps + self.rubbing.middle[:, None]

    @cached_property
    def _sides(self) -> Sides:
        return sides_of_friction(self.model, self.coordinates, self.balance)

    @cached_property
    def rubbing(self) -> Rubbing:
        """Coulomb friction, of the speeds that have any."""
        still = np.zeros((len(self.coordinates.names), 1))
        return self._sides.rubbing(self.mass(still, still)[0])

    def spring_torques(self, q: FloatArray, v: FloatArray) -> dict[str, FloatArray]:
        """Return what springs exert on the links behind them, shape (N,) each, by the joint."""
        own, rest = self.coordinates, np.zeros_like(q)
        together = [own.stiff @ one[list(own.driven)] for one in (q, v)]
        found = self.balance(q, v, rest) - self.balance(together[0], together[1], rest)
        return {
            name: found[k] for k, name in zip(own.driven, own.joints, strict=True) if k >= len(own.joints)
        }

    def driving_forces(self, q: FloatArray, v: FloatArray, a: FloatArray) -> dict[str, FloatArray]:
        """Return what drives report (and what acts on the base) along a motion, shape (N,) each, by key."""
        tau = self.exerted(self.balance(q, v, a))
        return dict(zip(self.forces, tau, strict=True)) | self.base_forces(q, v, a, tau)

    def base_forces(
        self, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray
    ) -> dict[str, FloatArray]:
        """Return force and torque on the base, where the module has rows of it, shape (N,) each, by key."""
        further = [one.key for one in self.model.actuators if one.key not in self.forces]
        if not further:
            return {}
        names = [row.name for row in self.model.rows]
        rows = self.rows(q, v, a, tau)
        return {key: rows[names.index(key)] for key in further}

    def mass(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return the derivative of the balance by the accelerations, shape (N, coordinates, coordinates)."""
        n, count = q.shape
        units = np.hstack((np.zeros((n, 1)), np.eye(n)))
        at, fast = (np.tile(one, n + 1) for one in (q, v))
        found = self.balance(at, fast, np.repeat(units, count, axis=1))
        found = found.reshape(n, n + 1, count)
        mass = np.transpose(found[:, 1:] - found[:, :1], (2, 0, 1))
        return mass if self.least_inertia is None else _raised(mass, self.least_inertia)

    def slopes(self, q: FloatArray, v: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of `smooth` by q and by q', shape (N, coordinates, coordinates) each."""
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


def _combined(weights: FloatArray, lines: npt.NDArray[np.float64 | np.bool]) -> FloatArray:
    """Return weights @ lines, few of which are not zero, shape (sums, N)."""
    found = np.zeros((len(weights), lines.shape[1]))
    for place, row in zip(*np.nonzero(weights), strict=True):
        found[place] += weights[place, row] * lines[row]
    return found


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
    coordinates = arm_coordinates(model)
    if coordinates is None:
        what = "has not a row a joint (and spring) and a force a motor, or a position is not measured"
        remedy = "give the module of encoders at every motor and on every link"
        raise DataError.at(model.chain, what, remedy)
    plant = ArmPlant(model, np.asarray(base, dtype=float), coordinates)
    if not tame:
        return plant
    n = len(coordinates.names)
    postures = np.random.default_rng(0).uniform(-np.pi, np.pi, (n, PROBES * n))
    own = np.abs(np.diagonal(plant.mass(postures, np.zeros_like(postures)), axis1=1, axis2=2)).mean(axis=0)
    return ArmPlant(model, plant.base, coordinates, LEAST_SHARE * np.maximum(own, LEAST_SHARE * own.max()))


def checked_base(model: Model, parameters: Mapping[str, float]) -> FloatArray:
    """Return base parameters, shape (columns,), from physical ones (SI); known ones may be left out.

    Raises
    ------
    DataError
        With one problem per parameter that is missing, no number, or impossible.
    """
    return model.base_from_physical(checked_values(model, model.parameters, parameters))
