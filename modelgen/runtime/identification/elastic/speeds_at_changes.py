"""Speeds of motors at the instants at which held commands change, read by tachometers and felt by dampers.

A command that a drive holds gives the motor an acceleration that jumps at every sample. Its speed at that
instant is less than what positions say that are read at samples, by h^2 / 12 times what the acceleration
grows by per s, h the time between samples: what sampling folds back of the command (`held_images`).
A tachometer reads that speed: of tones of 25 Hz at 500 Hz it shows (h omega)^2 / 12, 0.8 %, more, and
inertias of motors were up to as much too small, 11 deviations. A torque sensor behind the motor feels it
through the damper. Little as that is, of a damper's torque it is (h omega)^2 / 12, with omega^2 = K / Ia:
0.2 % at 1 kHz of a motor that swings at 23 Hz on its spring.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.methods import run_wls
from modelgen.runtime.identification.task import Task
from modelgen.runtime.model.arm_channels import DRIVE
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record

Measured = Literal["velocity", "torque"]


def with_speeds_of_positions(task: Task, held: Collection[str], measured: Measured) -> Task:
    """Return the task with speeds of motors as positions say; the same where no sensor reads or feels one.

    Its records have the commands `held` as a hold makes them. Least squares of its rows give inertia of the
    drives and damping: an error of a percent in these is one of a percent of very little. Channels that are
    late move dampings by more than that: what is `measured` as a torque is set right behind them.
    """
    felt = _felt(task.model, held, measured)
    if not felt:
        return task
    model = task.model
    # delays are not estimated by default: channels are set right before
    on_time = replace(task.job, late=())
    point = run_wls(on_time)[1].all_parameters(model.base_parameters)
    values = dict(zip(model.base_parameters, point.tolist(), strict=True))
    seconds = {
        channel: (drive, lever * (values[damping] if damping else 1.0) / values[inertia])
        for channel, (drive, lever, damping, inertia) in felt.items()
        if values[inertia] > 0.0
    }

    def cleaned(records: tuple[Record, ...]) -> tuple[Record, ...]:
        return tuple(
            record.edited(
                {
                    channel: Edit(channel, partial(_without, record, drive, share / record.fs**2))
                    for channel, (drive, share) in seconds.items()
                    if channel in record.signals
                }
            )
            for record in records
        )

    return task.changed(cleaned)


def _felt(model: Model, held: Collection[str], measured: Measured) -> dict[str, tuple[str, float, str, str]]:
    """Return what feels speeds of motors whose drives hold: by channel drive, lever, damping and inertia.

    The damping is that of a torque behind the motor; of a speed there is none.
    """
    levers = {one.key: one.lever for one in model.actuators if one.key in held}
    named = {
        (one.role, one.bodies[0]): name
        for name, one in model.roles.items()
        if len(one.bodies) == 1 and name in model.base_parameters
    }
    found = {}
    for sensor in model.module.SENSORS:
        drive, what = f"{DRIVE}{sensor['joint']}", (sensor["measures"], sensor["side"])
        damping, inertia = (named.get((role, sensor["joint"]), "") for role in ("damping", "inertia"))
        if drive not in levers or not inertia or what[0] != measured:
            continue
        if what[0] == "torque" and damping:
            found[sensor["key"]] = drive, levers[drive], damping, inertia
        elif what == ("velocity", "motor"):
            # in front of the gear the motor moves so many times as far
            found[sensor["key"]] = drive, levers[drive] ** 2, "", inertia
        elif what == ("velocity", "deflection"):
            found[sensor["key"]] = drive, levers[drive], "", inertia
    return found


def _without(record: Record, drive: str, by: float, samples: FloatArray, start: int) -> FloatArray:
    """Return samples of a torque or a speed, from `start` on, without what a drive's force adds to it.

    That is -`by` / 12, in the channel's unit times s over that of the force, times what this grows by per s.
    """
    first, stop = max(start - 1, 0), min(start + len(samples) + 1, record.n)
    if stop - first < 2:
        return samples
    change = np.gradient(record.read(drive, first, stop), 1.0 / record.fs)
    return samples + by / 12.0 * change[start - first : start - first + len(samples)]
