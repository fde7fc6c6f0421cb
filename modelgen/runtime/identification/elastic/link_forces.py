"""Forces of links that rows of an elastic arm lack: other lengths, another direction of gravity, loads.

What such links need beyond what the file's need, at the motion of the record, is a column: lengths and
directions are changed a little, and a load is there in one record only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.elastic.row_forces import RowForce, nothing, passed
from modelgen.runtime.identification.thresholds import MOST_ALIGNED_GAIN
from modelgen.runtime.iv.effect import LENGTH, TILT
from modelgen.runtime.model.arm_channels import differentiated, moving_joints
from modelgen.runtime.model.arm_functions import base_factors
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import RecordRows
from modelgen.runtime.simulation.arms.arm_coordinates import reading_of
from modelgen.runtime.simulation.arms.placed_links import OF_LINK, PlacedLinks, placed_links

# Lengths in m, and accelerations in m/s^2, that are small against those of arms and large against rounding.
TRIED_LENGTH, TRIED_GRAVITY = 1e-6, 1e-3
READ = ("position", "velocity")
# Offsets in m below that are none.
NO_LENGTH = 1e-9

#: Parameters of links, (joints, 10), and motion, (3, moving, N), to what joints exert, (moving, N); in SI.
Needed = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class LinkForce(RowForce):
    """What links need at all joints, and rows of links lack, per unit of its size."""

    needed: Needed = lambda links, motion: motion[0]


class LinksInMotion:
    """The links of a record in motion, and how Y - W X grows with what they need besides."""

    def __init__(self, rows: RecordRows, record: Record, index: int, point: FloatArray) -> None:
        """Take all rows of the `index`-th record, and base parameters, shape (columns,), in SI."""
        self.rows, self.record, self.index, self._point = rows, record, index, point
        self.model = rows.plan.model

    def grown(self, effect: LinkForce) -> FloatArray:
        """Return how Y - W X grows per unit of an effect, shape (rows, grid)."""
        joints, names = moving_joints(self.model.module), [row.name for row in self.model.rows]
        found = np.zeros((len(names), len(self.rows.grid)))
        if effect.record not in (None, self.index):
            return found
        forces = effect.needed(self._links, self.motion)
        for joint, force in zip(joints, forces, strict=True):
            row = f"{joint} link"
            if row not in names:
                row, force = joint, self._with_motor(joint, force)
            if row in names:
                found[names.index(row)] = passed(self.rows, self.record, force)
        return found

    @cached_property
    def _links(self) -> FloatArray:
        """Parameters of links in SI, shape (joints, 10).

        They are the smallest that give the base parameters: what others change besides is a sum of columns.
        """
        placed, names, module = _placed(self.model), self.model.parameters, self.model.module
        factors, known = base_factors(self.model.base_from_physical, names)
        values = np.linalg.lstsq(factors, self._point - known, rcond=None)[0]
        return placed.links({**module.KNOWN, **dict(zip(names, values.tolist(), strict=True))})

    @cached_property
    def motion(self) -> FloatArray:
        """Positions, speeds and accelerations of links in SI, shape (3, moving, N)."""
        (chunk,) = replace(self.rows, samples=len(self.rows.grid) * self.rows.plan.filtering.factor).chunks()
        signals = {**self.record.signals, **chunk.plan.kernel_signals(chunk, 0, self.record.n)}
        found: list[FloatArray] = []
        for order in range(3):
            reads = {key: read for key, read in link_readings(self.model, order).items() if key in signals}
            if shows_links(reads):
                turn = np.linalg.pinv(np.array([*reads.values()]))
                joints = turn.shape[0] // 2
                found.append(turn[:joints] @ np.array([signals[key] for key in reads]))
            else:
                found.append(np.gradient(found[-1], 1.0 / self.record.fs, axis=1))
        return np.array(found)

    def _with_motor(self, joint: str, force: FloatArray) -> FloatArray:
        """Return a force of a link, shape (N,), with what the motor needs as it deflects the spring.

        That of a motor which no sensor sees is where the link's forces put it, unless these have a row of
        their own: they are measured then, and so is what deflects the spring.
        """
        given = getattr(self.model.module, "ESTIMATED", {})
        if f"{joint} driven" not in given.values():
            return force
        stiffness, inertia, viscous = (self._of(joint, role) for role in ("stiffness", "inertia", "viscous"))
        rate = np.gradient(force, 1.0 / self.record.fs)
        rising = np.gradient(rate, 1.0 / self.record.fs)
        return force + (inertia * rising + viscous * rate) / stiffness

    def _of(self, joint: str, role: str) -> float:
        """Return the value of a drive's parameter in SI; 0 where it is none of its own."""
        names = [name for name, one in self.model.roles.items() if one.role == role and joint in one.bodies]
        places = [self.model.base_parameters.index(one) for one in names if one in self.model.base_parameters]
        return float(self._point[places[0]]) if places else 0.0


def link_forces(model: Model, records: int) -> Iterator[LinkForce]:
    """Yield what may be off in the links of an elastic arm, where rows of links are told by forces.

    Sensors that feel accelerations read other ones of other lengths and gravity, but the same of a load.
    """
    placed = placed_links(model.module) if model.kernel is not None else None
    if placed is None or not _told_by_forces(model):
        return
    if not any(one["measures"] in ("accelerometer", "acceleration") for one in model.module.SENSORS):
        yield from _lengths(placed)
        yield from _tilts(placed, model)
    yield from _loads(placed, records)


