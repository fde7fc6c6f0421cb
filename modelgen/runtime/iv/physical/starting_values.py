"""Where a fit of physical parameters begins: at the least-squares fit's, or at an output-error fit's.

Noise in high derivatives may bias the composites so far that a body vanishes from them; no iteration finds
back from there. The comparison of simulated with measured motion has no such bias, but costs more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import pi

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import IdentifiabilityError, ModelgenError
from modelgen.runtime.filters.derivatives import differentiate
from modelgen.runtime.filters.zero_phase import zero_phase
from modelgen.runtime.iv.divergence import diverged
from modelgen.runtime.iv.held_motion import nearest_sensor
from modelgen.runtime.iv.instrumental_variables import Setting, simulation_parameters
from modelgen.runtime.iv.output_error import fit_response
from modelgen.runtime.iv.thresholds import (
    EDGE,
    LEAST_SHARE,
    NEAR_ENOUGH,
    START_SAMPLES,
    START_STRETCHES,
    TRIED_DAMPING,
    TRIED_FREQUENCY,
    TRIED_SHARES,
)
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance, printed_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import parameters_of
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import vibration
from modelgen.runtime.simulation.plant import Plant, make_plant, possible

# A body with less than this share of the inertia that the actuator feels has vanished.
MOVING = ("inertia", "stiffness", "damping")


def physical_starts(
    first: Fit, setting: Setting, near: Mapping[str, float] | None = None
) -> Iterator[Mapping[str, float]]:
    """Yield physical parameters (SI) to start from, the cheapest first.

    Parameters
    ----------
    first : Fit
        Least squares, in base columns.
    setting : Setting
        Model, records and filters.
    near : mapping of str to float, optional
        `near_composites` of these, where that is known.
    """
    model = setting.model
    found = near_composites(model, first) if near is None else near
    vanished = vanished_names(model, found)
    if not vanished:
        yield found
    # noise makes the composites inconsistent, and which chain fits them best depends on their weights
    other = near_composites(model, first, lambda fit: printed_covariance(fit)[1])
    if not vanished_names(model, other):
        yield other
    for share in TRIED_SHARES:
        nearest = _nearest(setting, found, vanished, share)
        if nearest is not None:
            yield nearest
    if vanished and all(np.isfinite(list(found.values()))):
        yield found


def cheap_starts(near: Mapping[str, float], setting: Setting) -> tuple[Mapping[str, float], ...]:
    """Return sets of physical parameters (SI) that nature may have, near composites or tried for the record.

    Parameters are as for `physical_starts`.
    """
    model = setting.model
    every = parameters_of(model, *MOVING)
    none = dict.fromkeys(model.parameters, 0.0)
    try:
        tried = [_with_tried(setting, none, every, share) for share in TRIED_SHARES]
    except ModelgenError:
        return ()
    found = [near, *tried]
    return tuple(
        {name: one[name] if one[name] > 0.0 or name not in every else tried[0][name] for name in one}
        for one in found
        if np.all(np.isfinite(list(one.values())))
    )


def near_composites(
    model: Model, first: Fit, covariance_of: Callable[[Fit], FloatArray] | None = None
) -> dict[str, float]:
    """Return the parameters, in SI, that come closest to the composites, zeros if there are none.

    `covariance_of` weighs the composites, shape (c, c); `hac_covariance` by default.
    """
    try:
        return with_shared_friction(
            model, simulation_parameters(model, first, covariance_of or hac_covariance)
        )
    except IdentifiabilityError:
        return dict.fromkeys(model.parameters, 0.0)


def with_shared_friction(model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values with the sum of all Coulomb friction shared, where rows tell little but that sum.

    Bodies that move as one have the same direction; their friction comes out of any size then, of both signs.
    """
    names = [name for name, role in model.roles.items() if role.role == "coulomb" and name in values]
    if min((values[name] for name in names), default=0.0) >= 0.0:
        return dict(values)
    each = max(sum(values[name] for name in names), 0.0) / len(names)
    return {**values, **dict.fromkeys(names, each)}


def _nearest(
    setting: Setting, values: Mapping[str, float], vanished: tuple[str, ...], share: float
) -> Mapping[str, float] | None:
    """Return the parameters whose simulated motion comes closest to the records, None if there are none."""
    try:
        tried = _with_tried(setting, values, vanished, share)
        # a trial far off may leave the range of numbers; the search turns back there
        with np.errstate(over="ignore", invalid="ignore"):
            response = fit_response(setting.model, _stretches(setting.records), tried, NEAR_ENOUGH)
    except ModelgenError:
        return None
    return dict(zip(response.names, response.values.tolist(), strict=True))


def _stretches(records: Sequence[Record]) -> list[Record]:
    """Return stretches spread evenly over long records: each trial simulates, and a start may be rough.

    A sweep shows every frequency so, a step every speed.
    """
    count = sum(record.n for record in records)
    if count <= START_STRETCHES * START_SAMPLES:
        return list(records)
    found = []
    for record in records:
        parts = max(1, round(START_STRETCHES * record.n / count))
        length = min(record.n, START_SAMPLES)
        for start in np.linspace(0, record.n - length, parts + 2)[1:-1].astype(int).tolist():
            found.append(record.part(start, start + length, f"{record.name}, sample {start} on"))
    return found


