"""What images of a held command add to sampled readings, taken off these.

A command that changes once a sample has images about all multiples of the sampling frequency fs. The
mechanics answer to these, too, little as that is, and sampling folds the answer back: of the motion of a
rigid body at f (pi f / fs)^4 / 15, in opposite phase, of its speed (pi f / fs)^2 / 3. Rows know nothing above
half of fs. What is folded follows from the command that is known and from the parameters, of which an error
of a percent is one of a percent of very little (Astrom and Wittenmark 1997, ch. 2: sampled systems).

An accelerometer on the body that a motor drives feels the command itself, and its steps (`felt_commands`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.identification.explanation.commands.rest_of_commands import held_for, rest_of
from modelgen.runtime.identification.explanation.explained import Begun
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import STEPS_TAKEN
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.least_squares.time_shifts import behind, hold, plus, shift, steps_only
from modelgen.runtime.numerics.matrix_exponential import matrix_exponential
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.plant import Plant, make_plant, possible


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
    length : float
        Over how many samples a command is held: part of one where its controller acts more often than it is
        recorded.
    """

    rest: Mapping[str, float] | None = None
    behind: int | None = None
    length: float = 1.0


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
        record = _without(record, held, plant, key, delays[key] * record.fs, kind)
    return record


def _without(record: Record, held: Record, plant: Plant, key: str, late: float, kind: HoldKind) -> Record:
    """Return a record without what images of one command, late by so many samples, add to the sensors.

    `held` has what is held of it.
    """
    last, length = kind.behind, kind.length
    model = plant.model
    column = [entry.key for entry in model.actuators].index(key)
    space = plant.space((1,) * len(plant.sticking))
    edits = {}
    for place, sensor in enumerate(model.sensors):
        direct = space.D[place, column]
        if sensor.key in record.signals and not (direct and last is None):
            response = folded(space.A, space.B[:, column], space.C[place], record.fs / length, late / length)
            if last is not None and direct:
                response = partial(_with_direct, moved=response, direct=direct, late=late / length, last=last)
            response = partial(_of_periods, response, length)
            image = held.edited({sensor.key: behind(key, response, abs(late), 0.0)})
            edits[sensor.key] = plus(sensor.key, image, -1.0)
    return record.edited(edits)


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
    given = np.exp(-2j * np.pi * frequency * (last - late))
    held = np.sinc(frequency) * np.exp(-1j * np.pi * frequency)
    return np.asarray(moved(frequency) + direct * (given / held - np.exp(2j * np.pi * frequency * late)))


def _of_periods(
    response: Callable[[FloatArray], ComplexArray], length: float, frequency: FloatArray
) -> ComplexArray:
    """Return a response to a command that is held over so many samples, at frequencies in cycles a sample."""
    return response(length * frequency)


def _over(A: FloatArray, B: FloatArray, time_s: float) -> tuple[FloatArray, FloatArray]:
    """Return what a time makes of states, shape (n, n), and of a constant input, shape (n,)."""
    n = len(A)
    moved = matrix_exponential(time_s * np.vstack((np.column_stack((A, B)), np.zeros(n + 1))))
    return moved[:n, :n], moved[:n, n]


def _solved(s: ComplexArray, A: FloatArray, b: ComplexArray) -> ComplexArray:
    """Return (s - A)^-1 b, shape (frequencies, n), of s, shape (frequencies, 1), and b, shape as returned."""
    return np.asarray(np.linalg.solve(s[..., None] * np.eye(len(A)) - A, b[..., None])[..., 0])
