"""Where the direction of motion of a body comes from that has no position or velocity sensor.

A model that needs such a direction asks the record for a signal ``sign_BODY``. A record that does not bring
it can name a source instead: another sensor that moves with the body, a reference, or the body's own
accelerometer, integrated (the only integral in modelgen; its sign is all that is used). Without a source, a
body that positions and velocities give together (an encoder and a sensor of the deflection) takes that sum;
one with an accelerometer takes low frequencies, at which the chain moves as one, from the nearest sensor.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.model.chain_matrices import chain_matrices
from modelgen.runtime.model.link_couplings import couplings
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.records.thresholds import FILTER_ORDER, MOVES_AS_ONE, RIGID

# A channel, or (a sensor of another body, the accelerometer of the body itself), or sensors that give the
# body's motion together.
Source = tuple[str, ...]
BLENDED = "The direction of"  # begins the sentence about the latter


def wanted_directions(model: Model) -> tuple[str, ...]:
    """Return the directions (``sign_BODY``) that a model asks of its records."""
    brought = (s.key for s in model.signals if s.sensor is None and s.actuator is None)
    return tuple(key for key in brought if key not in model.loads)


def direction_problems(
    model: Model, records: Sequence[Record], sources: Mapping[str, Source]
) -> list[Problem]:
    """Return one problem per direction that is neither in a record nor given a source that is."""
    wanted = wanted_directions(model)
    problems = [missing_name("directions", "direction", key, wanted) for key in sources if key not in wanted]
    for record in records:
        for key in wanted:
            source = sources.get(key, ())
            for channel in source:
                if channel not in record.signals:
                    where = f"{record.name}: directions"
                    problems.append(missing_name(where, "channel", channel, record.signals))
            if not source and key not in record.signals:
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


def direction_sources(
    model: Model, records: Sequence[Record], named: Mapping[str, str], guess: bool, accelerated: bool
) -> tuple[dict[str, str], dict[str, Source]]:
    """Return guessed sources of the directions that records lack, and the sources of all directions.

    `named` are those that a user gives; a `guess` is enough where instruments simulate the motion of every
    body, and `accelerated` says whether those of two sensors may be taken.
    """
    summed = summed_sources(model, records, named)
    guessed = nearest_sources(model, records, {**named, **summed}) if guess else {}
    known: dict[str, Source] = {key: (channel,) for key, channel in {**named, **guessed}.items()} | summed
    felt: Mapping[str, Source] = accelerated_sources(model, records, known) if accelerated else {}
    return guessed, {**known, **felt}


def summed_sources(
    model: Model, records: Sequence[Record], sources: Mapping[str, str]
) -> dict[str, tuple[str, ...]]:
    """Return sources for directions of bodies that sensors of position or velocity give together, exactly."""
    wanted = [
        key
        for key in wanted_directions(model)
        if key not in sources and any(key not in record.signals for record in records)
    ]
    if model.is_arm or not wanted:
        return {}
    shares = {key: summed_shares(model, key.removeprefix("sign_")) for key in wanted}
    return {key: tuple(found) for key, found in shares.items() if found}


def summed_shares(model: Model, body: str) -> dict[str, float]:
    """Return sensors of position or velocity, with factors in SI, whose sum is a body's motion; or none."""
    bodies = chain_matrices(model).bodies
    directions = {one.body: 1 for one in model.friction}
    C = model.state_space(dict.fromkeys(model.every_parameter, 1.0), directions).C
    found = [(one, place) for place, one in enumerate(model.sensors) if one.order < 2]
    levers = np.array([C[place, one.order * len(bodies) :][: len(bodies)] for one, place in found])
    own = np.array([float(one == body) for one in bodies])
    if not len(levers):
        return {}
    shares = np.linalg.lstsq(levers.T, own, rcond=RIGID)[0]
    if np.max(np.abs(shares @ levers - own)) > RIGID:
        return {}
    limit = RIGID * np.max(np.abs(shares))
    named = zip(found, shares.tolist(), strict=True)
    return {one.key: share for (one, _), share in named if abs(share) > limit}


def nearest_sources(model: Model, records: Sequence[Record], sources: Container[str]) -> dict[str, str]:
    """Return sources for the directions that records lack and `sources` does not name: the nearest sensors.

    Enough to begin with where instruments simulate the motion of every body; on its own it is a guess.
    """
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
        for key in wanted_directions(model)
        if key not in sources and any(key not in record.signals for record in records)
    }


