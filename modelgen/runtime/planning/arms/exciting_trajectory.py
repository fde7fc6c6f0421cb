"""A trajectory of an arm that distinguishes its base parameters, within limits that hold at every instant.

Finite Fourier series of every joint (Swevers et al. 1997) that begin and end at rest. Every trial is scaled
until a limit of its joint is reached, and stands where its range leaves room; boxes are kept, or the trial
does not count. The cost is what the regressor says, without random numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log
from typing import Any, TypedDict, Unpack

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError, ModelgenError, Problem
from modelgen.keyword_options import with_defaults
from modelgen.progress import counted
from modelgen.runtime.planning.arms.workspace import (
    Box,
    PlannedJoint,
    check_boxes,
    clearance,
    clearances,
    limits_of,
    origins,
    worst_text,
)
from modelgen.runtime.planning.random_search import best_of_trials
from modelgen.runtime.planning.thresholds import BLIND, FAILED, POSTURES, SAFETY, SHARE_OF_LIMITS, SHRINKS
from modelgen.runtime.simulation.arms.fourier_trajectory import Bounds, FourierTrajectory, at_rest

CRITERIA = ("condition", "d-optimal")
#: Samples of a period for every harmonic, at which the regressor is judged.
JUDGED = 40


class TrajectoryOptions(TypedDict, total=False):
    """What `exciting_trajectory` searches for, and how long; it describes them."""

    criterion: str
    boxes: Sequence[Box]
    period_s: float
    harmonics: int
    seeds: int
    rounds: int


DEFAULTS = TrajectoryOptions(criterion="condition", boxes=(), period_s=10.0, harmonics=5, seeds=8, rounds=150)


@dataclass(frozen=True)
class ExcitingTrajectory:
    """The best trajectory, what it is worth and what is proven of it.

    Attributes
    ----------
    joints
        Names of the joints that move, in the order of the trajectory.
    trajectory, bounds
        The motion, and what it never exceeds.
    boxes
        (box, how far within its limits [m]).
    condition, information
        Condition number of the base regressor, and the geometric mean of its singular values a sample.
    costs
        Logarithms of the criterion, (at the start, at the end) of every seed; None where a box was left.
    """

    joints: tuple[str, ...]
    trajectory: FourierTrajectory
    bounds: Bounds
    boxes: tuple[tuple[Box, float], ...]
    condition: float
    information: float
    costs: tuple[tuple[float | None, float | None], ...]


def exciting_trajectory(
    module: Any, joints: Sequence[PlannedJoint], **options: Unpack[TrajectoryOptions]
) -> ExcitingTrajectory:
    """Search for the trajectory of an arm that determines its base parameters best.

    Parameters
    ----------
    module
        The arm's module: `SIGNALS` and `regressor`.
    joints : sequence of PlannedJoint
        With the limits that are kept.
    criterion : str
        "condition", the default: condition number of the base regressor (SI); "d-optimal": geometric mean
        of its singular values, which does not depend on units.
    boxes : sequence of Box
        What frames stay in or keep out of.
    period_s : float
        Duration in s of the trajectory, by default 10.
    harmonics : int
        Of the series, by default 5: the highest frequency is harmonics / period_s.
    seeds, rounds : int
        Searches from different beginnings, by default 8, and trials of each, by default 150.

    Raises
    ------
    DataError
        If a joint has no limits, an option cannot be used, or no trajectory keeps the boxes.
    """
    search = with_defaults("exciting_trajectory", options, TrajectoryOptions, DEFAULTS)
    _check(search)
    check_boxes(search["boxes"], joints)
    trial = _Trial(module, joints, search)
    refuge = trial.refuge()
    found = []
    for seed in counted(range(search["seeds"]), "seeds"):
        start = trial.start(seed, refuge)
        begun = trial(start)
        found.append((*best_of_trials(trial, [start], search["rounds"], seed), begun))
    value, best, _ = min(found, key=lambda one: one[0])
    if value >= BLIND:
        raise trial.failure(value, best)
    motion, bounds, kept = trial.trajectory(best)
    singular = trial.singular_values(motion)
    return ExcitingTrajectory(
        tuple(trial.moving),
        motion,
        bounds,
        tuple(zip(search["boxes"], kept, strict=True)),
        float(singular[0] / singular[-1]),
        float(np.exp(np.log(singular).mean()) / np.sqrt(JUDGED * motion.harmonics)),
        tuple((_counted(begun), _counted(ended)) for ended, _, begun in found),
    )


class _Trial:
    """From search variables to a trajectory within the joints' limits, and its cost."""

    def __init__(self, module: Any, joints: Sequence[PlannedJoint], search: TrajectoryOptions) -> None:
        self.moving = limits_of(joints)
        self._joints, self._search = joints, search
        ranges: FloatArray = np.array([joint.position for joint in self.moving.values()], dtype=float)
        self._lower, self._range = ranges[:, 0], ranges[:, 1] - ranges[:, 0]
        limits = [(joint.speed, joint.acceleration) for joint in self.moving.values()]
        self._fastest: FloatArray = np.array([[np.inf if x is None else x for x in pair] for pair in limits])
        self._module = module
        rng = np.random.default_rng(0)
        random = {name: rng.standard_normal((3, 40)) for name in self.moving}
        # what only measured forces move, such as a gain, is not judged
        self._judged = np.any(self._regressor(random) != 0.0, axis=(0, 1))

    def _regressor(self, motion: Mapping[str, FloatArray]) -> FloatArray:
        signals = {
            f"{order}_{name}": values[k]
            for name, values in motion.items()
            for k, order in enumerate(("q", "d1_q", "d2_q"))
        }
        samples = next(iter(motion.values())).shape[1]
        found: FloatArray = self._module.regressor(
            {key: signals.get(key, np.zeros(samples)) for key in self._module.SIGNALS}
        )
        return found

    def trajectory(self, v: FloatArray) -> tuple[FourierTrajectory, Bounds, list[float]]:
        """Return the trajectory of search variables, its bounds, and how far its boxes are kept [m]."""
        search, count = self._search, len(self.moving)
        n = search["harmonics"]
        shape = v.reshape(count, 2 * n + 2)
        sines, cosines = at_rest(shape[:, :n], shape[:, n : 2 * n])
        unit = FourierTrajectory(search["period_s"], np.zeros(count), sines, cosines)
        free = unit.bounds()
        span = np.maximum(free.upper - free.lower, 1e-9)
        scale = np.minimum(
            self._range / span,
            np.minimum(
                self._fastest[:, 0] / np.maximum(free.speed, 1e-9),
                self._fastest[:, 1] / np.maximum(free.acceleration, 1e-9),
            ),
        )
        scale = scale * SAFETY * _share(shape[:, -2])
        room = self._range - scale * span
        offsets = self._lower - scale * free.lower + _share(shape[:, -1]) * room
        motion = FourierTrajectory(
            search["period_s"], offsets, sines * scale[:, None], cosines * scale[:, None]
        )
        bounds = motion.bounds()
        return motion, bounds, clearances(search["boxes"], self._joints, motion, bounds)

    def singular_values(self, motion: FourierTrajectory) -> FloatArray:
        """Return the singular values of the base regressor along a trajectory, largest first."""
        values = np.stack(motion.at(motion.grid(JUDGED)), axis=1)
        regressor = self._regressor(dict(zip(self.moving, values, strict=True)))[:, :, self._judged]
        found = np.linalg.svd(regressor.reshape(-1, regressor.shape[2]), compute_uv=False)
        return np.asarray(found, dtype=float)

    def __call__(self, v: FloatArray) -> float:
        """Return the criterion's logarithm; large where a box is left."""
        motion, _, kept = self.trajectory(v)
        if min(kept, default=1.0) < 0.0:
            return FAILED
        singular = self.singular_values(motion)
        if singular[-1] <= 1e-12 * singular[0]:
            return BLIND
        if self._search["criterion"] == "condition":
            return log(singular[0] / singular[-1])
        return -float(np.log(singular).mean())

    def failure(self, value: float, best: FloatArray) -> ModelgenError:
        """Return the error where the best of all trials does not count."""
        if value >= FAILED:
            _, _, kept = self.trajectory(best)
            what = f"are kept by no trajectory: the best leaves {worst_text(self._search['boxes'], kept)}"
            return DataError.at("boxes", what, "widen them, or give the trajectory more time")
        what = "distinguishes the base parameters: limits or boxes leave it almost no motion"
        return IdentifiabilityError.at("no trajectory", what, "widen them, or shorten the trajectory")

    def start(self, seed: int, refuge: FloatArray | None) -> FloatArray:
        """Return the variables of a first trial, brought to a posture that keeps the boxes until it does."""
        n, count = self._search["harmonics"], len(self.moving)
        rng = np.random.default_rng(1000 + seed)
        shape = np.zeros((count, 2 * n + 2))
        shape[:, : 2 * n] = rng.standard_normal((count, 2 * n)) / np.tile(np.arange(1.0, n + 1.0), 2)
        shape[:, -2], shape[:, -1] = SHARE_OF_LIMITS, rng.standard_normal(count)
        if refuge is None:
            return shape.ravel()
        for _ in range(SHRINKS):
            if min(self.trajectory(shape.ravel())[2]) > 0.0:
                break
            share = np.clip((refuge - self._lower) / self._range, 0.01, 0.99)
            shape[:, -1] = np.log(share / (1.0 - share))
            shape[:, -2] -= 0.5
        return shape.ravel()

    def refuge(self) -> FloatArray | None:
        """Return the posture that keeps all boxes best, shape (joints,), or None without boxes.

        Raises
        ------
        DataError
            If no posture within the joints' limits keeps them.
        """
        boxes = self._search["boxes"]
        if not boxes:
            return None
        shares = np.random.default_rng(1).random((POSTURES, len(self.moving)))
        postures: FloatArray = self._lower + shares * self._range
        places = origins(self._joints, postures.T, [box.frame for box in boxes])
        kept = np.array([[clearance(box, place[None]) for place in places[box.frame]] for box in boxes])
        best = int(kept.min(axis=0).argmax())
        if kept[:, best].min() <= 0.0:
            what = (
                f"are kept by none of {POSTURES:,} postures within the limits of the joints; the best one "
                f"leaves {worst_text(boxes, kept[:, best].tolist())}"
            )
            raise DataError.at("boxes", what, "widen the boxes or the limits of the joints")
        chosen: FloatArray = postures[best]
        return chosen


def _counted(cost: float) -> float | None:
    return cost if cost < BLIND else None


def _share(x: FloatArray) -> FloatArray:
    """Return a share from 0 to 1 of any number."""
    found: FloatArray = 0.5 * (1.0 + np.tanh(0.5 * x))
    return found


def _check(search: TrajectoryOptions) -> None:
    problems = []
    if search["criterion"] not in CRITERIA:
        what = f"is {search['criterion']!r}"
        problems.append(Problem("criterion", what, f"choose one of {', '.join(CRITERIA)} for an arm"))
    if not 0.0 < search["period_s"] < np.inf:
        problems.append(Problem("duration", f"is {search['period_s']!r} s", "give a finite positive number"))
    if not 2 <= search["harmonics"] <= 50:
        what = f"are {search['harmonics']}"
        problems.append(
            Problem("harmonics", what, "give 2 to 50: with one no motion begins and ends at rest")
        )
    for name in ("seeds", "rounds"):
        if search[name] < 1:
            problems.append(Problem(name, f"are {search[name]}", "give at least one"))
    DataError.raise_any(problems)
