"""Gains of forces: torque constants of drives and torque sensors that are not what they are said to be.

Links that several drives move say how large these forces are against each other. What all forces are too
large by is in every parameter, and no row shows it: where one gain is off by some percent, so may the others.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.runtime.identification.elastic.effect_rows import EffectRows
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.score_tests import Span
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.channels import Edit
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class ForceGain(Effect):
    """By which share a force is read larger than it is, in all records."""


def force_gains(model: Model) -> Iterator[ForceGain]:
    """Yield the gain of each force, where there are others to compare it with, and none is a parameter."""
    forces = [actuator.key for actuator in model.actuators]
    if len(forces) > 1 and not any(one.role == "gain" for one in model.roles.values()):
        for key in forces:
            words, remedy = (
                f"the gain of {key} is off",
                "measure the torque constant, or calibrate the sensor",
            )
            yield ForceGain(f"gain of {key}", "gain", words, words, remedy, lambda _: {}, key, _to_scale)


def _to_scale(key: str, size: float, record: Record) -> Edit:
    return Edit(key, lambda samples, start: samples / (1.0 + size))


def all_but_one(effects: Collection[Effect], model: Model) -> bool:
    """Tell whether gains of all forces but one are among the effects: that one is the scale of the others."""
    return sum(isinstance(one, ForceGain) for one in effects) + 1 >= len(model.actuators)


def common_scale(rows: EffectRows, known: Mapping[Effect, float]) -> Iterator[Mapping[str, float]]:
    """Yield by what X may be off, in SI, by column, as all forces may be too large besides.

    One gain is off, or all others are the other way. So forces are known to the rms of what gains are off by.
    """
    off = [size for one, size in known.items() if isinstance(one, ForceGain)]
    if not off:
        return
    fit = rows.solved([one for one in known if not isinstance(one, ForceGain)])
    gains: Sequence[Effect] = [one for one in rows.effects if isinstance(one, ForceGain)]
    gains = [*gains, *(one for one in known if isinstance(one, ForceGain) and one not in gains)]
    share = Span(fit).compared(rows.grown(fit, gains), fit.weighted_residual).share
    moves = np.sum(share, axis=1) * (np.linalg.norm(off) / np.sqrt(len(rows.job.model.actuators)))
    yield dict(zip(fit.columns, moves.tolist(), strict=True))
