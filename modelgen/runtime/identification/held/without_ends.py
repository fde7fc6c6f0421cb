"""Records of which the ends alone contradict the model: a brake, a stop, a hand on the machine."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from modelgen.array_types import BoolArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import step
from modelgen.runtime.identification.default_method import default_method
from modelgen.runtime.identification.explanation.explained import Begun, exceeding, with_note
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV, Auto
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import END_SHARE, LEFT_AT_ENDS
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.row_block import RowBlock

LACKING = ("records", "rows")  # of too few samples, which fewer do not cure


def default_without_ends(task: Task, method: Auto) -> Begun:
    """Return a task with the default method run; without the ends of its records where it finds nothing else.

    A machine is held by brakes, stops or hands when a record begins or ends, and no chain moves as it does
    then. What is left has to be explained to the noise of its sensors by instruments, which simulate all of
    it: one model that holds for most of every record, and not for its ends, is right there.

    Raises
    ------
    DataError, IdentifiabilityError
        As `default_method`, of all samples, where nothing is found without the ends either.
    """
    try:
        return default_method(task, method)
    except IdentifiabilityError as error:
        few = any(one.where in LACKING for one in error.problems)
        if (
            few
            or task.model.is_arm
            or task.job.drop
            or method.rows == "power"
            or not _ends_contradict(task.job)
        ):
            raise
        step("leaving out the ends of the records")
        with suppress(IdentifiabilityError, DataError):
            found = default_method(task.changed(_middle), method)
            if isinstance(found.task.method, IV) and not exceeding(found):
                share = f"the first and the last {100.0 * END_SHARE:g} % of every record are left out"
                why = (
                    "with them no estimate explains the records (was the machine held there, as by a brake?)"
                )
                return with_note(found, f"{share}: {why}")
        raise


def _ends_contradict(job: Job) -> bool:
    """Tell whether least squares of the middle of records leave more at their ends than there.

    Of what any estimate lacks, or noise hides, either part has as much. To look costs next to nothing; all
    that the default tries once more has taken up to two minutes.
    """
    rows = job.observed(job.records)
    blocks = [(block, _at_ends(block)) for block in rows.blocks if block.count]
    middle = tuple(block.without(ends) for block, ends in blocks)
    try:
        fit = fit_matched(replace(rows, blocks=tuple(block for block in middle if block.count)))
    except IdentifiabilityError:
        return True
    x = fit.all_parameters(rows.columns)
    for block, ends in blocks:
        left, there = block.residual(x) ** 2, ends[block.place]
        if there.any() and not there.all():
            inside, outside = float(np.mean(left[~there])), float(np.mean(left[there]))
            if outside > LEFT_AT_ENDS**2 * inside:
                return True
    return False


def _at_ends(block: RowBlock) -> BoolArray:
    """Return which points of a block's grid are among the ends of its record, shape (grid,)."""
    share = (np.arange(block.grid) + 0.5) / block.grid
    return np.asarray((share < END_SHARE) | (share > 1.0 - END_SHARE))


def _middle(records: tuple[Record, ...]) -> tuple[Record, ...]:
    """Return records without their ends, their names as they were."""
    cuts = [(record, round(END_SHARE * record.n)) for record in records]
    return tuple(record.part(cut, record.n - cut, record.name) for record, cut in cuts)
