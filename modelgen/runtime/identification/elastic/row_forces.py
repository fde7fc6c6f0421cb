"""Forces that a file of an elastic arm may lack: friction behind springs, and springs that are not linear."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.filters.butterworth import butterworth
from modelgen.runtime.filters.one_pass import forward_and_backward
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.record_rows import RecordRows

Made = Callable[[Record, FilterChoice], FloatArray]


@dataclass(frozen=True, eq=False)
class RowForce(Effect):
    """A force that rows lack; it is a column of theirs, and nothing in the channels.

    Attributes
    ----------
    acts : mapping of str to float
        How often it is in Y - W X of each row, by name.
    made : callable
        (record, filters) -> the force per unit of its size, shape (n,).
    most : float
        The largest size that a mistake makes.
    """

    acts: Mapping[str, float] = field(default_factory=dict)
    made: Made = lambda record, choice: np.zeros(record.n)
    most: float = np.inf


def row_forces(model: Model) -> Iterator[RowForce]:
    """Yield the forces of each joint whose link has a row, where sensors say what they depend on."""
    names = {row.name for row in model.rows}
    for name in sorted(names):
        joint = name.removesuffix(" link")
        if joint == name:
            continue
        motor, link = (_position(model, body) for body in (f"{joint} motor", joint))
        if link or motor:
            yield from _frictions(joint, partial(_speed, link or motor))
        if motor and link:
            rows = [f"{joint} deflection"] if f"{joint} deflection" in names else [f"{joint} spring", name]
            yield from _springs(joint, rows, partial(_deflection, motor, link))


def summed_friction(model: Model) -> tuple[str, ...]:
    """Return the note that labels friction on both sides of springs as a sum, where rows see no more.

    A row that balances motor and link together gives friction of either to the motor.
    """
    names = {row.name for row in model.rows}
    springs = [role.bodies[0] for role in model.roles.values() if role.role == "stiffness"]
    joints = [joint for joint in dict.fromkeys(springs) if joint in names]
    if not joints:
        return ()
    of = f"joint {joints[0]}" if len(joints) == 1 else f"joints {', '.join(joints)}"
    return (
        f"friction behind the springs of {of}, which the file does not name, can hardly be told from that in "
        "front of them with these sensors: if there is any, the value is the sum",
    )


def force_rows(effect: RowForce, rows: RecordRows, record: Record, choice: FilterChoice) -> FloatArray:
    """Return how Y - W X grows per unit of a force, shape (rows, grid): it passes as a measured one does."""
    force = passed(rows, record, effect.made(record, choice))
    return np.array([effect.acts.get(row.name, 0.0) * force for row in rows.plan.model.rows])


def passed(rows: RecordRows, record: Record, force: FloatArray) -> FloatArray:
    """Return what rows of a record make of a force, shape (n,) in SI: as of measured ones, shape (grid,)."""
    drive = rows.plan.model.actuators[0].key
    return replace(rows, source=record.edited({drive: force})).derivatives(drive, (0,))[:, 0]


def _position(model: Model, body: str) -> str:
    """Return the channel of a position, seen from the joint where there are two; empty without one."""
    found = [one.key for one in model.sensors if one.body == body and one.measures == "position"]
    return next(iter([*(key for key in found if key in model.derived), *found]), "")


def _frictions(joint: str, speed: Made) -> Iterator[RowForce]:
    rows = {f"{joint} link": 1.0}
    remedy = "the file has friction in front of springs only: reduce it, or take the link's values with care"
    where = f"friction at link {joint}, behind the spring"

    def sign(record: Record, choice: FilterChoice) -> FloatArray:
        return np.sign(speed(record, choice))

    for kind, made in (("Coulomb", sign), ("viscous", speed)):
        words = f"there is {kind} {where}"
        yield RowForce(
            f"{kind} friction at link {joint}", "force", words, "", remedy, nothing, acts=rows, made=made
        )


def _springs(joint: str, rows: list[str], deflection: Made) -> Iterator[RowForce]:
    acts = dict(zip(rows, (1.0, -1.0), strict=False))

    def cube(record: Record, choice: FilterChoice) -> FloatArray:
        return deflection(record, choice) ** 3

    def play(record: Record, choice: FilterChoice) -> FloatArray:
        return -np.sign(deflection(record, choice))

    stiff, soft = (f"the spring of joint {joint} {way} as it deflects" for way in ("stiffens", "softens"))
    remedy = "let the file have stiffness3 = true there"
    yield RowForce(f"cube of spring {joint}", "form", stiff, soft, remedy, nothing, acts=acts, made=cube)
    words = f"joint {joint} has play: its spring gives a constant less than it would, either way"
    remedy = "load the joint one way, or remove the play"
    yield RowForce(f"play of joint {joint}", "form", words, "", remedy, nothing, acts=acts, made=play)


def nothing(simulated: object) -> Mapping[str, FloatArray]:
    """Return what a force of rows changes in channels, shape (n,) each, in SI: none of them."""
    return {}


def _speed(key: str, record: Record, choice: FilterChoice) -> FloatArray:
    """Return the speed of a position behind the low-pass for directions, per s, shape (n,)."""
    sections = butterworth(4, min(choice.direction_cutoff_hz, 0.4 * record.fs), record.fs)
    reach = min(record.n - 1, int(4.0 * record.fs / choice.direction_cutoff_hz))
    smooth = forward_and_backward(sections, record.signals[key], reach)
    return np.gradient(smooth, 1.0 / record.fs)


def _deflection(motor: str, link: str, record: Record, choice: FilterChoice) -> FloatArray:
    """Return what a spring deflects by, shape (n,)."""
    return record.signals[motor] - record.signals[link]
