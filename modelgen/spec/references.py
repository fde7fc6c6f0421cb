"""Second pass over a spec: references between tables, on what the first pass could read."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from modelgen.documents import Document
from modelgen.errors import Problem, listed
from modelgen.spec.chain import GROUND, LINK_ROLES, ChainSpec, Parameter, Sensor, elements
from modelgen.spec.tables import BodyTable, FileTable, LinkTable
from modelgen.spec.units import Motion, Role
from modelgen.spec.words import identifier_problem, path, shown, suggest

_DERIVED = re.compile(r"d\d+_.*|sign_.*|1")  # names of signals made from sensors and actuators


def check_references(document: Document, spec: ChainSpec) -> list[Problem]:
    """Report contradictions between tables; silent where an unreadable table may hold what is missed."""
    tables = [*(document["bodies"] or [None]), *(document.get("links") or [])]
    misplaced = any(
        isinstance(document[key], list) for key in document.keys() - FileTable.model_fields.keys()
    )
    lists = "links" not in document or document["links"] is not None
    complete = lists and not misplaced and None not in tables and None not in [b.name for b in spec.bodies]
    bodies = {body.name: body.motion for body in spec.bodies} if complete else None
    return [
        *_check_bodies(document, spec),
        *_check_links(document, spec, bodies),
        *_check_shared_names(document, spec),
        *_check_sensors(document, spec, bodies),
        *_check_values(document, _roles(spec, tables) if complete else None),
    ]


def _roles(spec: ChainSpec, tables: list[Document]) -> dict[str, Role | None] | None:
    """Role of every parameter; None for all if a name is missing, None for a name under a misspelt key."""
    keys = ("inertia", "viscous", "coulomb", "offset", "friction", *LINK_ROLES)
    if any(table.get(key, "") is None for table in tables for key in keys):
        return None
    allowed = BodyTable.model_fields.keys() | LinkTable.model_fields.keys()
    misspelt = [v for table in tables for k, v in table.items() if k not in allowed and isinstance(v, str)]
    return {**dict.fromkeys(misspelt), **{parameter.name: parameter.role for _, parameter in elements(spec)}}


def _check_bodies(document: Document, spec: ChainSpec) -> Iterator[Problem]:
    if document["bodies"] == []:
        yield Problem("bodies", "is empty", "write [[bodies]] for every body")
    first: dict[tuple[str, str | None], str] = {}
    for index, body in enumerate(spec.bodies):
        where = f"bodies[{index}]"
        if body.name == GROUND:
            yield Problem(f"{where}.name", '"ground" is what does not move', "choose another name")
        for key, name in (("name", body.name), ("actuator", body.actuator)):
            other = first.setdefault((key, name), where)
            if name is not None and other != where:
                what = f'"{name}" is the {key} of {other} already'
                yield Problem(f"{where}.{key}", what, "rename one of them")
        if body.actuator is not None:
            yield from _check_derived(f"{where}.actuator", body.actuator)


def _check_links(
    document: Document, spec: ChainSpec, bodies: Mapping[str, Motion] | None
) -> Iterator[Problem]:
    for index, link in enumerate(spec.links):
        where, table = f"links[{index}]", document["links"][index] or {}
        yield from _check_pair(f"{where}.bodies", link.bodies, bodies)
        if link.bodies[:1] == (GROUND,) and link.bodies[1] != GROUND:
            right = f'write ["{link.bodies[1]}", "ground"] and the ratio of {link.bodies[1]}'
            yield Problem(f"{where}.bodies", '"ground" is first in a link with a ratio', right)
        mixed = bodies is not None and len({bodies[end] for end in link.bodies if end in bodies}) == 2
        if mixed and not {"ratio", "lead"} & table.keys():
            remedy = "add ratio, how far the first body moves while the second moves by one unit, or lead"
            yield Problem(where, "joins a rotation and a translation without a ratio", remedy)
        if {"ratio", "lead"} <= table.keys():
            yield Problem(where, "has both ratio and lead", "keep one of them")
        elif "lead" in table and bodies is not None and not mixed and _motions_read(document):
            remedy = "write ratio, or give one of the bodies its own motion"
            yield Problem(
                f"{where}.lead", "is no travel a turn: it needs a rotation and a translation", remedy
            )
    if bodies is not None:
        yield from _check_connected(spec)


def _check_pair(
    where: str, pair: tuple[str, ...] | None, bodies: Mapping[str, Motion] | None
) -> Iterator[Problem]:
    if pair and len(set(pair)) == 1:
        yield Problem(where, f"joins {shown(pair[0])} with itself", "name two different bodies")
    for name in dict.fromkeys(pair or ()):
        if bodies is not None and name not in bodies and name != GROUND:
            yield Problem(where, f"{shown(name)} is not a body", suggest(name, bodies, "bodies"))


def _check_connected(spec: ChainSpec) -> Iterator[Problem]:
    neighbours: dict[str, list[str]] = {body.name: [] for body in spec.bodies}
    for link in spec.links:
        ends = [name for name in link.bodies if name in neighbours]
        if not link.bodies or not {*link.bodies} <= {*ends, GROUND}:
            return  # reported already, and it may be the link that is missed here
        for name in ends:
            neighbours[name] += ends
    parts: list[list[str]] = []
    unseen = dict.fromkeys(neighbours)
    while unseen:
        part = [next(iter(unseen))]
        del unseen[part[0]]
        for name in part:  # grows while it is walked
            for neighbour in neighbours[name]:
                if neighbour in unseen:
                    del unseen[neighbour]
                    part.append(neighbour)
        parts.append(part)
    if len(parts) > 1:
        names = listed([listed(part) for part in parts], " and ")
        what = f"leave {len(parts)} parts unconnected: {names}"
        yield Problem("links", what, "join them, or write a file for each")


def _check_shared_names(document: Document, spec: ChainSpec) -> Iterator[Problem]:
    """A parameter's name may be shared by elements of the same role and unit, and by nothing else."""
    units_known = _motions_read(document)
    first: dict[str, tuple[str, Parameter]] = {}
    wrong: dict[str, None] = {}
    for where, parameter in elements(spec):
        place, other = first.setdefault(parameter.name, (where, parameter))
        what = ""
        if parameter.role != other.role:
            what = f"stands for {other.role} in {place} and for {parameter.role} here"
        elif parameter.unit != other.unit and units_known:
            what = f"is in {other.unit} in {place} and in {parameter.unit} here"
        if what and where not in wrong:
            wrong[where] = None
            yield Problem(where, f'"{parameter.name}" {what}', "give the two parameters different names")
    for index, body in enumerate(spec.bodies):
        if body.actuator in first:
            what = f'"{body.actuator}" is the parameter {first[body.actuator][0]} too'
            yield Problem(f"bodies[{index}].actuator", what, "rename one of them")


