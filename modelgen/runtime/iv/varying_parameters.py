"""Parameters that are no constants: they change in the course of records, along positions, or with loads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.iv.chain_errors import acceleration, deflection, on_body, simulated_deflection
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.effect import Changes, Effect
from modelgen.runtime.iv.pushed_chain import deflection_of, pushed_body, pushed_link
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record

Form = Callable[[FloatArray], FloatArray]
# (simulated, size so far) -> what a unit more of a parameter changes.
Larger = Callable[[Simulated, float], Changes]
# What is said of what changes in the course of the records, and along positions.
MEAN = "as where a machine warms up: its value is that of the middle, and the interval holds what it was"
MIDDLE = "its value is that of the middle of the positions, and the interval holds what it is elsewhere"
# The rms of what changes evenly from end to end by one.
EVENLY = 12.0**-0.5
WARM_DRIVE, WARM_MACHINE = (
    f"let the {what} warm up first, or identify from each record alone" for what in ("drive", "machine")
)
LOADS = "identify from the records of each load alone"
SETTINGS = "identify from the records of each setting alone"
SHORTER = "identify from shorter travels, each about the position that matters"


def varying_effects(model: Model, records: Sequence[Record]) -> Iterator[Effect]:
    """Yield that friction changes in the course of records, along a position or with a load, and springs.

    Also that one record has another load, or a link that was set anew.
    """
    springs = {name: role for name, role in model.roles.items() if role.role == "stiffness"}
    position = _position(model, records)
    for name, body, form, names in _frictions(model):
        yield from (_drift(name, body, form, course, names) for course in courses(records))
        if position and form is np.sign:
            yield _along(name, body, form, *position, names)
    for name, role in model.roles.items():
        if role.role == "inertia" and len(role.bodies) == 1:
            yield from _set_anew(name, partial(_heavier, role.bodies[0]), LOADS, records)
    for name, role in springs.items():
        for body in dict.fromkeys(friction.body for friction in model.friction):
            if body in role.bodies:
                yield _with_load(name, body)
        yield from _set_anew(name, partial(_stiffened, name), SETTINGS, records)
        if position:
            yield _stiffer(name, role.ends, *position)


def falling_gain(
    key: str, course: Sequence[tuple[float, float]], varies: tuple[tuple[str, float], ...]
) -> Effect:
    """Return that the gain of a force falls along a course of the records: warm magnets are weaker.

    The size is the share of the gain from the beginning to the end. All parameters are in proportion to it:
    `varies` says by how much, see `varying_along`.
    """

    def changes(simulated: Simulated) -> Changes:
        signal = simulated.record.signals[key]
        return {key: along(course, simulated.index, len(signal)) * signal}

    said = (
        "in the course of the records: parameters are those of the middle, and intervals hold what they were"
    )
    falls, rises = (f"the gain of {key} {way} {said}" for way in ("falls", "rises"))
    return Effect(f"drift of the gain of {key}", "drift", falls, rises, WARM_DRIVE, changes, key,
                  varies=varies, relative=True)  # fmt: skip


def courses(records: Sequence[Record]) -> list[list[tuple[float, float]]]:
    """Return ways in which something changes in the course of records: from where to where each goes, of 1.

    From the first sample to the last, in every record anew, or from one record to the next.
    """
    lasting, last = [record.n * record.dt for record in records], len(records) - 1
    ends = np.cumsum(lasting) / sum(lasting)
    found = [list(zip([0.0, *ends.tolist()], ends.tolist(), strict=False))]
    if last > 0:
        found += [[(0.0, 1.0)] * (last + 1), [(index / last, index / last) for index in range(last + 1)]]
    return found


def along(course: Sequence[tuple[float, float]], index: int, samples: int) -> FloatArray:
    """Return where a record is in a course, from the middle of it on, shape (samples,)."""
    return np.linspace(*course[index], samples) - 0.5


def varying_along(
    course: Sequence[tuple[float, float]], names: Iterable[str]
) -> tuple[tuple[str, float], ...]:
    """Return the rms of where records are in a course, from the middle of it on, for each of some names."""
    rms = float(np.sqrt(np.mean([np.mean(along(course, index, 9) ** 2) for index in range(len(course))])))
    return tuple((name, rms) for name in names)


def _frictions(model: Model) -> Iterator[tuple[str, str, Form, list[str]]]:
    """Yield the name of each friction that the spec names, its body, its form and its parameters."""
    for friction in model.friction:
        names = [one for one in (friction.coulomb_plus, friction.coulomb_minus) if one]
        if names:
            yield f"Coulomb friction on {friction.body}", friction.body, np.sign, names
    for name, role in model.roles.items():
        if role.role == "viscous" and len(role.bodies) == 1:
            (body,) = role.bodies
            yield f"viscous friction on {body}", body, np.asarray, [name]


def _drift(
    name: str, body: str, form: Form, course: Sequence[tuple[float, float]], names: Sequence[str]
) -> Effect:
    """Return that a friction falls along a course of the records.

    The size is the change from the beginning to the end, in N m or N, and per speed.
    """

    def force(simulated: Simulated) -> FloatArray:
        speed = simulated.led[body].speed
        return np.asarray(along(course, simulated.index, len(speed)) * form(speed))

    falls, rises = (f"{name} {way} in the course of the records, {MEAN}" for way in ("falls", "rises"))
    changes, varies = on_body(body, force), varying_along(course, names)
    return Effect(f"drift of {name}", "drift", falls, rises, WARM_MACHINE, changes, varies=varies)


def _set_anew(name: str, larger: Larger, remedy: str, records: Sequence[Record]) -> Iterator[Effect]:
    """Yield that a parameter is another one in one of several records.

    The size is the difference, in the parameter's unit. It is looked for along the simulated motion: noise of
    a sensor is in the rows, too, and would look like another parameter there. It is estimated along that of
    the record, with the simulated one as instrument. `diagnostics.changing_inertia` tells changes within one.
    """
    count = len(records)
    for one in range(count if count > 1 else 0):
        # a deviation of the whole change: of a large one a first order tells little more than half
        others = "the others" if count > 2 else "the other one"
        more, less = (
            f"{name} is {way} in record {one + 1} than in {others}: its value is that of {others}, and the"
            " interval holds both"
            for way in ("larger", "smaller")
        )
        changes = partial(_only_in, one, larger)
        yield Effect(f"{name} of record {one + 1}", "drift", more, less, remedy, changes, at=changes,
                     quiet=changes, varies=((name, 1.0),))  # fmt: skip


def _only_in(one: int, larger: Larger, simulated: Simulated, size: float = 0.0) -> Changes:
    return larger(simulated, size) if simulated.index == one else {}


def _heavier(body: str, simulated: Simulated, size: float) -> Changes:
    """Return what is changed by a unit more inertia of a body."""
    moved = acceleration(simulated, body) if size else simulated.motion[f"a_{body}"]
    return pushed_body(simulated, body, -moved)


def _stiffened(stiffness: str, simulated: Simulated, size: float) -> Changes:
    """Return what is changed by a unit more stiffness of a link."""
    bent = deflection(simulated, stiffness) if size else simulated_deflection(simulated, stiffness)
    return pushed_link(simulated, stiffness, bent)


def _position(model: Model, records: Sequence[Record]) -> tuple[str, float, float] | None:
    """Return the first sensor that reads where a body is, and the ends of where it is in the records."""
    for sensor in model.sensors:
        if sensor.measures == "position" and sensor.body:
            extents = [one.facts.extent(sensor.key) for one in records if sensor.key in one.signals]
            if extents:
                return sensor.key, min(one.least for one in extents), max(one.greatest for one in extents)
    return None


def _placed(simulated: Simulated, key: str, least: float, greatest: float) -> FloatArray:
    """Return where a sensor is between its ends, from the middle on: -0.5 to 0.5, shape (n,)."""
    return np.asarray((simulated.record.signals[key] - 0.5 * (least + greatest)) / (greatest - least or 1.0))


def _along(
    name: str, body: str, form: Form, key: str, least: float, greatest: float, names: Sequence[str]
) -> Effect:
    """Return that a friction rises along a position, as in a guide that is worn, or that is out of line."""

    def force(simulated: Simulated) -> FloatArray:
        return -_placed(simulated, key, least, greatest) * form(simulated.led[body].speed)

    rises, falls = (f"{name} {way} with {key}: {MIDDLE}" for way in ("rises", "falls"))
    varies = tuple((one, EVENLY) for one in names)
    return Effect(
        f"course of {name} along {key}", "drift", rises, falls, SHORTER, on_body(body, force), varies=varies
    )


def _stiffer(stiffness: str, pair: str, key: str, least: float, greatest: float) -> Effect:
    """Return that a link grows stiffer along a position: a belt or a screw is as stiff as its free length."""

    def changes(simulated: Simulated) -> Changes:
        force = _placed(simulated, key, least, greatest) * deflection(simulated, stiffness)
        return pushed_link(simulated, stiffness, force)

    rises, falls = (f"{stiffness} between {pair} {way} with {key}: {MIDDLE}" for way in ("rises", "falls"))
    return Effect(f"course of {stiffness} along {key}", "drift", rises, falls, SHORTER, changes,
                  varies=((stiffness, EVENLY),))  # fmt: skip


def _with_load(stiffness: str, body: str) -> Effect:
    """Return that a body's friction grows with the force in its link, as in teeth and worms.

    The size is the share of that force (Bittencourt and Gunnarsson 2012).
    """

    def force(simulated: Simulated) -> FloatArray:
        plant = simulated.plant
        share = plant.parameters[stiffness] * deflection_of(plant, stiffness)[plant.bodies.index(body)]
        load = np.abs(share * deflection(simulated, stiffness))
        return np.asarray(-np.sign(simulated.led[body].speed) * load)

    words = f"friction on {body} grows with the force in {stiffness}"
    remedy = "compare loads: the friction that the spec names is that without load"
    return Effect(
        f"friction on {body} with the force in {stiffness}", "form", words, "", remedy, on_body(body, force)
    )
