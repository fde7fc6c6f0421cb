"""Accelerometers that feel a held command at once: on the body that a motor drives.

Such a sensor reads the command itself: at the instants of its steps, just after or just before them, that is
half the time of a hold away from the force that moves all else. A controller that acts more often than it is
recorded holds a command over a part of a sample only: how long is found, as what is left out is damping.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError, listed
from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.cutoffs.choose_cutoff import with_predicted_cutoff
from modelgen.runtime.identification.explanation.commands.held_images import (
    HoldKind,
    quiet_job,
    without_images,
)
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    delays_of,
    run_method,
    with_note,
)
from modelgen.runtime.identification.explanation.what_is_left import chance, gained
from modelgen.runtime.identification.job import Change
from modelgen.runtime.identification.methods import Auto, Method
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    FELT_AT_ONCE,
    HARDLY_MOVES,
    HARDLY_SHOWS,
    HOLDS_TRIED,
    PARTS_LATE,
    SHARPENED_HOLD,
)
from modelgen.runtime.iv.thresholds import AS_LIKELY
from modelgen.runtime.least_squares.delays import advanced, with_holds
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.chain_matrices import body_inertias
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.plant import felt_accelerations


def with_readings_at_changes(task: Task, method: Auto, decide: Callable[[Task, Auto], Begun]) -> Begun:
    """Return what a task becomes where sensors may feel commands at once, and be read as these change.

    Parameters
    ----------
    task : Task
    method : Auto
    decide : callable
        Takes a task and its method to the estimate. If commands are read so, the task has them as a drive
        holds them, and no images in the sensors.
    """
    keys = tuple(method.held) or task.job.late
    sensors = felt_at_once(task.model, keys)
    if not sensors or not task.checks.drift_check or len({record.fs for record in task.records}) > 1:
        return decide(task, method)
    felt = _felt(with_predicted_cutoff(task, consistent=True), method, keys, sensors)
    if not felt.length:
        return _open(decide(task, method), felt, keys, sensors)
    begun = decide(task.changed(*felt.changes), replace(method, held=()))
    return _told(begun, felt, keys, sensors, told=bool(method.held))


@dataclass(frozen=True)
class Felt:
    """How commands are held that sensors feel at once.

    Attributes
    ----------
    length : float
        Over how many samples; zero where the records do not show it.
    last : int
        Whether these sensors are read just after a change (0) or just before (1).
    changes : tuple of callable
        What takes the commands as a drive holds them and images off the sensors.
    moves : tuple of mapping of str to float
        By how much each column moves, in SI: with a standard deviation of the length; with holds that are as
        likely, each as far as it is.
    """

    length: float = 0.0
    last: int = 0
    changes: tuple[Change, ...] = ()
    moves: tuple[Mapping[str, float], ...] = ()

    def drift(self, begun: Begun) -> FloatArray:
        """Return the mean square of that in the columns of an estimate, in SI, shape (c, c)."""
        columns = begun.found.fit.columns
        moves = np.array([[move.get(name, 0.0) for name in columns] for move in self.moves])
        return np.asarray(moves.T @ moves if self.moves else np.zeros((len(columns),) * 2))


def _open(begun: Begun, felt: Felt, keys: Sequence[str], sensors: Sequence[str]) -> Begun:
    """Return an estimate without holds whose intervals hold what these move where they are as likely."""
    more, known = felt.drift(begun), hac_covariance(begun.found.fit) + begun.found.drift
    if np.all(np.diag(more) <= HARDLY_MOVES**2 * np.diag(known)):
        return begun
    note = (
        f"whether {listed(keys)} is held over every sample, and {listed(sensors)} read as it changes, hardly "
        f"shows: the intervals hold what that moves; if the controller is sampled, name it (--held {keys[0]})"
    )
    return with_note(begun, note, begun.found.drift + more)


def _told(begun: Begun, felt: Felt, keys: Sequence[str], sensors: Sequence[str], told: bool) -> Begun:
    """Return an estimate that says how commands are held, and whose intervals hold how long that may be."""
    begun = replace(begun, found=replace(begun.found, drift=begun.found.drift + felt.drift(begun)))
    if told:
        return begun
    way, remedy = "every sample", "name it (--held {})"
    if felt.length != 1.0:
        way, remedy = f"{felt.length:.2g} of a sample", "record it as often as its controller acts"
    what = (
        f"is held over {way}, and {listed(sensors)} read just {('after', 'before')[felt.last]} it changes; "
        "they are taken for that"
    )
    advice = tuple(Advice("more than the model", key, what, remedy.format(key)) for key in keys)
    return replace(begun, found=replace(begun.found, advice=(*advice, *begun.found.advice)))


def _felt(task: Task, method: Auto, keys: tuple[str, ...], sensors: Sequence[str]) -> Felt:
    """Return how the commands `keys` are held if `sensors` are read as these change.

    Least squares decides, as it takes little time; instruments say how long a part of a sample is.
    """
    holds = _Holds(task, method, keys)
    try:
        plain = holds.estimate(task)
    except (IdentifiabilityError, DataError):
        return Felt()
    tried = holds.tried(plain)
    length = max(tried, key=tried.__getitem__)
    rival = 0.0
    if tried[length] > AS_LIKELY:
        # channels that are late by a part of a sample leave as little: a hold has to leave less
        others = [key for key in task.records[0].signals if key not in {*keys, *sensors}]
        late = [task.changed(partial(_later, keys=others, by_s=part / holds.fs)) for part in PARTS_LATE]
        rival = max(0.0, *(holds.gained(plain, one) for one in late))
    if tried[length] < AS_LIKELY + rival:
        return Felt(moves=tuple(holds.moved(plain, tried, rival)))
    known = plain
    for how in (method.least_squares, method.instrumental):
        with suppress(IdentifiabilityError, DataError):
            known = holds.estimate(holds.cleaned(length, plain, known), how)
    moves: tuple[Mapping[str, float], ...] = ()
    if abs(length) != 1.0:
        length, moves = holds.sharpened(length, plain, known)
    changes = holds.cleaned(length, plain, known).changes[len(task.changes) :]
    return Felt(abs(length), int(length < 0.0), changes, moves)


class _Holds:
    """Estimates of a task with commands held over parts of a sample: negative where read before steps."""

    def __init__(self, task: Task, method: Auto, keys: tuple[str, ...]) -> None:
        self.task, self.method, self.keys, self.fs = task, method, keys, task.records[0].fs
        self._quiet = quiet_job(task)

    def estimate(self, task: Task, method: Method | None = None) -> Begun:
        """Return least squares of a task, or another method, without samples about reversals.

        Directions of low-passed speeds are late there, which late sensors mend.
        """
        calm = replace(task, job=replace(task.job, turns=False))
        return run_method(calm, method or self.method.least_squares)

    def cleaned(self, length: float, plain: Begun, known: Begun) -> Task:
        """Return the task with commands held so long, without images at a known estimate.

        `plain` says by how many whole samples commands are late besides.
        """
        told, delays, last = bool(self.method.held), delays_of(plain), int(length < 0.0)
        apart = 0.5 * told - last * abs(length)
        at = {key: round(delays.get(key, 0.0) * self.fs - apart) / self.fs for key in self.keys}
        holding = partial(with_holds, channels=self.keys, length=abs(length))
        held = self.task if told else self.task.changed(holding)
        return without_images(held, at, known, HoldKind(behind=last, length=abs(length)))

    def gained(self, plain: Begun, task: Task, length: float = 0.0) -> float:
        """Return by how much more likely the estimate of a task is; minus infinity where there is none."""
        held = {} if self.method.held else dict.fromkeys(self.keys, abs(length))
        try:
            return gained(plain, self.estimate(task), self._quiet, held if length else {})
        except (IdentifiabilityError, DataError):
            return -np.inf

    def tried(self, plain: Begun) -> dict[float, float]:
        """Return lengths of a hold, and by how much more likely each is than none, the likeliest among them.

        The shortest ones say in which direction to look.
        """

        def by(length: float) -> float:
            return self.gained(plain, self.cleaned(length, plain, plain), length)

        found = {one: by(one) for one in (1.0, -1.0)}
        if self.method.held:
            return found
        found |= {one: by(one) for one in (HOLDS_TRIED[0], -HOLDS_TRIED[0])}
        side = float(np.sign(max(found, key=found.__getitem__)))
        if max(found.values()) < AS_LIKELY:
            return found
        found |= {one: by(one) for one in (side * length for length in HOLDS_TRIED[1:])}
        lengths = sorted((one for one in found if one * side > 0.0), key=abs)
        place = lengths.index(max(lengths, key=found.__getitem__))
        if place < len(lengths) - 1:  # most commands are recorded as often as they are given
            near = [0.0, *lengths]
            length = _highest(by, sorted((near[place], near[place + 2])))
            found[length] = by(length)
        return found

    def moved(self, plain: Begun, tried: Mapping[float, float], rival: float) -> Iterator[dict[str, float]]:
        """Yield by how much columns move with each hold, as far as it is as likely as none, and as a rival.

        The mean square is that of a mixture (`held_commands`).
        """
        likely = {1.0, -1.0, max(tried, key=tried.__getitem__)}
        chances = {length: chance(rival - tried[length]) for length in likely}
        chances = {length: one for length, one in chances.items() if one > HARDLY_SHOWS}
        for method in (self.method.instrumental, self.method.least_squares) if chances else ():
            try:
                before = _columns(self.estimate(self.task, method))
                ends = {
                    one: _columns(self.estimate(self.cleaned(one, plain, plain), method)) for one in chances
                }
            except (IdentifiabilityError, DataError):
                continue
            for length, end in ends.items():
                share = chances[length] ** 0.5
                yield {name: share * (end.get(name, value) - value) for name, value in before.items()}
            return

    def sharpened(
        self, length: float, plain: Begun, known: Begun
    ) -> tuple[float, tuple[Mapping[str, float], ...]]:
        """Return the length of a hold that instruments find, and what a standard deviation of it moves.

        Likelihoods about it are those of a normal distribution.
        """
        step = SHARPENED_HOLD * abs(length)
        lengths = [length - step, length, length + step]
        try:
            tasks = [self.cleaned(one, plain, known) for one in lengths]
            found = [self.estimate(one, self.method.instrumental) for one in tasks]
        except (IdentifiabilityError, DataError):
            return length, ()
        held = [dict.fromkeys(self.keys, abs(one)) for one in lengths]
        more = [gained(plain, one, self._quiet, own) for one, own in zip(found, held, strict=True)]
        bend, slope, _ = np.polyfit([-1.0, 0.0, 1.0], more, 2).tolist()
        std, by = 1.0, 0.0
        if bend < 0.0:
            std, by = float((-2.0 * bend) ** -0.5), float(np.clip(-0.5 * slope / bend, -2.0, 2.0))
        first, last = _columns(found[0]), _columns(found[-1])
        moved = {name: 0.5 * std * (value - first.get(name, value)) for name, value in last.items()}
        return length + by * step, (moved,)


def _columns(begun: Begun) -> dict[str, float]:
    """Return what an estimate has for each column, in SI."""
    return dict(zip(begun.found.fit.columns, begun.found.fit.solution.x.tolist(), strict=True))


def _highest(of: Callable[[float], float], within: Sequence[float]) -> float:
    """Return where a function is highest between two numbers, to some percent of these."""
    from scipy.optimize import minimize_scalar

    width = abs(within[1] - within[0])
    found = minimize_scalar(
        lambda one: -of(one), bounds=within, method="bounded", options={"xatol": 0.03 * width, "maxiter": 8}
    )
    return float(found.x)


def felt_at_once(model: Model, keys: Collection[str]) -> list[str]:
    """Return the sensors that feel some of these forces at once: accelerometers on what they drive."""
    driven = [one.body for one in model.actuators if one.key in keys]
    places = [place for place, (body, _) in enumerate(body_inertias(model)) if body in driven]
    if not places or not any(sensor.order == 2 for sensor in model.sensors):
        return []
    felt = np.abs(felt_accelerations(model))
    at_once = felt[:, places].max(axis=1) > FELT_AT_ONCE * felt.max(axis=1)
    return [sensor.key for sensor, one in zip(model.sensors, at_once.tolist(), strict=True) if one]


def _later(records: tuple[Record, ...], keys: Collection[str], by_s: float) -> tuple[Record, ...]:
    return tuple(advanced(record, dict.fromkeys(keys, by_s)) for record in records)