def _motions_read(document: Document) -> bool:
    tables = [document.get("chain"), *(document["bodies"] or ())]
    return all(table is not None and table.get("motion", "") is not None for table in tables)


def _check_sensors(
    document: Document, spec: ChainSpec, bodies: Mapping[str, Motion] | None
) -> Iterator[Problem]:
    taken = _taken(spec)
    for name, sensors in spec.sensor_sets.items():
        tables = document["sensors"][name]
        yield from _check_name(path("sensors", name), name)
        if tables == {}:
            yield Problem(
                path("sensors", name),
                "is empty",
                'add a sensor: q_m = { body = "m", measures = "position" }',
            )
        for sensor in sensors:
            where = path("sensors", name, sensor.key)
            yield from _check_key(where, sensor.key, taken)
            if tables[sensor.key] is not None:
                yield from _check_sensor(where, sensor, tables[sensor.key], spec, bodies)


def check_one_sensor(where: str, sensor: Sensor, table: Document, spec: ChainSpec) -> Iterator[Problem]:
    """Report what is wrong with a sensor from elsewhere than a spec, as if it stood there."""
    yield from _check_key(where, sensor.key, _taken(spec))
    yield from _check_sensor(where, sensor, table, spec, {body.name: body.motion for body in spec.bodies})


