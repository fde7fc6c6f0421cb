"""What dampers add to joint torques at the instants at which held commands change, taken off these.

A command that a drive holds gives the motor an acceleration that jumps at every sample. Its speed at that
instant is less than what positions say that are read at samples, by h^2 / 12 times what the acceleration
grows by per s, h the time between samples: an image of the command that sampling folds back (`held_images`).
A torque sensor behind the motor feels it through the damper. Little as that is, of a damper's torque it is
(h omega)^2 / 12, with omega^2 = K / Ia: 0.2 % at 1 kHz of a motor that swings at 23 Hz on its spring.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.elastic.channel_errors import DRIVE
from modelgen.runtime.identification.methods import run_wls
from modelgen.runtime.identification.task import Task
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record


def without_damper_images(task: Task, held: Collection[str]) -> Task:
    """Return the task without images in its joint torques; the same where no sensor feels one.

    Its records have the commands `held` as a hold makes them. Least squares of its rows give inertia of the
    drives and damping: an error of a percent in these is one of a percent of very little.
    """
    felt = _felt(task.model, held)
    if not felt:
        return task
    model = task.model
    # delays are not estimated by default: channels are set right before
    on_time = replace(task.job, late=())
    point = run_wls(on_time)[1].all_parameters(model.base_parameters)
    values = dict(zip(model.base_parameters, point.tolist(), strict=True))
    seconds = {
        torque: (drive, lever * values[damping] / values[inertia])
        for torque, (drive, lever, damping, inertia) in felt.items()
        if values[inertia] > 0.0
    }

    def cleaned(records: tuple[Record, ...]) -> tuple[Record, ...]:
        return tuple(
            record.edited(
                {
                    torque: Edit(torque, partial(_without, record, drive, share / record.fs**2))
                    for torque, (drive, share) in seconds.items()
                    if torque in record.signals
                }
            )
            for record in records
        )

    return task.changed(cleaned)


def _felt(model: Model, held: Collection[str]) -> dict[str, tuple[str, float, str, str]]:
    """Return the torques behind drives that hold: by channel the drive, its lever, damping and inertia."""
    levers = {one.key: one.lever for one in model.actuators if one.key in held}
    named = {
        (one.role, one.bodies[0]): name
        for name, one in model.roles.items()
        if len(one.bodies) == 1 and name in model.base_parameters
    }
    found = {}
    for sensor in model.module.SENSORS:
        drive = f"{DRIVE}{sensor['joint']}"
        damping, inertia = (named.get((role, sensor["joint"])) for role in ("damping", "inertia"))
        if sensor["measures"] == "torque" and drive in levers and damping and inertia:
            found[sensor["key"]] = drive, levers[drive], damping, inertia
    return found


def _without(record: Record, drive: str, by: float, samples: FloatArray, start: int) -> FloatArray:
    """Return samples of a torque, from `start` on, without an image of a drive's force.

    That is -`by` / 12, in s, times what the force grows by per s.
    """
    first, stop = max(start - 1, 0), min(start + len(samples) + 1, record.n)
    if stop - first < 2:
        return samples
    change = np.gradient(record.read(drive, first, stop), 1.0 / record.fs)
    return samples + by / 12.0 * change[start - first : start - first + len(samples)]
