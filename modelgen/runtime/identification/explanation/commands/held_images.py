"""What images of a held command add to sampled readings, taken off these.

A command that changes once a sample has images about all multiples of the sampling frequency fs. The
mechanics answer to these, too, little as that is, and sampling folds the answer back: of the motion of a
rigid body at f (pi f / fs)^4 / 15, in opposite phase, of its speed (pi f / fs)^2 / 3. Rows know nothing above
half of fs. What is folded follows from the command that is known and from the parameters, of which an error
of a percent is one of a percent of very little (Astrom and Wittenmark 1997, ch. 2: sampled systems).

An accelerometer on the body that a motor drives feels the command itself, and its steps: read at the instants
of these, just after or just before them, it is as much as half a sample away from the force.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.errors import DataError, IdentifiabilityError, listed
from modelgen.runtime.advice import Advice
from modelgen.runtime.identification.cutoffs.choose_cutoff import with_predicted_cutoff
from modelgen.runtime.identification.explanation.commands.rest_of_commands import held_for, rest_of
from modelgen.runtime.identification.explanation.explained import (
    Begun,
    delays_of,
    gained,
    run_method,
)
from modelgen.runtime.identification.job import Change, Job
from modelgen.runtime.identification.methods import Auto
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import FELT_AT_ONCE, HALF_SAMPLE, PARTS_LATE, STEPS_TAKEN
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.iv.thresholds import AS_LIKELY
from modelgen.runtime.least_squares.delays import advanced, with_holds
from modelgen.runtime.least_squares.time_shifts import behind, hold, plus, shift, steps_only
from modelgen.runtime.model.chain_matrices import body_inertias
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.matrix_exponential import matrix_exponential
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.plant import Plant, felt_accelerations, make_plant, possible


@dataclass(frozen=True)
class HoldKind:
    """How commands are held.

    Attributes
    ----------
    rest : mapping of str to float, optional
        Records have the commands as they are, whose steps are to be held; the rest of each acts later by so
        many halves of a sample, as its controller holds that.
    behind : int, optional
        What feels a command at once is read just after its change (0), or just before (1). None where it is
        read as rows take it, without images: behind a filter, or not at all.
    """

    rest: Mapping[str, float] | None = None
    behind: int | None = None


def without_images(task: Task, delays: Mapping[str, float], known: Begun, kind: HoldKind) -> Task:
    """Return the task without what images of held commands add to the sensors.

    Parameters
    ----------
    task : Task
        Its records hold the commands as a hold makes them.
    kind : HoldKind
    delays : mapping of str to float
        By how many s these are late, by channel: below zero for a command that acts later.
    known : Begun
        An estimate of the same model: its parameters are those that the chain answers with.
    """
    model = task.model
    values = possible(model, simulation_parameters(model, known.found.fit))
    plant = make_plant(model, values)

    def cleaned(records: tuple[Record, ...]) -> tuple[Record, ...]:
        return tuple(_cleaned(record, plant, delays, kind) for record in records)

    return task.changed(cleaned)


def _cleaned(record: Record, plant: Plant, delays: Mapping[str, float], kind: HoldKind) -> Record:
    found = [key for key in delays if key in record.signals]
    held = record
    if kind.rest is not None:
        # what a hold makes of the steps takes their place
        steps = steps_only(record, found)
        held = steps.edited({key: hold(key) for key in found})
        rest = record.edited({key: plus(key, steps, -1.0) for key in found})
        for key in found:
            late, later = delays[key] * record.fs, kind.rest[key]
            rest = rest.edited({key: hold(key, held_for(later, late), later)} if later else {})
            rest = rest.edited({key: plus(key, held), rest_of(key): shift(key, late)})
        record = rest
    for key in found:
        record = _without(record, held, plant, key, delays[key] * record.fs, kind.behind)
    return record


def _without(record: Record, held: Record, plant: Plant, key: str, late: float, last: int | None) -> Record:
    """Return a record without what images of one command, late by so many samples, add to the sensors.

    `held` has what is held of it; `last` is `HoldKind.behind`.
    """
    model = plant.model
    column = [entry.key for entry in model.actuators].index(key)
    space = plant.space((1,) * len(plant.sticking))
    edits = {}
    for place, sensor in enumerate(model.sensors):
        direct = space.D[place, column]
        if sensor.key in record.signals and not (direct and last is None):
            response = folded(space.A, space.B[:, column], space.C[place], record.fs, late)
            if last is not None and direct:
                response = partial(_with_direct, moved=response, direct=direct, late=late, last=last)
            image = held.edited({sensor.key: behind(key, response, abs(late), 0.0)})
            edits[sensor.key] = plus(sensor.key, image, -1.0)
    return record.edited(edits)


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
    last, changes = _read_at_changes(with_predicted_cutoff(task, consistent=True), method, keys, sensors)
    if not changes:
        return decide(task, method)
    begun = decide(task.changed(*changes), replace(method, held=()))
    if method.held:
        return begun
    what = (
        f"is held over every sample, and {listed(sensors)} read just {('after', 'before')[last]} it changes; "
        "they are taken for that"
    )
    advice = tuple(Advice("more than the model", key, what, f"name it (--held {key})") for key in keys)
    return replace(begun, found=replace(begun.found, advice=(*advice, *begun.found.advice)))


def _read_at_changes(
    task: Task, method: Auto, keys: tuple[str, ...], sensors: Sequence[str]
) -> tuple[int, tuple[Change, ...]]:
    """Return whether `sensors` are read just after changes of the commands `keys` (0) or just before (1).

    And what takes the commands as a drive holds them and images off the sensors: nothing if they are read
    otherwise. Least squares decides, as it takes little time; instruments give the parameters of the images.
    """
    look = partial(run_method, method=method.least_squares)
    try:
        plain = look(task)
    except (IdentifiabilityError, DataError):
        return 0, ()
    fs, delays = task.records[0].fs, delays_of(plain)
    # a hold that is told is half a sample late already
    late = {key: delays.get(key, 0.0) * fs - (0.5 if method.held else 0.0) for key in keys}
    if any(abs(one - round(one)) > HALF_SAMPLE for one in late.values()):
        return 0, ()
    held = task if method.held else task.changed(partial(with_holds, channels=keys))

    def cleaned(last: int, known: Begun) -> Task:
        at = {key: (round(one) + last) / fs for key, one in late.items()}
        return without_images(held, at, known, HoldKind(behind=last))

    gained_by = partial(_gained, plain, look, quiet_job(task))
    by = [gained_by(cleaned(last, plain), () if method.held else keys) for last in (0, 1)]
    # channels that are late by a part of a sample leave as little: a hold has to leave less than these
    others = [key for key in task.records[0].signals if key not in {*keys, *sensors}]
    late_ones = [task.changed(partial(_later, keys=others, by_s=part / fs)) for part in PARTS_LATE]
    if max(by) < AS_LIKELY + max(0.0, *(gained_by(one) for one in late_ones)):
        return 0, ()
    last, known = int(np.argmax(by)), plain
    for run in (look, partial(run_method, method=method.instrumental)):
        with suppress(IdentifiabilityError, DataError):
            known = run(cleaned(last, known))
    return last, cleaned(last, known).changes[len(task.changes) :]


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


def _gained(
    plain: Begun, look: Callable[[Task], Begun], quiet: Job, task: Task, held: Collection[str] = ()
) -> float:
    """Return by how much more likely the estimate of a task is; nothing where there is none."""
    try:
        return gained(plain, look(task), quiet, dict.fromkeys(held, 1.0))
    except (IdentifiabilityError, DataError):
        return -np.inf


def quiet_job(task: Task) -> Job:
    """Return a job whose forces lack the steps they take, which would pass for noise at high frequencies."""

    def quiet(record: Record) -> Record:
        keys = [key for key in stepping_commands(task) if key in record.signals]
        steps = steps_only(record, keys)
        return record.edited({key: plus(key, steps, -1.0) for key in keys})

    return task.job.changed(lambda records: tuple(quiet(record) for record in records))


def stepping_commands(task: Task) -> list[str]:
    """Return the forces, of those whose delay is to be found, that take many steps at their samples.

    A binary command under an analogue controller does: it is held, and what the controller adds is not.
    """
    return [
        key
        for key in task.job.late
        if any(
            key in record.signals and len(record.facts.steps(key)[0]) >= STEPS_TAKEN * record.n
            for record in task.job.records
        )
    ]


def folded(
    A: FloatArray, B: FloatArray, C: FloatArray, fs: float, late: float = 0.0
) -> Callable[[FloatArray], ComplexArray]:
    """Return what images add to samples at `fs` in Hz of C x, x' = A x + B u, per u as a hold makes it.

    Exact: the motion from sample to sample under the held command, less the response to u. The function
    takes frequencies in cycles a sample, shape (k,). A (SI) has shape (states, states), B (states,) and C
    (states,). `late` is by how many samples u is recorded late; below zero it acts
    later.
    """
    whole = int(np.floor(-late))
    part = -late - whole
    first, then, step = (_over(A, B, share / fs) for share in (part, 1.0 - part, 1.0))

    def response(frequency: FloatArray) -> ComplexArray:
        found = np.zeros(frequency.shape, dtype=complex)
        f = frequency[frequency > 0.0][:, None]  # what rests has no images
        z: ComplexArray = np.exp(2j * np.pi * f)
        held = np.sinc(f) * np.exp(-1j * np.pi * f)
        pushed = z**-whole * (then[1] + then[0] @ first[1] / z) / held
        omega = 2.0 * np.pi * fs * f
        plain = np.exp(1j * late / fs * omega) * B
        sampled, continuous = _solved(z, step[0], pushed), _solved(np.asarray(1j * omega), A, plain)
        found[frequency > 0.0] = (sampled - continuous) @ C
        return found

    return response


def _with_direct(
    frequency: FloatArray, moved: Callable[[FloatArray], ComplexArray], direct: float, late: float, last: int
) -> ComplexArray:
    """Return `folded` with what a sensor reads of the command itself, `direct` per unit of it.

    A reading near the instant of a change is the command of that instant, or that before; between its
    changes either count gives the same one.
    """
    given = np.exp(-2j * np.pi * frequency * (round(-late) + last))
    held = np.sinc(frequency) * np.exp(-1j * np.pi * frequency)
    return np.asarray(moved(frequency) + direct * (given / held - np.exp(2j * np.pi * frequency * late)))


def _over(A: FloatArray, B: FloatArray, time_s: float) -> tuple[FloatArray, FloatArray]:
    """Return what a time makes of states, shape (n, n), and of a constant input, shape (n,)."""
    n = len(A)
    moved = matrix_exponential(time_s * np.vstack((np.column_stack((A, B)), np.zeros(n + 1))))
    return moved[:n, :n], moved[:n, n]


def _solved(s: ComplexArray, A: FloatArray, b: ComplexArray) -> ComplexArray:
    """Return (s - A)^-1 b, shape (frequencies, n), of s, shape (frequencies, 1), and b, shape as returned."""
    return np.asarray(np.linalg.solve(s[..., None] * np.eye(len(A)) - A, b[..., None])[..., 0])
