"""Filters of a task with other cut-offs, in steps of the root of two."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from modelgen.errors import DataError
from modelgen.runtime.filter_choice.explain import direction_sentence
from modelgen.runtime.filter_choice.filter_choice import FilterChoice, choose_filter
from modelgen.runtime.filter_choice.thresholds import HIGHEST_CUTOFF, SIGNAL_CUTOFF
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import CUTOFF_STEPS
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.physical_parameters import all_from_composites
from modelgen.runtime.records.directions import blended_directions
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.masks import direction_keys
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock
from modelgen.runtime.rows.row_terms import channels_of_rows
from modelgen.runtime.rows.thresholds import SAMPLES_AN_UNKNOWN


def with_enough_samples(task: Task, parts: tuple[Record, ...]) -> Task:
    """Return a task of a chain at the lowest cut-off, its own or above, that leaves samples enough.

    Where its own leaves enough of parts of the records already, these are not filtered whole.

    A low-pass feels rests and reversals the longer the lower its cut-off is: between the rests of a jog
    hardly a sample may be left, however much the motion tells. Directions are of a band that is wider by as
    much. The same where no cut-off leaves enough.
    """
    model, job = task.model, task.job
    if model.is_arm:
        return task
    added = job.physical or all_from_composites(model)  # as instruments are run
    if parts != job.records and _enough_of(replace(job, surveys=()), parts, added):
        return task
    for step in range(CUTOFF_STEPS):
        wider = 2.0 ** (0.5 * step)
        choice = choice_at(task, task.choice.cutoff_hz * wider, wider) if step else task.choice
        if choice is None:
            return task
        here = replace(job, choice=choice, surveys=())
        try:
            rows = here.observed(job.records, turns=False, friction=added)
        except DataError:  # too short for the filter
            continue
        if step and not all(_told(model, block) for block in rows.blocks):
            continue  # what swings all the time is told by its reversals, at the cut-off of its motion
        if not lacks_samples(model, rows):
            why = ", which leaves too few samples apart from rests and reversals."
            return at_choice(task, choice, why) if step else task
    return task


def _enough_of(job: Job, parts: tuple[Record, ...], added: bool) -> bool:
    try:
        return not lacks_samples(job.model, job.observed(parts, turns=False, friction=added))
    except DataError:
        return False


def lacks_samples(model: Model, rows: Observation) -> bool:
    """Tell whether all rows, or each that holds a force, are left too few samples for their columns."""
    forces = {actuator.key for actuator in model.actuators}
    every, forced = 0, [0] * len(model.rows)
    for block in rows.blocks:
        told = _told(model, block)
        every += told
        if block.force_scale > 0.0 and channels_of_rows(model)[block.row] & forces:
            forced[block.row] += told
    enough = [SAMPLES_AN_UNKNOWN * len(columns) for columns in model.regressor_columns]
    few = every < SAMPLES_AN_UNKNOWN * len(rows.columns)
    return few or all(count < least for count, least in zip(forced, enough, strict=True))


def _told(model: Model, block: RowBlock) -> int:
    """Return how many samples tell what a row is for.

    Friction of two bodies in one row is told apart where one of them reverses before the other: there is
    none in samples that feel a reversal, whose directions are not known well enough for that.
    """
    return 0 if block.turning and len(direction_keys(model, block.row)) > 1 else block.count


def higher_cutoffs(task: Task, most: int) -> Iterator[Task]:
    """Yield a task at cut-offs above its own, so many at most; none if one is given."""
    for choice in choices_above(task, most):
        yield at_choice(task, choice, ", at which the records do not tell how far springs deflect.")


def choices_above(task: Task, most: int) -> Iterator[FilterChoice]:
    """Yield filters with cut-offs above a task's own, so many at most; none if one is given."""
    for number in range(1, 1 if task.filters.cutoff_hz is not None else most + 1):
        choice = choice_at(task, task.choice.cutoff_hz * 2.0 ** (0.5 * number))
        if choice is None:
            return
        yield choice


def at_choice(task: Task, choice: FilterChoice, why: str) -> Task:
    """Return a task with other filters, which say why."""
    front = f"Cut-off {choice.cutoff_hz:.4g} Hz in place of {task.choice.cutoff_hz:.4g} Hz"
    kept = tuple(one for one in choice.sentences if not one.startswith("Cut-off"))
    choice = replace(choice, bands=task.choice.bands, sentences=(f"{front}{why}", *kept))
    return replace(task, choice=choice, job=replace(task.job, choice=choice))


def choice_at(task: Task, cutoff_hz: float, wider: float = 1.0) -> FilterChoice | None:
    """Return the filters of a task with another cut-off, None where its records do not allow it.

    Directions are of a band so much wider than the task's, if that is below the cut-off.
    """
    wide_hz = cutoff_hz * (SIGNAL_CUTOFF if task.model.is_arm else 1.0)
    if cutoff_hz > task.choice.cutoff_hz and wide_hz > HIGHEST_CUTOFF * min(one.fs for one in task.records):
        return None
    filters, before = task.filters, task.choice
    choice = choose_filter(
        task.model,
        task.records,
        cutoff_hz=cutoff_hz,
        filter_order=before.filter_order,
        decimation=filters.decimation,
        direction_cutoff_hz=filters.direction_cutoff_hz,
        signal_cutoff_hz=filters.signal_cutoff_hz,
    )
    said = choice.sentences + blended_directions(before.sentences)
    choice = replace(choice, slow_speeds=before.slow_speeds, between=before.between, sentences=said)
    choice, directions_hz = replace(choice, directions=before.directions), before.direction_cutoff_hz * wider
    if not task.model.is_arm:
        directions_hz = min(directions_hz, cutoff_hz)
    if filters.direction_cutoff_hz or directions_hz <= choice.direction_cutoff_hz:
        return choice
    # bodies reverse as their motion says, however little of it the rows keep
    told = direction_sentence(directions_hz, given=False)
    said = tuple(told if one.startswith("Directions") else one for one in choice.sentences)
    return replace(choice, direction_cutoff_hz=directions_hz, sentences=said)
