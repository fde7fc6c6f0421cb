"""What stretches of long records say of the model: effects that all of a record has, they have as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.identification.explain_residual import explained, found_by
from modelgen.runtime.identification.explained import Explained
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.identification.thresholds import SEARCHED, STRETCHES
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.freed_effects import fit_with_effects
from modelgen.runtime.iv.model_errors import zero_effect
from modelgen.runtime.records.record import Record


def explained_by_stretches(job: Job, method: IV, plain: Explained) -> Explained:
    """Return what stretches of long records show, on the whole of them.

    Effects are looked for in stretches, and estimated on all samples if there are any.
    """
    stretches = [_stretches(record) for record in job.records]
    parts = replace(job, records=tuple(part for one in stretches for part in one), surveys=())
    factors = tuple(factor for factor, one in zip(job.choice.decimation, stretches, strict=True) for _ in one)
    parts = replace(parts, choice=replace(job.choice, decimation=factors))
    try:
        observation, fit = method.run(parts)
    except (IdentifiabilityError, DataError):
        return plain
    told = explained(parts, found_by(parts, observation, fit), fit)
    if told.fit.columns != plain.fit.columns:
        return plain
    if not told.effects:
        return replace(plain, drift=told.drift, advice=told.advice)
    record_of = [index for index, one in enumerate(stretches) for _ in one]
    effects = _of_records(told.effects, record_of, len(job.records))
    try:
        freed = fit_with_effects(job.setting(), job.calm, plain.fit, effects)
    except (IdentifiabilityError, DataError):
        move = told.fit.solution.x - plain.fit.solution.x
        return replace(plain, drift=told.drift + np.outer(move, move), advice=told.advice)
    return Explained(freed.observation, freed.fit, effects, freed.sizes, told.drift, told.advice)


def _of_records(effects: tuple[Effect, ...], record_of: list[int], records: int) -> tuple[Effect, ...]:
    """Return effects of stretches as those of the records: a zero that a stretch has is its record's."""
    found: dict[str, Effect] = {}
    for effect in effects:
        if effect.record is not None:
            effect = zero_effect(effect.channel, record_of[effect.record], records)
        found[effect.name] = effect
    return tuple(found.values())


def _stretches(record: Record) -> tuple[Record, ...]:
    """Return a short record, or stretches spread over a long one."""
    if record.n <= SEARCHED:
        return (record,)
    length, gap = SEARCHED // STRETCHES, record.n // STRETCHES
    starts = [k * gap + (gap - length) // 2 for k in range(STRETCHES)]
    return tuple(record.part(start, start + length, f"{record.name} from sample {start}") for start in starts)
