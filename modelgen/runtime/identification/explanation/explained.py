"""Explained: a fit with what its residual shows; least squares has one as well, which holds nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.advice import Advice, noted
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.identification.methods import Method
from modelgen.runtime.identification.task import Task
from modelgen.runtime.identification.thresholds import LEFT_SHARE, OVER_NOISE, ZERO_APART
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.observation import Observation

if TYPE_CHECKING:
    from modelgen.runtime.identification.explanation.drive_noise import DriveBias
    from modelgen.runtime.identification.job import Job
    from modelgen.runtime.iv.effect import Effect
    from modelgen.runtime.iv.score_tests import Score


NOTHING: Mapping[str, Sequence[tuple[Effect, float]]] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class Shown:
    """What a residual shows that may be estimated, with its size.

    A low-pass may look like a command that is held: it is estimated where it is known what is held, and where
    nothing but noise is left with it.
    """

    effect: Effect
    size: float
    like_a_hold: bool = False


@dataclass(frozen=True, eq=False)
class Explained:
    """A fit with what its residual shows taken into account.

    Attributes
    ----------
    observation : Observation
    fit : Fit
    effects : tuple of Effect
        Estimated with the parameters; `sizes` are theirs.
    drift : array, shape (c, c)
        Mean square of what other effects would move.
    advice : tuple of Advice
    held : Score, optional
        Of an effect in `drift` that is likely and not certain: more samples may know better.
    unsolved : array, shape (c, c), or 0
        The part of `drift` that is of effects: held and not estimated, or what else could stand for them. It
        is a matter of what is recorded, whichever way that is fitted.
    shown : tuple of Shown
        What the residual of a fit in physical parameters shows of what can be estimated.
    """

    observation: Observation
    fit: Fit
    effects: tuple[Effect, ...]
    sizes: tuple[float, ...]
    drift: FloatArray
    advice: tuple[Advice, ...]
    held: Score | None = None
    unsolved: FloatArray | float = 0.0
    shown: tuple[Shown, ...] = ()


@dataclass(frozen=True, eq=False)
class Begun:
    """A task whose method has been run: rows and their fit, and what the residual says.

    `driven` is what noise of the forces shifts that fit by, where it was asked for.
    """

    task: Task
    found: Explained
    driven: DriveBias | None = None


def run_method(task: Task, method: Method) -> Begun:
    """Return a task with a method run, and nothing looked for."""
    observation, fit = method.run(task.job)
    none = np.zeros((len(fit.columns),) * 2)
    return Begun(replace(task, method=method), Explained(observation, fit, (), (), none, ()))


def begun_at(task: Task, known: Begun) -> Task:
    """Return a task that begins where an estimate in physical parameters ended, if it is in these."""
    fit = known.found.fit
    if fit.carried is None or fit.unknown:
        return task
    delays, begin = delays_of(known), fit.physical(task.model.parameters)
    return replace(task, job=replace(task.job, begin=begin, known_delays=delays))


def begun_with(task: Task, found: Explained) -> Begun:
    """Return a task with what was found, whose effects are estimated with other filters as well."""
    job = replace(task.job, effects=found.effects, sizes=found.sizes)
    return Begun(replace(task, job=job), found)


def with_carried_effects(
    job: Job, found: Explained, others: Mapping[str, Sequence[tuple[Effect, float]]] = NOTHING
) -> Explained:
    """Return a fit in physical parameters with the effects that were estimated with these, if any were.

    `others` are what explains as much as one of them, by its name.
    """
    from modelgen.runtime.iv.told_effects import estimated

    carried = found.fit.carried
    if carried is None or not carried.sizes or found.effects:
        return found
    known = [size if one.edit else 0.0 for one, size in zip(job.effects, job.all_sizes, strict=True)]
    sizes = tuple(size + more for size, (more, _) in zip(known, carried.sizes, strict=True))
    told = tuple(
        estimated(effect, size, others.get(effect.name, ()))
        for effect, size, (_, std) in zip(job.effects, sizes, carried.sizes, strict=True)
        if effect.words and abs(size) > ZERO_APART * std
    )
    return replace(found, effects=job.effects, sizes=sizes, advice=(*told, *found.advice))


def with_note(one: Begun, note: str, drift: FloatArray | None = None) -> Begun:
    """Return what has begun with a further note in front, and with a drift, in SI, shape (c, c), if given."""
    found = one.found
    fit = replace(found.fit, notes=(note, *found.fit.notes))
    return replace(one, found=replace(found, fit=fit, drift=found.drift if drift is None else drift))


def late_forces(begun: Begun) -> dict[str, float]:
    """Return by how many s forces are late whose delay was to be found, and was; nothing if fs differ."""
    if len({record.fs for record in begun.task.records}) > 1:
        return {}
    delays, unknown = delays_of(begun), begun.found.fit.unknown
    return {key: delays[key] for key in begun.task.job.late if key in delays and key not in unknown}


def delays_of(begun: Begun) -> dict[str, float]:
    """Return by how many s each channel was found to be late."""
    found = begun.found
    delays = {channel: delay for channel, delay, _ in found.fit.delays}
    return delays | {
        effect.channel: size
        for effect, size in zip(found.effects, found.sizes, strict=True)
        if effect.kind == "delay"
    }


def exceeding(one: Begun, share: float = 0.0, multiple: float = OVER_NOISE) -> bool:
    """Tell whether a row leaves clearly more than noise, and more than that share of its largest term."""
    job = one.task.job
    return bool(exceeding_noise(job.model, job.records, job.choice, one.found.fit, multiple, share))


def unexplained(one: Begun) -> bool:
    """Tell whether noise does not explain a row that is left, or what is left where an effect is told."""
    return bool(exceeding(one, LEFT_SHARE) or (noted(one.found.advice)[0] and exceeding(one)))


def slope_of(model: Model, fit: Fit) -> FloatArray | None:
    """Return how columns grow with the physical parameters, in SI, where these were fitted, shape (c, p)."""
    values = fit.physical(model.parameters)
    if values is None:
        return None
    places = [model.base_parameters.index(name) for name in fit.columns]
    return model.base_jacobian(values)[places]