def _taken(spec: ChainSpec) -> dict[str, str]:
    """Return the names that no sensor may have, and where they stand."""
    actuators = {body.actuator: f"bodies[{i}].actuator" for i, body in enumerate(spec.bodies)}
    named = {parameter.name: where for where, parameter in elements(spec)}
    return named | {name: where for name, where in actuators.items() if name}


def _check_key(where: str, key: str, taken: Mapping[str, str]) -> Iterator[Problem]:
    yield from _check_name(where, key)
    yield from _check_derived(where, key)
    if key in taken:
        yield Problem(where, f'"{key}" is the name in {taken[key]} too', "rename one of them")


def _check_sensor(
    where: str, sensor: Sensor, table: Document, spec: ChainSpec, bodies: Mapping[str, Motion] | None
) -> Iterator[Problem]:
    if {"body", "deflection"} <= table.keys():
        yield Problem(where, "has both body and deflection", "keep one of them")
    if table.keys() <= {"measures"}:
        yield Problem(where, "has neither body nor deflection", 'add body = "m"')
    if sensor.body is not None and bodies is not None and sensor.body not in bodies:
        yield Problem(
            f"{where}.body", f"{shown(sensor.body)} is not a body", suggest(sensor.body, bodies, "bodies")
        )
    pair = sensor.deflection or ()
    yield from _check_pair(f"{where}.deflection", pair, bodies)
    if GROUND in pair:
        yield Problem(f"{where}.deflection", '"ground" does not move', "use body = with the other one's name")
    linked = any(link.bodies == pair for link in spec.links)  # then the ratio makes one unit of the two
    if bodies and not linked and len({bodies[name] for name in pair if name in bodies}) == 2:
        remedy = "name the bodies as a link with a ratio does, or use a sensor for each"
        yield Problem(f"{where}.deflection", "subtracts a translation from a rotation", remedy)


def _check_values(document: Document, roles: Mapping[str, Role | None] | None) -> Iterator[Problem]:
    yield from check_value_table(("known",), document.get("known"), roles)
    for name, values in (document.get("parameters") or {}).items():
        yield from _check_name(path("parameters", name), name)
        yield from check_value_table(("parameters", name), values, roles)


def check_value_table(
    place: tuple[str, ...], values: Mapping[str, float | None] | None, roles: Mapping[str, Role | None] | None
) -> Iterator[Problem]:
    """Yield what is wrong with values of parameters, those of the table at `place`."""
    if values is None or roles is None:
        return
    for name, value in values.items():
        where, role = path(*place, name), roles.get(name)
        if name not in roles:
            split = f"{name}_plus" in roles
            remedy = f"write {name}_plus and {name}_minus" if split else suggest(name, roles, "parameters")
            yield Problem(where, "is not a parameter of the chain", remedy)
        if value is None or role in (None, "offset", "stiffness3"):
            continue
        if value < 0 or (value == 0 and role == "inertia"):
            limit = "greater than 0" if role == "inertia" else "0 or greater"
            yield Problem(where, f"is {shown(value)}, but {role} must be {limit}", "correct the value")


def _check_name(where: str, text: str) -> Iterator[Problem]:
    problem = identifier_problem(text)
    if problem:
        yield Problem(where, *problem)


def _check_derived(where: str, name: str) -> Iterator[Problem]:
    problem = derived_problem(name)
    if problem:
        yield Problem(where, *problem)


def derived_problem(name: str) -> tuple[str, str] | None:
    """Return what is wrong with a signal's name, and the remedy, if it is that of a derived one."""
    if not _DERIVED.fullmatch(name):
        return None
    return f'"{name}" is kept for a derived signal', "do not begin with sign_ or d1_, d2_, ..."
