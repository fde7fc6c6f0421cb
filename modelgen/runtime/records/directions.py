"""Where the direction of motion of a body comes from that has no position or velocity sensor.

A model that needs such a direction asks the record for a signal ``sign_BODY``. A record that does not bring
it can name a source instead: another sensor that moves with the body, a reference, or the body's own
accelerometer, integrated (the only integral in modelgen; its sign is all that is used).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.records.thresholds import FILTER_ORDER


def wanted_directions(model: Model) -> tuple[str, ...]:
    """Return the directions (``sign_BODY``) that a model asks of its records."""
    brought = (s.key for s in model.signals if s.sensor is None and s.actuator is None)
    return tuple(key for key in brought if key not in model.loads)


def direction_problems(model: Model, records: Sequence[Record], sources: Mapping[str, str]) -> list[Problem]:
    """Return one problem per direction that is neither in a record nor given a source that is."""
    wanted = wanted_directions(model)
    problems = [missing_name("directions", "direction", key, wanted) for key in sources if key not in wanted]
    for record in records:
        for key in wanted:
            source = sources.get(key)
            if source is not None and source not in record.signals:
                problems.append(missing_name(f"{record.name}: directions", "channel", source, record.signals))
            elif source is None and key not in record.signals:
                problems.append(_unknown(f"{record.name}: channel {key}", key, model))
    return problems


def _unknown(where: str, key: str, model: Model) -> Problem:
    body = key.removeprefix("sign_")
    return Problem(
        where,
        f"is missing: {body} has Coulomb friction in the spec, which needs the direction in which {body} "
        "moves, and no sensor gives that",
        f"name a channel that moves with {body} (a sensor, a reference position, or the accelerometer of "
        f"{body}), for example --direction {key}={_example(model)}, or leave that friction out of the spec",
    )


def nearest_sources(model: Model, records: Sequence[Record], sources: Mapping[str, str]) -> dict[str, str]:
    """Return sources for the directions that records lack and `sources` does not name: the nearest sensors.

    Enough to begin with where instruments simulate the motion of every body; on its own it is a guess.
    """
    lacking = [
        key
        for key in wanted_directions(model)
        if key not in sources and any(key not in record.signals for record in records)
    ]
    moving = [sensor for sensor in model.sensors if sensor.body and sensor.order < 2]
    links = [set(role.bodies) for role in model.roles.values() if role.role == "stiffness"]

    def far(seen: str, body: str) -> int:
        reached, steps = {body}, 0
        while seen not in reached and steps <= len(links):
            reached = reached.union(*(link for link in links if link & reached))
            steps += 1
        return steps

    if not moving:
        return {}
    return {
        key: min(moving, key=lambda one: (far(str(one.body), key.removeprefix("sign_")), one.order)).key
        for key in lacking
    }


def with_directions(
    model: Model, records: Sequence[Record], sources: Mapping[str, str], cutoff_hz: float
) -> tuple[Record, ...]:
    """Return the records with the directions that their named sources give.

    Parameters
    ----------
    model : Model
    records : sequence of Record
    sources : mapping of str to str
        ``sign_BODY`` -> channel. A position (and any channel that is no sensor of the model, such as a
        reference position) is differentiated once; a velocity is taken as it is; an acceleration is
        integrated from rest, its mean taken off: such a record should begin and end at the same velocity.
    cutoff_hz : float
        Low-pass in front of the sign, in Hz.

    Raises
    ------
    DataError
        When a source is no channel of a record.
    """
    problems = direction_problems(model, records, sources)
    DataError.raise_any(problems)
    return tuple(_extended(model, record, sources, cutoff_hz) for record in records)


def _extended(model: Model, record: Record, sources: Mapping[str, str], cutoff_hz: float) -> Record:
    if not sources:
        return record
    found = {key: np.sign(_velocity(model, record, channel, cutoff_hz)) for key, channel in sources.items()}
    return record.edited(found)


def _velocity(model: Model, record: Record, channel: str, cutoff_hz: float) -> FloatArray:
    measures = {sensor.key: sensor.measures for sensor in model.sensors}.get(channel, "position")
    smooth = zero_phase(record.signals[channel], FILTER_ORDER, cutoff_hz, record.fs)
    if measures == "acceleration":
        steps = (smooth - smooth.mean()) * record.dt
        return np.asarray(np.concatenate([[0.0], np.cumsum(0.5 * (steps[1:] + steps[:-1]))]))
    return differentiate(smooth, record.dt, 0 if measures == "velocity" else 1)


def _example(model: Model) -> str:
    return model.sensors[0].key
