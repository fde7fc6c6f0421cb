"""Directions of bodies from a simulation at the estimate, for rows that use samples near reversals.

Where every sample feels a reversal, and in least squares that takes the place of instruments, friction is
no sign of a low-passed velocity: that bends where friction jumps and turns late, and a body that sticks needs
less than its friction. A simulation with the estimate, kept close to the record, knows all of that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.explanation.explained import Begun, begun_at, run_method, with_note
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.thresholds import TURNED_ROUNDS
from modelgen.runtime.iv.companion_simulation import Loop, followed_closely, simulated_beside
from modelgen.runtime.iv.instrumental_variables import simulation_parameters
from modelgen.runtime.iv.physical.friction_rows import directions
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.given_directions import bodies_with_signs, signs_of_rows
from modelgen.runtime.simulation.plant import possible

SIMULATED = "directions near reversals are those of a simulation at the estimate"


def with_simulated_directions(begun: Begun) -> Begun:
    """Return instruments whose rows take directions near reversals from a simulation at the estimate.

    As they are where no row uses such samples, or where that leaves more unexplained.
    """
    task, found, fit = begun.task, begun, begun.found.fit
    signs = signs_of_rows(task.model)
    # rows that drop friction have it from a simulation already, made anew in every step
    if not any(block.turning and signs[block.row] for block in fit.blocks):
        return begun
    for _ in range(TURNED_ROUNDS):
        fit = found.found.fit
        try:
            job = directed(task.job, fit)
            job_from = replace(job, start=replace(fit, simulated=None))
            again = run_method(begun_at(replace(task, job=job_from), found), task.method)
        except (DataError, IdentifiabilityError):
            break
        if again.found.fit.columns != fit.columns or again.found.fit.misfit > fit.misfit:
            break
        found = replace(again, task=replace(again.task, job=job))
    return begun if found is begun else with_note(found, SIMULATED, found.found.drift)


def takes_directions(job: Job) -> bool:
    """Tell whether rows take directions from a simulation: whether they hold signs of speeds."""
    return bool(bodies_with_signs(job.model))


def directed(job: Job, fit: Fit) -> Job:
    """Return a job whose records bring the directions of bodies, of a simulation with a fit's parameters.

    Raises
    ------
    DataError
    IdentifiabilityError
        When the simulation fails.
    """
    late = {channel: delay for channel, delay, _ in fit.delays}
    values = possible(job.model, simulation_parameters(job.model, fit))
    return job.changed(
        partial(_with_directions, model=job.model, values=values, choice=job.choice, loop=job.loop, late=late)
    )


def _with_directions(
    records: tuple[Record, ...],
    model: Model,
    values: Mapping[str, float],
    choice: FilterChoice,
    loop: Loop | None,
    late: Mapping[str, float],
) -> tuple[Record, ...]:
    """Return records with the directions of bodies as channels, of a simulation with physical parameters."""
    found, bodies = [], bodies_with_signs(model)
    for record in records:
        on_time = advanced(record, late)
        one = simulated_beside(model, values, on_time, choice, loop)
        found.append(record.edited(directions(followed_closely(one, choice, loop), bodies, on_time)))
    return tuple(found)
