"""The controller of an arm: PD at every joint, or computed torque; its file, and what it pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.documents import toml_document
from modelgen.errors import DataError, Problem
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.read_file import CONTROLLER, read_text
from modelgen.runtime.records.record import missing_name
from modelgen.runtime.simulation.arms.arm_motion import at_half_steps
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.thresholds import BANDWIDTH_HZ, DAMPING_RATIO

LAWS = ("pd", "computed_torque")
KEYS = ("law", "bandwidth_hz", "damping_ratio", "kp", "kv", "rate_gain")
NUMBERS = ("bandwidth_hz", "damping_ratio", "rate_gain")


@dataclass(frozen=True)
class JointController:
    """What the drives exert on the joints while these follow a reference r; continuous, without limits.

    Parameters
    ----------
    law : str
        "pd": kp (r - q) + kv (rate_gain r' - q') at each joint, in N m or N; "computed_torque": the model's
        own torques at the acceleration r'' + kv (r' - q') + kp (r - q).
    bandwidth_hz, damping_ratio : float
        Give the gains that are not given: of the law above, at the joint's mean inertia.
    kp, kv : float or sequence of float, optional
        For all joints or one a joint; of a PD law in N m/rad or N/m, and per s; of computed torque in 1/s^2
        and 1/s.
    rate_gain : float
        Share of the reference's rate that a PD law feeds forward.

    Raises
    ------
    DataError
        With one problem per value out of range.
    """

    law: str = "pd"
    bandwidth_hz: float = BANDWIDTH_HZ
    damping_ratio: float = DAMPING_RATIO
    kp: float | Sequence[float] | None = None
    kv: float | Sequence[float] | None = None
    rate_gain: float = 1.0

    def __post_init__(self) -> None:
        problems = []
        if self.law not in LAWS:
            problems.append(
                Problem("controller: law", f"is {self.law!r}", f"choose one of {', '.join(LAWS)}")
            )
        for name in ("bandwidth_hz", "damping_ratio"):
            value = getattr(self, name)
            if not (is_usable(value) and value > 0.0):
                problems.append(Problem(f"controller: {name}", f"is {value!r}", "give a positive number"))
        gains = [
            ("rate_gain", self.rate_gain),
            *(("kp", x) for x in _listed(self.kp)),
            *(("kv", x) for x in _listed(self.kv)),
        ]
        problems += [
            Problem(f"controller: {name}", f"is {value!r}", f"give a finite number, 0 or more; {REMEDY}")
            for name, value in gains
            if not (is_usable(value) and value >= 0.0)
        ]
        DataError.raise_any(problems)

    def gains(self, plant: ArmPlant, reference: JointMotion) -> tuple[FloatArray, FloatArray]:
        """Return kp and kv of every joint, shape (joints,) each."""
        n, rate = len(plant.joints), 2.0 * pi * self.bandwidth_hz
        inertia = np.ones(n)
        if self.law == "pd":
            some = slice(0, reference.n, max(1, reference.n // 200))
            stiff = plant.coordinates.stiff
            mass = stiff.T @ plant.mass(stiff @ reference.q[:, some], stiff @ reference.v[:, some]) @ stiff
            inertia = np.abs(np.diagonal(mass, axis1=1, axis2=2)).mean(axis=0)
        given = (inertia * rate**2, 2.0 * self.damping_ratio * inertia * rate)
        found = []
        for name, own, default in (("kp", self.kp, given[0]), ("kv", self.kv, given[1])):
            values = np.array(_listed(own), dtype=float)
            if values.size not in (0, 1, n):
                what = f"has {values.size} numbers for {n} joints"
                raise DataError.at(
                    f"controller: {name}", what, f"give one, or {n}: {', '.join(plant.joints)}"
                )
            found.append(np.broadcast_to(values, (n,)) if values.size else default)
        return found[0], found[1]

    def fastest(self, plant: ArmPlant, reference: JointMotion) -> float:
        """Return the fastest rate in 1/s at which the closed loop moves, along the reference."""
        some = slice(0, reference.n, max(1, reference.n // 20))
        stiff = plant.coordinates.stiff
        q, v, a = (stiff @ one[:, some] for one in (reference.q, reference.v, reference.a))
        at_work, n = tracking(plant, self, reference), len(q)
        fed_back = at_work.fed_back(q, v, reference.a[:, some])
        inverse = np.linalg.inv(plant.mass(q, v))
        loop = np.zeros((q.shape[1], 2 * n, 2 * n))
        loop[:, :n, n:] = np.eye(n)
        for place, fed, lost in zip((slice(n), slice(n, None)), fed_back, plant.slopes(q, v, a), strict=True):
            loop[:, n:, place] = inverse @ (fed - lost)
        return float(np.abs(np.linalg.eigvals(loop)).max())


def _listed(value: float | Sequence[float] | None) -> list[float]:
    if value is None:
        return []
    return [*value] if isinstance(value, Sequence) else [value]


@dataclass(frozen=True, eq=False)
class Tracking:
    """A controller at work: what it pushes in the rows of the plant, `Push` of `arm_motion`.

    It sees the positions that drives push: of motors, where springs are behind them. Computed torque takes
    the arm for one without springs. `fine` is the joints' reference at half steps, `added` further forces
    there, shape (joints, N).
    """

    plant: ArmPlant
    computed: bool
    kp: FloatArray
    kv: FloatArray
    rate_gain: float
    fine: JointMotion
    added: FloatArray

    def at(self, q: FloatArray, v: FloatArray, start: int) -> FloatArray:
        """Return the push at half steps from node `start` on, shape (coordinates, N), in N m or N."""
        part = slice(2 * start, 2 * start + q.shape[1])
        seen, rates = self._seen(q, v)
        wanted = self._wanted(seen, rates, part)
        if self.computed:
            stiff = self.plant.coordinates.stiff
            wanted = stiff.T @ self.plant.smooth(stiff @ seen, stiff @ rates, stiff @ wanted)
        return self.plant.pushed(wanted + self.added[:, part])

    def slopes(self, q: FloatArray, v: FloatArray, start: int) -> tuple[FloatArray, FloatArray]:
        """Return its derivatives by q and q', shape (N, coordinates, coordinates) each, in SI."""
        part, nodes = slice(2 * start, 2 * start + q.shape[1]), slice(None, None, 2)
        wanted = self._wanted(*self._seen(q, v), part)
        by_q, by_v = self.fed_back(q[:, nodes], v[:, nodes], wanted[:, nodes])
        return at_half_steps(by_q), at_half_steps(by_v)

    def fed_back(self, q: FloatArray, v: FloatArray, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives at positions and speeds, and accelerations of joints that are asked for.

        All in SI, shape (coordinates, n); the derivatives have shape (n, coordinates, coordinates).
        """
        own = self.plant.coordinates
        driven = np.eye(len(q))[:, list(own.driven)]
        if not self.computed:
            shape = (q.shape[1], len(q), len(q))
            by_q, by_v = (driven * -gain @ driven.T for gain in (self.kp, self.kv))
            return np.broadcast_to(by_q, shape), np.broadcast_to(by_v, shape)
        seen, rates = (own.stiff @ one for one in self._seen(q, v))
        mass = own.stiff.T @ self.plant.mass(seen, rates) @ own.stiff
        found = (
            driven @ (own.stiff.T @ slope @ own.stiff - mass * gain) @ driven.T
            for slope, gain in zip(
                self.plant.slopes(seen, rates, own.stiff @ wanted), (self.kp, self.kv), strict=True
            )
        )
        by_q, by_v = found
        return by_q, by_v

    def _seen(self, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        driven = list(self.plant.coordinates.driven)
        return q[driven], v[driven]

    def _wanted(self, q: FloatArray, v: FloatArray, part: slice) -> FloatArray:
        r, rate, rise = (one[:, part] for one in (self.fine.q, self.fine.v, self.fine.a))
        if self.computed:
            return rise + self.kp[:, None] * (r - q) + self.kv[:, None] * (rate - v)
        return self.kp[:, None] * (r - q) + self.kv[:, None] * (self.rate_gain * rate - v)


def tracking(
    plant: ArmPlant, controller: JointController, reference: JointMotion, added: FloatArray | None = None
) -> Tracking:
    """Return a controller at work on a plant; `added`, shape (joints, N), in N m or N, is added."""
    fine = reference.finer(2)
    further = np.zeros_like(fine.q) if added is None else at_half_steps(added.T).T
    kp, kv = controller.gains(plant, reference)
    return Tracking(plant, controller.law == "computed_torque", kp, kv, controller.rate_gain, fine, further)


def load_joint_controller(path: Path) -> JointController:
    """Read a controller's file: a table [controller] with law, bandwidth_hz or kp and kv, and the like.

    Raises
    ------
    DataError
        When the file cannot be read as TOML, or a key is wrong.
    """
    where = str(path)
    given = toml_document(read_text(path, CONTROLLER), where, ("controller",))
    problems = [missing_name(where, "table", key, ("controller",)) for key in given if key != "controller"]
    law = given.get("controller", {})
    if not isinstance(law, dict):
        raise DataError.at(f"{where}: controller", "is no table", "write [controller] and its keys below it")
    problems += [missing_name(f"{where}: controller", "key", key, KEYS) for key in law if key not in KEYS]
    problems += [problem for key, value in law.items() if (problem := _kind_problem(where, key, value))]
    DataError.raise_any(problems)
    return JointController(**law)


def _kind_problem(where: str, key: str, value: Any) -> Problem | None:
    many = value if isinstance(value, list) and key in ("kp", "kv") else [value]
    numbers = all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in many)
    wrong = key in KEYS and (not isinstance(value, str) if key == "law" else not numbers)
    kind = "a text" if key == "law" else "a number" if key in NUMBERS else "a number, or one a joint"
    return Problem(f"{where}: controller.{key}", f"is {value!r}", f"give {kind}") if wrong else None


def controller_given(given: Mapping[str, Any]) -> JointController:
    """Return the controller among the options of a simulation, or the default one.

    Raises
    ------
    DataError
        When it is one of chains.
    """
    found = given.get("controller")
    if found is not None and not isinstance(found, JointController):
        raise DataError.at("controller", "is that of a chain", "give a JointController, or leave it out")
    return found or JointController()
