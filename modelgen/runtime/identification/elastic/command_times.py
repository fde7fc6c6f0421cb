"""What rows of an elastic arm say of commands that drives may hold, before anything else is looked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.elastic.channel_errors import forces_of_drives
from modelgen.runtime.identification.methods import run_wls
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import AS_LIKELY
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.records.record import Record


class CommandTimes(NamedTuple):
    """What rows say of commands that drives may hold, before anything else is looked for.

    `plain` and `held` are misfits with commands as they are and half a sample later, `move` what X changes by
    between them, in SI, by column.
    """

    drives: tuple[str, ...]
    plain: float
    held: float
    move: Mapping[str, float]

    @property
    def holds(self) -> bool:
        """Whether rows of commands half a sample later are clearly more likely."""
        return self.held < self.plain - AS_LIKELY

    @property
    def alike(self) -> bool:
        """Whether rows do not tell."""
        return abs(self.held - self.plain) <= AS_LIKELY


def times_of_commands(task: Task) -> CommandTimes | None:
    """Return what rows say of all drives' commands; None where there are none, or nothing is told.

    Half a sample may be in a damper, and the rest of it look like another channel that is late: no force need
    be early by half a sample, and tachometers of both sides had dampers 19 deviations off. Times alone are
    compared, as the average that a hold is takes noise off the force as well. Where springs give positions
    that has been looked at with these (`given_positions`).
    """
    drives = forces_of_drives(task.model)
    if not drives or isinstance(task.model.kernel, DeflectedKernel):
        return None

    def later(records: tuple[Record, ...]) -> tuple[Record, ...]:
        return tuple(advanced(one, dict.fromkeys(drives, -0.5 / one.fs)) for one in records)

    held = task.changed(later)
    try:
        fits = [run_wls(replace(one.job, late=(), surveys=()))[1] for one in (task, held)]
    except (DataError, IdentifiabilityError):
        return None
    plain, other = (dict(zip(fit.columns, fit.solution.x.tolist(), strict=True)) for fit in fits)
    move = {name: other.get(name, value) - value for name, value in plain.items()}
    return CommandTimes(drives, fits[0].misfit, fits[1].misfit, move)
