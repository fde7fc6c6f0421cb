"""Boxes that frames of an arm stay in, or keep out of, all along a trajectory.

Between two samples a coordinate of a point leaves the chord by at most a h^2 / 8, where a bounds its
acceleration and h is the time between them: with that margin the chords prove the box.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem, listed
from modelgen.runtime.simulation.arms.fourier_trajectory import Bounds, FourierTrajectory


@dataclass(frozen=True)
class PlannedJoint:
    """A joint as trajectories need it.

    Attributes
    ----------
    name, parent, kind
        As the arm's file has them; parents come first.
    placement
        Frame of the joint in that of its parent's link at q = 0, shape (4, 4).
    position, speed, acceleration
        Limits in rad or m, per s, s^2; None where there is none.
    """

    name: str
    parent: str | None
    kind: str
    placement: FloatArray
    position: tuple[float, float] | None = None
    speed: float | None = None
    acceleration: float | None = None


@dataclass(frozen=True)
class Box:
    """A box along the axes of the base (m) that a frame's origin stays in, or keeps out of.

    Sides that are infinite are open.
    """

    frame: str
    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    inside: bool = True

    @property
    def text(self) -> str:
        """The box in words."""
        sides = zip("xyz", self.lower, self.upper, strict=True)
        spans = ", ".join(f"{axis} {a:g} to {b:g}" for axis, a, b in sides if np.isfinite([a, b]).any())
        return f"frame {self.frame} {'in' if self.inside else 'out of'} {spans} m"


def check_boxes(boxes: Sequence[Box], joints: Sequence[PlannedJoint]) -> None:
    """Refuse boxes of frames that the arm does not have, or without room.

    Raises
    ------
    DataError
        With every mistake.
    """
    names = [joint.name for joint in joints]
    problems = []
    for box in boxes:
        if box.frame not in names:
            problems.append(
                Problem(f"box of {box.frame}", "is no joint's frame", f"choose from {listed(names)}")
            )
        if not all(a < b for a, b in zip(box.lower, box.upper, strict=True)):
            problems.append(Problem(f"box of {box.frame}", "has no room", "write the lower end first"))
    DataError.raise_any(problems)


def origins(joints: Sequence[PlannedJoint], q: FloatArray, wanted: Sequence[str]) -> dict[str, FloatArray]:
    """Return where frames are [m], (N, 3) in the base's, along coordinates [rad or m], (moving joints, N)."""
    moving = iter(q)
    rotations: dict[str | None, FloatArray] = {None: np.broadcast_to(np.eye(3), (q.shape[1], 3, 3))}
    places: dict[str | None, FloatArray] = {None: np.zeros((q.shape[1], 3))}
    for joint in joints:
        turned, at = (
            rotations[joint.parent],
            places[joint.parent] + rotations[joint.parent] @ joint.placement[:3, 3],
        )
        turned = turned @ joint.placement[:3, :3]
        if joint.kind == "revolute":
            angle = next(moving)
            x, y = turned[:, :, 0], turned[:, :, 1]
            cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
            turned = np.stack([cosine * x + sine * y, cosine * y - sine * x, turned[:, :, 2]], axis=2)
        elif joint.kind == "prismatic":
            at = at + turned[:, :, 2] * next(moving)[:, None]
        rotations[joint.name], places[joint.name] = turned, at
    return {name: places[name] for name in wanted}


def acceleration_bounds(joints: Sequence[PlannedJoint], bounds: Bounds) -> dict[str, float]:
    """Return what the acceleration of every frame's origin never exceeds [m/s^2]."""
    reach = np.maximum(np.abs(bounds.lower), np.abs(bounds.upper))
    moving = iter(zip(reach, bounds.speed, bounds.acceleration, strict=True))
    found: dict[str | None, tuple[float, float, float]] = {None: (0.0, 0.0, 0.0)}
    for joint in joints:
        turning, angular, linear = found[joint.parent]
        linear += float(np.linalg.norm(joint.placement[:3, 3])) * (angular + turning**2)
        if joint.kind != "fixed":
            farthest, speed, acceleration = map(float, next(moving))
        if joint.kind == "prismatic":
            linear += farthest * (angular + turning**2) + 2.0 * turning * speed + acceleration
        elif joint.kind == "revolute":
            angular += acceleration + turning * speed
            turning += speed
        found[joint.name] = turning, angular, linear
    return {joint.name: found[joint.name][2] for joint in joints}


def clearances(
    boxes: Sequence[Box], joints: Sequence[PlannedJoint], trajectory: FourierTrajectory, bounds: Bounds
) -> list[float]:
    """Return how far within its limits every box is kept at all times [m]; negative where it may be left."""
    if not boxes:
        return []
    times = trajectory.grid()
    q, _, _ = trajectory.at(np.append(times, trajectory.period_s))
    places = origins(joints, q, [box.frame for box in boxes])
    fastest = acceleration_bounds(joints, bounds)
    return [
        clearance(box, places[box.frame]) - fastest[box.frame] * (times[1] - times[0]) ** 2 / 8.0
        for box in boxes
    ]


def clearance(box: Box, places: FloatArray) -> float:
    """Return how far chords between places, shape (N, 3), stay within a box's limits [m]."""
    lower, upper = np.array(box.lower), np.array(box.upper)
    if box.inside:
        return float(min((places - lower).min(), (upper - places).min()))
    ends = np.stack([places[:-1], places[1:]]) if len(places) > 1 else places[None]
    beyond = np.maximum(lower - ends.max(axis=0), ends.min(axis=0) - upper)
    return float(beyond.max(axis=1).min())


def worst_text(boxes: Sequence[Box], found: Sequence[float]) -> str:
    """Return which box is missed most, and by how much."""
    worst = int(np.argmin(found))
    return f"{boxes[worst].text} by {-found[worst]:.3g} m"


def limits_of(joints: Sequence[PlannedJoint]) -> Mapping[str, PlannedJoint]:
    """Return the joints that move by name.

    Raises
    ------
    DataError
        Naming every joint without a range of positions, or without a largest speed.
    """
    moving = {joint.name: joint for joint in joints if joint.kind != "fixed"}
    problems = []
    for joint in moving.values():
        unit = "deg" if joint.kind == "revolute" else "m"
        if joint.position is None:
            example = "[-170, 170]" if unit == "deg" else "[0, 0.2]"
            what = f"joint {joint.name}: position_limits"
            problems.append(Problem(what, "are missing", f"write position_limits = {example} into its table"))
        if joint.speed is None:
            what = f"joint {joint.name}: speed_limit"
            problems.append(
                Problem(
                    what,
                    "is missing",
                    f'write speed_limit = "{180 if unit == "deg" else 0.5} {unit}/s" into its table',
                )
            )
    DataError.raise_any(problems)
    return moving