def vanished_names(model: Model, values: Mapping[str, float]) -> tuple[str, ...]:
    """Return inertias that are next to nothing, seen from the actuator, and all of their bodies and links.

    And what is below zero: but for damping, of which a light one may come out so by chance.
    """
    moved = possible(model, values)
    try:
        plant = make_plant(model, moved)
        felt = plant.inertia * vibration(plant).lowest ** 2
    except ModelgenError:
        return parameters_of(model, *MOVING)
    gone = {
        body for body, inertia in zip(plant.bodies, felt, strict=True) if inertia < LEAST_SHARE * felt.sum()
    }
    below = {name for name in moved if moved[name] != values[name] and model.roles[name].role != "damping"}
    return tuple(
        name
        for name in parameters_of(model, *MOVING)
        if name in below or gone.intersection(model.roles[name].bodies)
    )


def refuse_emptied(model: Model, first: FloatArray, p: FloatArray, lost: Sequence[str], fit: Fit) -> None:
    """Raise the error of steps that leave next to nothing of a body that sensors show, and know none of it.

    Nothing solves the balance of a body that no actuator pushes, too, and a fit that ends there is that of a
    rigid chain: what it has for the motor's inertia is all of it, with the small deviation of that.

    Parameters
    ----------
    model : Model
    first, p : array, shape (parameters,)
        Where the steps began, and where they came to rest, in SI. What is next to nothing at first is small.
    lost : sequence of str
        What is not known at p.
    fit : Fit
        The rows there.

    Raises
    ------
    IdentifiabilityError
    """
    before, after = (dict(zip(model.parameters, one.tolist(), strict=True)) for one in (first, p))
    small, sensed = vanished_names(model, before), {sensor.body for sensor in model.sensors}
    inertias = [name for name in lost if name in model.roles and model.roles[name].role == "inertia"]
    gone = [name for name in vanished_names(model, after) if name in inertias and name not in small]
    bodies = [body for name in gone for body in model.roles[name].bodies if body in sensed]
    if bodies:
        what = f"all parameters of {', '.join(bodies)} go to zero, which solves a balance without a force"
        raise diverged(what, fit, model)


def _with_tried(
    setting: Setting, values: Mapping[str, float], vanished: tuple[str, ...], share: float
) -> dict[str, float]:
    """Return the values with what has vanished tried anew, at this share of the inertia at the actuator."""
    model, choice = setting.model, setting.choice
    # only ratios of motion are wanted of it: any inertia and stiffness will do
    alike = {name: float(role.role in ("inertia", "stiffness")) for name, role in model.roles.items()}
    plant = make_plant(model, alike)
    ratios = dict(zip(plant.bodies, vibration(plant).lowest.tolist(), strict=True))
    felt = _felt_inertia(setting, plant)
    tried = {name: value if np.isfinite(value) else 0.0 for name, value in possible(model, values).items()}
    inertia_of = {}
    for name, role in model.roles.items():
        if role.role == "inertia":
            body = role.bodies[0]
            if name in vanished:
                part = 1.0 if body == plant.bodies[plant.driven] else share
                tried[name] = part * felt / (ratios[body] or 1.0) ** 2
            inertia_of[body] = tried[name] if name in tried else model.known[name]
    rate = 2.0 * pi * TRIED_FREQUENCY * (choice.dynamics_hz or choice.cutoff_hz)
    for name in vanished:
        role = model.roles[name]
        swinging = min((inertia_of[body] for body in role.bodies if body in inertia_of), default=felt)
        if role.role == "stiffness":
            tried[name] = swinging * rate**2
        elif role.role == "damping":
            tried[name] = 2.0 * TRIED_DAMPING * swinging * rate
    return tried


def _felt_inertia(setting: Setting, plant: Plant) -> float:
    """Return force over acceleration at the actuator, in the band of the filter, by their rms.

    The forces of all actuators are felt there, by the ratios of their bodies' motion.
    """
    model, choice = setting.model, setting.choice
    ratios = dict(zip(plant.bodies, vibration(plant).lowest.tolist(), strict=True))
    actuators = [(entry.key, entry.body) for entry in model.actuators]
    force = motion = 0.0
    for record in setting.records:
        sensor, gear = nearest_sensor(plant, plant.bodies[plant.driven], record)
        order = 2 - sensor.order
        smooth = zero_phase(record.signals[sensor.key], choice.filter_order, choice.cutoff_hz, record.fs)
        acceleration = gear * differentiate(smooth, record.dt, order)[EDGE:-EDGE]
        felt = sum(ratios[body] * record.signals[key] for key, body in actuators if key in record.signals)
        smooth = zero_phase(felt, choice.filter_order, choice.cutoff_hz, record.fs)
        force += float(np.var(smooth))
        motion += float(np.var(acceleration))
    return float(np.sqrt(force / motion)) if motion > 0.0 else 1.0
