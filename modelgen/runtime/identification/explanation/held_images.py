"""What images of a held command add to sampled readings, taken off these.

A command that changes once a sample has images about all multiples of the sampling frequency fs. The
mechanics answer to these, too, little as that is, and sampling folds the answer back: of the motion of a
rigid body at f (pi f / fs)^4 / 15, in opposite phase, of its speed (pi f / fs)^2 / 3. Rows know nothing above
half of fs. What is folded follows from the command that is known and from the parameters, of which an error
of a percent is one of a percent of very little (Astrom and Wittenmark 1997, ch. 2: sampled systems).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.identification.explanation.explained import Begun
from modelgen.runtime.identification.task import Task
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.least_squares.time_shifts import behind, hold, steps_only
from modelgen.runtime.numerics.matrix_exponential import matrix_exponential
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.plant import Plant, make_plant, possible


def without_images(task: Task, delays: Mapping[str, float], known: Begun, stepped: bool = False) -> Task:
    """Return the task without what images of held commands add to the sensors.

    Parameters
    ----------
    task : Task
        Its records hold the commands as a hold makes them.
    stepped : bool
        They hold them as recorded, and only the steps that these take are to be held.
    delays : mapping of str to float
        By how many s these are late, by channel: below zero for a command that acts later.
    known : Begun
        An estimate of the same model: its parameters are those that the chain answers with.
    """
    model = task.model
    values = possible(model, simulation_parameters(model, known.found.fit))
    plant = make_plant(model, values)

    def cleaned(records: tuple[Record, ...]) -> tuple[Record, ...]:
        return tuple(_cleaned(record, plant, delays, stepped) for record in records)

    return task.changed(cleaned)


def _cleaned(record: Record, plant: Plant, delays: Mapping[str, float], stepped: bool) -> Record:
    found = [key for key in delays if key in record.signals]
    held = record
    if stepped:
        # what a hold makes of the steps takes their place
        steps = steps_only(record, found)
        held = steps.edited({key: hold(key) for key in found})
        more = steps.edited({key: less(key, held) for key in found})
        record = record.edited({key: less(key, more) for key in found})
    for key in found:
        record = _without(record, held, plant, key, delays[key] * record.fs)
    return record


def _without(record: Record, held: Record, plant: Plant, key: str, late: float) -> Record:
    """Return a record without what images of one command, late by so many samples, add to the sensors.

    `held` has what is held of it.
    """
    model = plant.model
    column = [entry.key for entry in model.actuators].index(key)
    space = plant.space((1,) * len(plant.sticking))
    edits = {}
    for place, sensor in enumerate(model.sensors):
        # where a command is felt at once a reading at the instant of its change is either of two
        if sensor.key in record.signals and not space.D[place, column]:
            response = folded(space.A, space.B[:, column], space.C[place], record.fs, late)
            image = held.edited({sensor.key: behind(key, response, abs(late), 0.0)})
            edits[sensor.key] = less(sensor.key, image)
    return record.edited(edits)


def less(key: str, other: Record) -> Edit:
    """Return a channel less that of another record."""
    return Edit(key, lambda samples, start: samples - other.read(key, start, start + len(samples)))


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


def _over(A: FloatArray, B: FloatArray, time_s: float) -> tuple[FloatArray, FloatArray]:
    """Return what a time makes of states, shape (n, n), and of a constant input, shape (n,)."""
    n = len(A)
    moved = matrix_exponential(time_s * np.vstack((np.column_stack((A, B)), np.zeros(n + 1))))
    return moved[:n, :n], moved[:n, n]


def _solved(s: ComplexArray, A: FloatArray, b: ComplexArray) -> ComplexArray:
    """Return (s - A)^-1 b, shape (frequencies, n), of s, shape (frequencies, 1), and b, shape as returned."""
    return np.asarray(np.linalg.solve(s[..., None] * np.eye(len(A)) - A, b[..., None])[..., 0])