def accelerated_sources(
    model: Model, records: Sequence[Record], sources: Container[str]
) -> dict[str, tuple[str, str]]:
    """Return the same for bodies with an accelerometer: the nearest sensor, and that.

    Those of arms, and of springs to the ground, do not move as one with a sensor at low frequencies.
    """
    felt = {f"sign_{one.body}": one.key for one in model.sensors if one.body and one.order == 2}
    if model.is_arm or not felt or rigid_motion(model) is None:
        return {}
    nearest = nearest_sources(model, records, sources)
    return {key: (nearest[key], felt[key]) for key in nearest if key in felt}


def rigid_motion(model: Model) -> dict[str, float] | None:
    """Return how far bodies move where no spring deflects, by body; None where something is held."""
    chain = chain_matrices(model)
    links = [link for name in chain.stiffness for link in couplings(model, chain, name)]
    levers = np.array([link.lever(len(chain.bodies)) for link in links]).reshape(-1, len(chain.bodies))
    _, sizes, shapes = np.linalg.svd(levers)
    if np.count_nonzero(sizes > RIGID * sizes.max(initial=0.0)) != len(chain.bodies) - 1:
        return None
    return dict(zip(chain.bodies, shapes[-1].tolist(), strict=True))


def with_directions(
    model: Model, records: Sequence[Record], sources: Mapping[str, Source], cutoff_hz: float
) -> tuple[Record, ...]:
    """Return the records with the directions that their named sources give.

    Parameters
    ----------
    model : Model
    records : sequence of Record
    sources : mapping of str to tuple of str
        ``sign_BODY`` -> one channel or several. A position (and any channel that is no sensor of the model,
        such as a reference position) is differentiated once; a velocity is taken as it is; an acceleration is
        integrated from rest, its mean taken off: such a record should begin and end at the same velocity. Of
        a sensor of another body and the accelerometer of the body, the rigid motion of the first counts below
        `MOVES_AS_ONE` of the cut-off, and the integral of the second above. Other sensors give the motion of
        the body together, as `summed_shares` says.
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


def _extended(model: Model, record: Record, sources: Mapping[str, Source], cutoff_hz: float) -> Record:
    if not sources:
        return record
    speeds = {key: _speed(model, record, key, source, cutoff_hz) for key, source in sources.items()}
    return record.edited({key: np.sign(speed) for key, speed in speeds.items()})


def direction_sentences(model: Model, sources: Mapping[str, Source], cutoff_hz: float) -> tuple[str, ...]:
    """Say of which two sensors directions are; the cut-off for directions in Hz."""
    return tuple(
        f"{BLENDED} {key.removeprefix('sign_')} is that of {source[1]}, integrated, and below "
        f"{MOVES_AS_ONE * cutoff_hz:.4g} Hz that of {source[0]}."
        for key, source in sources.items()
        if _is_blended(model, source)
    )


def blended_directions(sentences: Sequence[str]) -> tuple[str, ...]:
    """Return those of some sentences that `direction_sentences` made."""
    return tuple(one for one in sentences if one.startswith(BLENDED))


def _is_blended(model: Model, source: Source) -> bool:
    """Tell whether a source is a sensor of another body and the body's own accelerometer."""
    return len(source) == 2 and any(one.key == source[1] and one.order == 2 for one in model.sensors)


def _speed(model: Model, record: Record, key: str, source: Source, cutoff_hz: float) -> FloatArray:
    """Return the velocity behind a direction, rad/s or m/s, shape (n,)."""
    if len(source) == 1 or _is_blended(model, source):
        return _velocity(model, record, source, cutoff_hz)
    shares = summed_shares(model, key.removeprefix("sign_"))
    speeds = (shares[one] * _velocity(model, record, (one,), cutoff_hz) for one in source)
    return np.asarray(sum(speeds))


def _velocity(model: Model, record: Record, source: Source, cutoff_hz: float) -> FloatArray:
    """Return a body's velocity, shape (n,), from a channel, or another body's and its accelerometer."""
    if len(source) == 2:
        bodies, ratios = {one.key: str(one.body) for one in model.sensors}, rigid_motion(model) or {}
        there, here = (ratios[bodies[channel]] for channel in source)
        slow, own = (_velocity(model, record, (channel,), cutoff_hz) for channel in source)
        low = zero_phase(here / there * slow - own, FILTER_ORDER, MOVES_AS_ONE * cutoff_hz, record.fs)
        return own + low
    (channel,) = source
    measures = {sensor.key: sensor.measures for sensor in model.sensors}.get(channel, "position")
    smooth = zero_phase(record.signals[channel], FILTER_ORDER, cutoff_hz, record.fs)
    if measures == "acceleration":
        steps = (smooth - smooth.mean()) * record.dt
        return np.asarray(np.concatenate([[0.0], np.cumsum(0.5 * (steps[1:] + steps[:-1]))]))
    return differentiate(smooth, record.dt, 0 if measures == "velocity" else 1)


def _example(model: Model) -> str:
    return model.sensors[0].key
