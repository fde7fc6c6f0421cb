"""Names of an arm's parameters and lengths: each stands for one thing, and values are of what there is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from modelgen.documents import Document
from modelgen.errors import Problem
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.arms.parameters import NEVER_NEGATIVE, ArmParameter, arm_parameters
from modelgen.spec.arms.tables import SYMBOLIC
from modelgen.spec.words import identifier_problem, path, shown, suggest

_WORDS = {"rotor_inertia": "the rotor's inertia"}


def check_shared_names(spec: ArmSpec, tables: Sequence[Document | None]) -> Iterator[Problem]:
    """Yield every name that stands for two things."""
    places = {(table or {}).get("name"): f"joints[{k}]" for k, table in reversed([*enumerate(tables)])}
    taken = {f"q_{joint.name}": f"the coordinate of joint {joint.name}" for joint in spec.moving}
    taken |= {name: "a length" for name in spec.lengths}
    names = [joint.name for joint in spec.joints]
    for parameter in arm_parameters(spec) if len({*names}) == len(names) else ():
        meaning = _meaning(parameter)
        other = taken.setdefault(parameter.name, meaning)
        if other != meaning:
            where = f"{places.get(parameter.joint, 'joints')}.{parameter.role}"
            if parameter.payload is not None:
                where = path("payload", parameter.payload)
            yield Problem(where, f'"{parameter.name}" is {other} and {meaning}', "rename one of them")


def check_lengths(document: Document, spec: ArmSpec) -> Iterator[Problem]:
    """Yield lengths that have a name and no value, a value and no use, or no good name."""
    given = document.get("lengths") or {}
    for name in given:
        problem = identifier_problem(name)
        if problem:
            yield Problem(path("lengths", name), *problem)
        elif name not in spec.lengths:
            remedy = suggest(name, spec.lengths, "lengths in placements")
            yield Problem(path("lengths", name), "is in no placement", remedy)
    if document.get("lengths", "") is None:
        return
    for name in spec.lengths:
        if name not in given:
            value = f'write {name} = 0.4 (m) under [lengths], or {name} = "{SYMBOLIC}" where it has no value'
            yield Problem(path("lengths", name), "is in a placement, but not here", value)


def check_values(document: Document, spec: ArmSpec, complete: bool) -> Iterator[Problem]:
    """Yield values of what is no parameter, or of what nature does not have."""
    parameters = {parameter.name: parameter for parameter in arm_parameters(spec)}
    sets = [("parameters", name) for name in document.get("parameters") or {}]
    for _, name in sets:
        problem = identifier_problem(name)
        if problem:
            yield Problem(path("parameters", name), *problem)
    for place in (("known",), *sets):
        table = document.get(place[0]) or {}
        values = table if place == ("known",) else table.get(place[1]) or {}
        for name, value in values.items():
            where, parameter = path(*place, name), parameters.get(name)
            if parameter is None:
                if complete:
                    yield Problem(where, "is not a parameter of the arm", _meant(name, parameters))
            elif (
                value is not None
                and parameter.role in NEVER_NEGATIVE
                and _number(value, spec, place, name) < 0
            ):
                what = f"is {shown(value)}, but {_meaning(parameter)} is never negative"
                yield Problem(where, what, "correct the value")


def _number(value: object, spec: ArmSpec, place: tuple[str, ...], name: str) -> float:
    return spec.known[name] if place == ("known",) else spec.parameter_sets[place[1]][name]


def _meant(name: str, parameters: dict[str, ArmParameter]) -> str:
    if f"{name}_plus" in parameters:
        return f"write {name}_plus and {name}_minus"
    return suggest(name, sorted(parameters, key=lambda other: other[:1] != name[:1]), "parameters")


def _meaning(parameter: ArmParameter) -> str:
    role = _WORDS.get(parameter.role, parameter.role)
    if parameter.payload is not None:
        return f"{role} of payload {parameter.payload}"
    of = f"the motor of joint {parameter.joint}" if parameter.of_motor else f"joint {parameter.joint}"
    return f"{role} of {of}"
