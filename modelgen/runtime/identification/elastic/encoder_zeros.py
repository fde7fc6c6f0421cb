"""Zeros of encoders that read a deflection, and of joint torques: always estimated, said where certain.

Motor and link of a joint have encoders of their own, and these begin anywhere: every record of a machine
has a zero between them. Times a stiffness it is a constant force of the link. Gravity takes that up where it
is not free: half a step of an encoder moved first moments by 6 to 17 deviations, and no residual showed it.

Strain gauges begin anywhere as well. What a drive gives less what is measured behind it is friction and an
offset, which takes up the zero: 0.5 N m moved it by 38 deviations, and was told as a zero of an encoder.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields

import numpy as np

from modelgen.runtime.identification.elastic.link_forces import link_readings
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.model_errors import zero_effect
from modelgen.runtime.model.arm_channels import DRIVE
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record


@dataclass(frozen=True, eq=False)
class EncoderZero(Effect):
    """What an encoder, or a sensor of torque, reads in one record where the spring is not deflected."""


def encoder_zeros(model: Model, records: int) -> Iterator[EncoderZero]:
    """Yield the zero in each of so many records of each sensor that says how far, or how much, springs bend.

    Where encoders read a joint on both sides it is that of the motor's: the zero of the link's is the arm's.
    """
    levels = {signal.channel for signal in model.signals if signal.derivative == 0}
    for key in sorted(levels.intersection((*deflecting(model), *joint_torques(model)))):
        for record in range(records):
            zero = zero_effect(key, record, records)
            own = {one.name: getattr(zero, one.name) for one in fields(Effect)}
            # one sentence for all records
            yield EncoderZero(**own | dict.fromkeys(("words", "negative"), f"{key} has a zero of its own"))


def joint_torques(model: Model) -> tuple[str, ...]:
    """Return the channels of sensors of torques between motor and link."""
    return tuple(one.key for one in model.actuators if not one.key.startswith(DRIVE))


def deflecting(model: Model) -> tuple[str, ...]:
    """Return the channels of encoders that read a deflection, or a motor whose link has one as well."""
    read = [one for one in model.sensors if one.measures == "position" and one.key in model.channels]
    bodies = {one.body for one in read if one.body}
    motors = {f"{body} motor" for body in bodies}
    return tuple(one.key for one in read if one.deflection is not None or one.body in motors)


def of_other_records(sizes: Mapping[Effect, float]) -> dict[Effect, float]:
    """Return sizes for records of the same machine: zeros that records have of their own are their mean.

    Encoders that know their place begin alike in all records; of others nothing is known.
    """
    zeros: dict[str, list[float]] = {}
    for effect, size in sizes.items():
        if isinstance(effect, EncoderZero):
            zeros.setdefault(effect.channel, []).append(size)
    others = {effect: size for effect, size in sizes.items() if not isinstance(effect, EncoderZero)}
    return others | {zero_effect(key, None, 1): sum(every) / len(every) for key, every in zeros.items()}


def zeros_at_mean(model: Model, record: Record, index: int, records: int) -> dict[Effect, float]:
    """Return zeros that leave springs undeflected on average, of the `index`-th of so many records.

    What is left is the mean force over the stiffness. Beside a zero of many deflections least squares has
    next to no stiffness, and what a zero does is not to be seen at that.
    """
    keys, reads = deflecting(model), link_readings(model)
    others = [key for key in reads if key not in keys and key in record.signals]
    mean = {key: float(np.mean(record.signals[key])) for key in (*keys, *others)}
    # motors stand where their links do
    tied = {key: read.reshape(2, -1).sum(axis=0) for key, read in reads.items()}
    if not others:
        return {}
    links = np.linalg.pinv([tied[key] for key in others]) @ [mean[key] for key in others]
    return {
        zero_effect(key, index, records): mean[key] - float(tied[key] @ links) for key in keys if key in tied
    }