def link_readings(model: Model, order: int = 0) -> dict[str, FloatArray]:
    """Return what sensors, and rows in their place, read per rad or m of them, shape (coordinates,).

    Coordinates are links, and motors behind them, differentiated as often as `order` says: what reads speeds
    is among those of derivatives.
    """
    module, found = model.module, {}
    joints = tuple(moving_joints(module))
    driven = tuple(range(len(joints), 2 * len(joints)))
    for one in module.SENSORS:
        times = order - READ.index(one["measures"]) if one["measures"] in READ else -1
        if times >= 0:
            key = differentiated(one["key"], times)
            read = reading_of(one["joint"], one["side"], module.TRANSMISSION, joints, driven, 2 * len(joints))
            found[key] = read
    return found


def shows_links(reads: Mapping[str, FloatArray]) -> bool:
    """Tell whether every link's position is a sum of what is read, per rad or m, shape (coordinates,)."""
    if not reads:
        return False
    every = np.array([*reads.values()])
    joints = every.shape[1] // 2
    return bool(np.allclose((np.linalg.pinv(every) @ every)[:joints], np.eye(2 * joints)[:joints]))


def _told_by_forces(model: Model) -> bool:
    """Tell whether all joints are springs, links are read or given, and rows hold no shares of others."""
    joints = moving_joints(model.module)
    sprung = {role.bodies[0] for role in model.roles.values() if role.role == "stiffness"}
    # rows of motors that move several joints hold shares of what their links need
    own = model.module.ROW_KIND == "joint" or {f"{one} link" for one in joints} <= {
        row.name for row in model.rows
    }
    return shows_links(link_readings(model)) and own and sprung >= {*joints}


def _placed(model: Model) -> PlacedLinks:
    found = placed_links(model.module)
    assert found is not None  # such effects were found in it
    return found


def _lengths(placed: PlacedLinks) -> Iterator[LinkForce]:
    """Yield that the frame of a joint is elsewhere in that of the joint before it, along what offsets it."""
    for place, (joint, parent) in enumerate(zip(placed.joints, placed.parents, strict=True)):
        if parent < 0:
            continue  # where an arm stands changes nothing
        for axis in np.flatnonzero(np.abs(joint.placement[:3, 3]) > NO_LENGTH).tolist():
            frame = joint.placement.copy()
            frame[axis, 3] += TRIED_LENGTH
            moved = replace(joint, placement=frame)
            changed = replace(placed, joints=(*placed.joints[:place], moved, *placed.joints[place + 1 :]))
            along, before = "xyz"[axis], placed.joints[parent].name
            where = f"joint {joint.name} is off along {along} of the frame of joint {before}"
            remedy = "measure that length, and put it right in the file"
            name = f"offset of joint {joint.name} along {along}"
            most = MOST_ALIGNED_GAIN * abs(float(joint.placement[axis, 3]))
            needed = _difference(placed, changed, TRIED_LENGTH)
            yield _link_force(name, LENGTH, where, remedy, needed, most)


def _tilts(placed: PlacedLinks, model: Model) -> Iterator[LinkForce]:
    """Yield that gravity has a part across the file's, and that links feel it which the file's spares."""
    size = float(np.linalg.norm(placed.gravity))
    if not size:
        return
    across = np.linalg.svd(placed.gravity[None])[2][1:]
    words = "gravity is not along the direction that the file says (the arm is mounted crooked)"
    remedy = "level the base, or put gravity right in the file"
    for number, axis in enumerate(across, start=1):
        changed = replace(placed, gravity=placed.gravity + TRIED_GRAVITY * axis)
        needed = _difference(placed, changed, TRIED_GRAVITY / size)
        yield _link_force(f"gravity across, {number}", TILT, words, remedy, needed, MOST_ALIGNED_GAIN)
        for name, unseen in _unseen(placed, model) if number == 1 else ():
            effect = _link_force(f"gravity across, {name}", "form", words, remedy, _of_links(needed, unseen))
            yield effect


def _unseen(placed: PlacedLinks, model: Model) -> Iterator[tuple[str, FloatArray]]:
    """Yield names of first moments that no row holds, and links that have one of them, shape (joints, 10)."""
    factors = base_factors(model.base_from_physical, model.parameters)[0]
    for name, column in zip(model.parameters, factors.T, strict=True):
        links = placed.links({name: 1.0})
        if not column.any() and links[:, 6:9].any():
            yield name, links


def _loads(placed: PlacedLinks, records: int) -> Iterator[LinkForce]:
    """Yield that the last link carries something in one of several records."""
    last = len(placed.joints) - 1
    for record in range(1, records):
        words = (
            f"link {placed.joints[last].name} carries another load in record {record + 1} than in record 1"
        )
        remedy = "let the file name it ([payload.NAME]), and say which record carries it (Record.carrying)"
        for column, name in enumerate(OF_LINK):
            load = np.zeros((last + 1, len(OF_LINK)))
            load[last, column] = 1.0
            own = _link_force(
                f"{name} of the load in record {record + 1}",
                "form",
                words,
                remedy,
                _of_links(placed.forces, load),
            )
            yield replace(own, record=record)


def _link_force(
    name: str, kind: str, words: str, remedy: str, needed: Needed, most: float = np.inf
) -> LinkForce:
    return LinkForce(name, kind, words, words, remedy, nothing, most=most, needed=needed)


def _difference(placed: PlacedLinks, changed: PlacedLinks, step: float) -> Needed:
    """Return what links need besides where they are elsewhere, per unit of a size that is `step` there."""
    return lambda links, motion: (changed.forces(links, motion) - placed.forces(links, motion)) / step


def _of_links(needed: Needed, links: FloatArray) -> Needed:
    """Return what links of given parameters, shape (joints, 10) in SI, need."""
    return lambda others, motion: needed(links, motion)
