"""A chain with one link rigid: its two bodies are one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from modelgen.spec.chain import GROUND, Body, ChainSpec, Link, Sensor, elements

LONGEST_NAME = 64
SUMMED = ("inertia", "viscous", "coulomb", "offset")


def lumped(
    spec: ChainSpec, index: int, values: Mapping[str, float]
) -> tuple[ChainSpec, Mapping[str, float]] | None:
    """Return the chain whose link `index` is rigid, and its parameters' values; None where that is no chain.

    The second body of the link becomes part of the first, which keeps its name; what both have (inertia,
    friction, offset) adds up to one parameter, J_m and J_g to J_m_J_g. Only links without a gear between
    bodies of one motion can be made rigid, and nothing may be shared with other elements or be known.
    """
    first, second = spec.links[index].bodies
    bodies = {body.name: body for body in spec.bodies}
    if GROUND in (first, second) or spec.links[index].ratio != 1:
        return None
    kept, gone = bodies[first], bodies[second]
    both = [(role, getattr(kept, role), getattr(gone, role)) for role in SUMMED]
    touched = [name for _, *names in both for name in names if name]
    uses = [parameter.name for _, parameter in elements(spec)]
    if (
        (kept.motion, kept.friction) != (gone.motion, gone.friction)
        or kept.friction != "symmetric"
        or (kept.actuator and gone.actuator)
        or any(name in spec.known or uses.count(name) > 1 for name in touched)
    ):
        return None
    ends = [_renamed(link, second, first) for k, link in enumerate(spec.links) if k != index]
    if any(len({*link.bodies}) < 2 for link in ends) or len({frozenset(one.bodies) for one in ends}) < len(
        ends
    ):
        return None
    names = {role: "_".join(part for part in parts if part) or None for role, *parts in both}
    if any(
        name and (len(name) > LONGEST_NAME or name in uses) for name in names.values() if name not in touched
    ):
        return None
    body = replace(kept, actuator=kept.actuator or gone.actuator, **names)  # type: ignore[arg-type]
    sums = {
        str(names[role]): sum(values[part] for part in parts if part) for role, *parts in both if names[role]
    }
    new = replace(
        spec,
        bodies=tuple(body if one is kept else one for one in spec.bodies if one is not gone),
        links=tuple(ends),
        parameter_sets={},
        sensor_sets={name: _sensors(given, body, second) for name, given in spec.sensor_sets.items()},
    )
    every: dict[str, float] = {**values, **sums}
    wanted = {parameter.name for parameter in new.parameters}
    return new, {name: value for name, value in every.items() if name in wanted}


def _renamed(link: Link, old: str, new: str) -> Link:
    one, other = (new if name == old else name for name in link.bodies)
    return replace(link, bodies=(one, other))


def _sensors(given: tuple[Sensor, ...], body: Body, gone: str) -> tuple[Sensor, ...]:
    """Return the sensors of the lumped chain: what reads the rigid link's deflection reads nothing."""
    found = []
    for sensor in given:
        if sensor.deflection is None:
            found.append(replace(sensor, body=body.name) if sensor.body == gone else sensor)
            continue
        one, other = (body.name if name == gone else name for name in sensor.deflection)
        if one != other:
            found.append(replace(sensor, deflection=(one, other)))
    return tuple(found)
