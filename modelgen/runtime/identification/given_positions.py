"""Where rows hold positions that other rows give: the point about which they are linear, by Gauss and Newton.

Every step is a weighted least-squares fit of rows that are made about the last one's estimate; links and
drives are solved for anew each time, so that only the springs need a start. Where the file of the arm brings
values those are tried, and deflections of so many parts of the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import step
from modelgen.runtime.diagnostics.noise_bias import less_noise
from modelgen.runtime.identification.contradiction import impossible
from modelgen.runtime.identification.cutoffs.cutoff_steps import higher_cutoffs
from modelgen.runtime.identification.elastic.likely_places import StartedSprings, explains
from modelgen.runtime.identification.elastic.other_springs import other_springs
from modelgen.runtime.identification.elastic.rest import Drifting, Rest, rested
from modelgen.runtime.identification.elastic.settling import settled_with
from modelgen.runtime.identification.elastic.steps_about import OpenRest, left_by, rest_with_forces_open
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import run_wls
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import (
    AS_LIKELY,
    BETTER_PLACES,
    CUTOFFS_WITHOUT_ESTIMATE,
    FEWEST_SCATTERED,
    MORE_STEPS,
    TOLD_APART,
)
from modelgen.runtime.least_squares.delays import with_holds
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.deflected_kernel import DeflectedKernel
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.left_open.uncertain_turns import leaves_turns_open


def about_the_estimate(task: Task) -> tuple[Task, Drifting | None]:
    """Return the task with rows that are linear about their estimate, and where that rests.

    The same task, and None, where rows are linear. Where no start leads to an estimate, or the records are
    too short, higher cut-offs are tried unless one is given: slow motion has little below the first one.
    Where none leads anywhere, rows that leave no force open are tried; then rows without given positions are
    left, if there are any.

    Raises
    ------
    DataError
        If the records are too short at every cut-off.
    IdentifiabilityError
        If no start leads to an estimate, the steps do not come to rest, and all rows hold given positions.
    """
    kernel = task.model.kernel
    if not isinstance(kernel, DeflectedKernel):
        return task, None
    step("finding how far springs deflect")
    short: DataError | None = None
    # where friction reverses all the time, rows that leave it open may hold nothing of the springs
    tasks = [task]
    if leaves_turns_open(task.model):
        tasks.append(replace(task, job=replace(task.job, leave_open=False)))
    for one in chain.from_iterable(chain([at], higher_cutoffs(at, CUTOFFS_WITHOUT_ESTIMATE)) for at in tasks):
        try:
            found = _about(one, kernel)
        except DataError as error:
            short = short or error
            continue
        if found is not None:
            return found if found[1].told else _told_higher(*found, kernel)
    if short is not None:
        raise short
    if len(kernel.rows) < len(task.model.rows):
        model = rows_without(task.model, kernel)
        return replace(task, model=model, job=replace(task.job, model=model, rows_for_tag=None)), None
    names = ", ".join(record.name for record in task.records)
    raise IdentifiabilityError.at(
        names,
        "does not tell how far the springs deflect: no stiffness that was tried led to an estimate",
        "move faster, towards the modes of the arm, give near values as a parameter set, or add encoders on "
        "links",
    )


def _told_higher(task: Task, rest: Rest, kernel: DeflectedKernel) -> tuple[Task, Rest]:
    """Return where rows of a higher cut-off that tell every spring rest, near a place that does not, or that.

    All is to be known better there: what one spring gains may cost all other parameters more.
    """
    for one in higher_cutoffs(task, CUTOFFS_WITHOUT_ESTIMATE):
        with suppress(DataError):
            found = _at_rest(one, _on_time(one), kernel, (rest.point,), others=False)
            if (
                found is not None
                and found[1].told
                and _misfit(found[0])[1]
                and _digits(found[0]) > _digits(task)
            ):
                return found[0], replace(found[1], held=rest.held)
    return task, rest


def _digits(task: Task) -> float:
    """Return how well rows about a place know parameters, less what noise does to them, a mean logarithm."""
    model, job = task.model, _on_time(task)
    fit = less_noise(model, job.records, job.choice, run_wls(job)[1])[0]
    return -0.5 * float(np.mean(np.log(np.maximum(np.diag(hac_covariance(fit)), np.finfo(float).tiny))))


def near_by(task: Task) -> Task | None:
    """Return the task of changed records about their estimate, from where it was before."""
    kernel = task.model.kernel
    found = _from_point(task, kernel, others=False) if isinstance(kernel, DeflectedKernel) else (task, None)
    return found and found[0]


def about_from_near_by(task: Task) -> tuple[Task, Drifting | None]:
    """Return `about_the_estimate` of changed records, whose estimate was near by before.

    Raises as that does: where nothing near by holds, it starts anew.
    """
    kernel = task.model.kernel
    found = _from_point(task, kernel, others=True) if isinstance(kernel, DeflectedKernel) else None
    return found or about_the_estimate(task)


def _from_point(task: Task, kernel: DeflectedKernel, others: bool) -> tuple[Task, Rest] | None:
    return _at_rest(task, _on_time(task), kernel, (kernel.point,), others)


def _about(task: Task, kernel: DeflectedKernel) -> tuple[Task, Rest] | None:
    """Return the task about its estimate, and where that rests; None where no start leads there.

    Half a sample of a command that a drive holds hides the springs of motors that no sensor sees: where rows
    of held commands are clearly more likely, the task is of those. Where rows tell neither, what the estimate
    moves by is in its deviations. Where steps of one of them do not rest both are compared near the other's
    place, of rows that leave no force open: that they do not rest says nothing of commands.
    """
    if not task.sets_channels_right:
        return _searched(task, StartedSprings(_on_time(task), kernel))
    # others need not load it
    from modelgen.runtime.identification.elastic.channel_errors import forces_of_drives

    drives = forces_of_drives(task.model)
    with_held = task.changed(partial(with_holds, channels=drives))
    plain, held = _with_and_without_holds(task, with_held, kernel)
    if (found := plain or held) is None:
        return None
    if plain is None or held is None:
        # steps need not rest where rows leave other samples open with every one of them
        tasks = [replace(one, job=replace(one.job, leave_open=False)) for one in (task, with_held)]
        near = [_at_rest(one, _on_time(one), kernel, (found[1].point,)) for one in tasks]
        of_held = found is held
        plain, held = near
        if plain is None or held is None or _behind(plain, held)[1] == of_held:
            return (found[0], replace(found[1], held=drives)) if of_held else found
    behind, clearly = _behind(plain, held)
    if clearly:
        return held[0], replace(held[1], held=drives)
    beyond = (held[1].point - plain[1].point,) if behind > -AS_LIKELY else ()
    return plain[0], replace(plain[1], beyond=(*plain[1].beyond, *beyond))


def _behind(plain: tuple[Task, Rest], held: tuple[Task, Rest]) -> tuple[float, bool]:
    """Return by how much rows without holds are less likely, and whether clearly, or of fewer springs."""
    behind = _misfit(plain[0])[0] - _misfit(held[0])[0]
    return behind, behind > AS_LIKELY * (1.0 if plain[1].told or not held[1].told else -1.0)


def _with_and_without_holds(
    task: Task, held: Task, kernel: DeflectedKernel
) -> tuple[tuple[Task, Rest] | None, tuple[Task, Rest] | None]:
    """Return two tasks of the same records about their estimates, and where these rest.

    The more starts take long, and are of use where neither is explained without.
    """
    of_task, of_held = (StartedSprings(_on_time(one), kernel) for one in (task, held))
    plain = _searched(task, of_task, scattered=False)
    if plain is not None and _explained(*plain, kernel):
        near = _at_rest(held, of_held.job, kernel, (plain[1].point,), others=False)
        return plain, near or _searched(held, of_held, scattered=False)
    other = _searched(held, of_held, scattered=False)
    if len(kernel.giving) < FEWEST_SCATTERED or (other is not None and _explained(*other, kernel)):
        return plain, other
    return _searched(task, of_task), _searched(held, of_held)


def _explained(task: Task, rest: Rest, kernel: DeflectedKernel) -> bool:
    return explains(_on_time(task), kernel, rest.point) and _misfit(task)[1]


def _misfit(task: Task) -> tuple[float, bool]:
    """Return the logarithm of how unlikely rows about a place are, less a constant, and whether an arm is.

    With links of negative inertia rows of another place are explained as well: it is less likely by what
    tells places apart, and by no more, as rows that leave more hide a sign. What is noise says nothing.
    """
    model, job = task.model, _on_time(task)
    fit = run_wls(job)[1]
    none = impossible(model, fit) and impossible(model, less_noise(model, job.records, job.choice, fit)[0])
    return fit.count * left_by(fit) + TOLD_APART * none, not none


def _searched(task: Task, search: StartedSprings, scattered: bool = True) -> tuple[Task, Rest] | None:
    """Return the task about where steps from many starts rest, and that; None where they rest nowhere.

    Directions of motors that no sensor sees are off where springs are: rows with all forces then lead to
    links of negative inertia, and rows that leave forces open to the place.
    """
    job, kernel = search.job, search.kernel
    opened = search.with_forces_open if kernel.speeds else None
    if opened is not None and opened.told and (not scattered or explains(job, kernel, opened.point)):
        return _about_rest(task, kernel, _opened(opened))
    found = _at_rest(task, job, kernel, search.places(scattered))
    if opened is None or opened.told:
        return found
    return _likelier(found, _about_rest(task, kernel, _opened(opened)))


def _opened(at: OpenRest) -> Rest:
    return Rest(at.point, np.zeros(len(at.point)), 0.0, told=at.told)


def _likelier(found: tuple[Task, Rest] | None, untold: tuple[Task, Rest]) -> tuple[Task, Rest]:
    """Return what was found, unless a place that tells not every spring is clearly more likely.

    Steps of rows that hold all forces ended at another place then, where they tell a wrong one.
    """
    if found is None or _misfit(untold[0])[0] < _misfit(found[0])[0] - AS_LIKELY:
        return untold
    return found


def _on_time(task: Task) -> Job:
    """Return the job of the task, without delays to be estimated."""
    return replace(task.job, late=(), rows_for_tag=None)


def _at_rest(
    task: Task, job: Job, kernel: DeflectedKernel, points: Sequence[FloatArray], others: bool = True
) -> tuple[Task, Rest] | None:
    """Return the task about where steps from some points rest, and that; springs elsewhere with `others`."""
    opened = rest_with_forces_open(job, kernel, points) if kernel.speeds else None
    found = _opened(opened) if opened is not None and opened.told else None
    for point in points:
        found = found or rested(job, kernel, point)
    if found is not None and kernel.motors_alone and others:
        found = _among_others(job, kernel, found)
    if found is not None and kernel.speeds and (opened is None or not opened.told):
        anyway = rest_with_forces_open(job, kernel, (found.point,), anyway=True)
        found = found if anyway is None else replace(found, point=anyway.point)
    told = None if found is None else _about_rest(task, kernel, found)
    if opened is None or opened.told:
        return told
    return _likelier(told, _about_rest(task, kernel, _opened(opened)))


def _about_rest(task: Task, kernel: DeflectedKernel, rest: Rest) -> tuple[Task, Rest]:
    model = replace(task.model, kernel=kernel.at(rest.point, sampled=True))
    return replace(task, model=model, job=replace(task.job, model=model)), rest


def _among_others(job: Job, kernel: DeflectedKernel, found: Rest) -> Rest:
    """Return a place of rest, or a more likely one that springs held elsewhere lead to; how sure it is."""
    for _ in range(BETTER_PLACES):
        better, beyond = other_springs(job, kernel, found.point)
        place = None if better is None else settled_with(job, kernel, better, (), MORE_STEPS)
        rest = None if place is None else rested(job, kernel, place.point)
        if rest is None:
            break
        found = rest
    return replace(found, beyond=beyond)


def rows_without(model: Model, kernel: DeflectedKernel) -> Model:
    """Return the model with the rows only that hold no given position."""
    left = [row for row in range(len(model.rows)) if row not in kernel.rows]
    inner = kernel.inner
    return replace(
        model,
        rows=tuple(model.rows[row] for row in left),
        measurement_columns=tuple(model.measurement_columns[row] for row in left),
        regressor_columns=tuple(model.regressor_columns[row] for row in left),
        kernel=inner if inner.keys else None,
    )
