"""A chain as one Modelica model without libraries: Coulomb friction rises with tanh over a small speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from modelgen.errors import signed_sum
from modelgen.runtime.exports.case import Case, Written
from modelgen.runtime.exports.mechanics import Lever, MechanicalBody
from modelgen.runtime.exports.plain_text import free_name, quoted

FRICTION_TIME_S = 1e-4  # speed that Coulomb friction alone gives the body in this time: there it is at 76 %
WORDS = frozenset(
    (
        *("algorithm", "and", "annotation", "assert", "block", "break", "class", "connect", "connector"),
        *(
            "constant",
            "constrainedby",
            "der",
            "discrete",
            "each",
            "else",
            "elseif",
            "elsewhen",
            "encapsulated",
        ),
        *("end", "enumeration", "equation", "expandable", "extends", "external", "false", "final", "flow"),
        *("for", "function", "if", "import", "impure", "in", "initial", "inner", "input", "loop", "model"),
        *("not", "operator", "or", "outer", "output", "package", "parameter", "partial", "protected"),
        *("public", "pure", "record", "redeclare", "replaceable", "return", "stream", "then", "true", "type"),
        *("when", "while", "within", "time", "Real", "Integer", "Boolean", "String", "tanh"),
    )
)


def write(case: Case) -> Written:
    """Return a model; with samples, a package of it and of one model a sample."""
    names = _Names(case)
    if not case.values.samples:
        return Written({"": ("\n".join(_model(case, names, "")) + "\n").encode()}, ())
    package = free_name(f"{case.name}_package", [case.name])
    lines = [f"package {package}", *_model(case, names, "  ")]
    width = max(3, len(str(len(case.values.samples))))
    for number, sample in enumerate(case.values.samples, 1):
        changed = ", ".join(
            f"{names.of(name)} = {value!r}"
            for name, value in sample.items()
            if value != case.values.nominal[name]
        )
        lines.append(f"  model sample_{number:0{width}d} = {names.model}({changed});")
    lines.append(f"end {package};")
    return Written({"": ("\n".join(lines) + "\n").encode()}, ())


class _Names:
    """Names in Modelica: words of the language are quoted, states have names that nothing else has."""

    def __init__(self, case: Case) -> None:
        self.model = case.name
        self._taken = {
            *case.values.nominal,
            *(push.key for push in case.mechanics.pushes),
            *(reading.key for reading in case.mechanics.readings),
        }
        self._made: dict[str, str] = {}

    def of(self, name: str) -> str:
        return f"'{name}'" if name in WORDS else name

    def made(self, name: str) -> str:
        if name not in self._made:
            self._made[name] = free_name(name, self._taken)
            self._taken.add(self._made[name])
        return self._made[name]


def _unit(unit: str) -> str:
    """Return a unit as Modelica writes it: N m s/rad is "N.m.s/rad", kg m^2 is "kg.m2"."""
    return quoted(unit.replace(" ", ".").replace("^", ""))


def _model(case: Case, names: _Names, margin: str) -> Iterator[str]:
    yield f"{margin}model {names.model} {quoted(case.model.title)}"
    for line in (*_declarations(case, names), "equation", *_equations(case, names)):
        yield f"{margin}{'' if line == 'equation' else '  '}{line}"
    yield f"{margin}end {names.model};"


def _declarations(case: Case, names: _Names) -> Iterator[str]:
    model, values = case.model, case.values.nominal
    for name, value in values.items():
        unit = _unit(model.units.get(name, ""))
        role = model.roles[name].role if name in model.roles else ""
        attributes = f"unit = {unit}" + (", min = 0" if role in ("inertia", "coulomb") else "")
        yield f"parameter Real {names.of(name)}({attributes}) = {value!r} {quoted(role)};"
    for body in _rubbing(case):
        speed = names.made(f"slow_{body.name}")
        size = slow_speed(body, values)
        unit = _unit(body.units["velocity"])
        yield f'parameter Real {speed}(unit = {unit}) = {size!r} "speed at which friction is at 76 %";'
    for push in case.mechanics.pushes:
        yield f"input Real {names.of(push.key)}(unit = {_unit(push.unit)});"
    for reading in case.mechanics.readings:
        yield f"output Real {names.of(reading.key)}(unit = {_unit(reading.unit)});"
    for body in case.mechanics.bodies:
        for kind, measure in (("position", "position"), ("speed", "velocity")):
            unit = _unit(body.units[measure])
            yield f"Real {names.made(f'{kind}_{body.name}')}(unit = {unit}, start = 0, fixed = true);"
    for number, spring in enumerate(case.mechanics.springs, 1):
        first = case.mechanics.bodies[spring.lever[-1][0]]
        yield f"Real {names.made(f'force_{number}')}(unit = {_unit(first.units['force'])});"


def _rubbing(case: Case) -> list[MechanicalBody]:
    """Return the bodies with Coulomb friction, or friction that differs by direction."""
    return [
        body
        for body in case.mechanics.bodies
        if body.friction and (body.friction.coulomb_plus or body.friction.asymmetric)
    ]


def slow_speed(body: MechanicalBody, values: Mapping[str, float]) -> float:
    """Return the speed over which a body's Coulomb friction changes its sign, to two digits."""
    assert body.friction is not None
    names = (body.friction.coulomb_plus, body.friction.coulomb_minus)
    largest = max((values[name] for name in names if name), default=0.0)
    return float(f"{FRICTION_TIME_S * largest / values[body.inertia]:.1e}") or 1e-6


def _equations(case: Case, names: _Names) -> Iterator[str]:
    bodies = case.mechanics.bodies
    for number, spring in enumerate(case.mechanics.springs, 1):
        parts = []
        for name, kind, power in (
            (spring.stiffness, "position", ""),
            (spring.damping, "speed", ""),
            (spring.stiffness3, "position", "^3"),
        ):
            if name:
                parts.append(f"{names.of(name)}*({_sum(case, names, spring.lever, kind)}){power}")
        yield f"{names.made(f'force_{number}')} = {' + '.join(parts)};"
    for place, body in enumerate(bodies):
        speed = names.made(f"speed_{body.name}")
        yield f"der({names.made(f'position_{body.name}')}) = {speed};"
        yield f"{names.of(body.inertia)}*der({speed}) = {_forces(case, names, place, body)};"
    for reading in case.mechanics.readings:
        if reading.order == 2:
            total = _sum(case, names, reading.lever, "speed", "der({})")
        else:
            total = _sum(case, names, reading.lever, ("position", "speed")[reading.order])
        yield f"{names.of(reading.key)} = {total};"


def _sum(case: Case, names: _Names, lever: Lever, kind: str, form: str = "{}") -> str:
    terms = []
    for place, factor in lever:
        variable = form.format(names.made(f"{kind}_{case.mechanics.bodies[place].name}"))
        terms.append((factor < 0.0, variable if abs(factor) == 1.0 else f"{abs(factor)!r}*{variable}"))
    return signed_sum(terms) or "0"


def _forces(case: Case, names: _Names, place: int, body: MechanicalBody) -> str:
    parts = [names.of(push.key) for push in case.mechanics.pushes if push.body == place]
    speed = names.made(f"speed_{body.name}")
    forward, backward = (names.of(name) if name else None for name in body.viscous)
    if forward and forward == backward:
        parts.append(f"-{forward}*{speed}")
    elif forward:
        parts.append(f"-(if {speed} > 0 then {forward} else {backward})*{speed}")
    friction = body.friction
    if friction is not None and friction.coulomb_plus and friction.coulomb_minus:
        slope = f"tanh({speed}/{names.made(f'slow_{body.name}')})"
        plus, minus = names.of(friction.coulomb_plus), names.of(friction.coulomb_minus)
        size = plus if plus == minus else f"(if {speed} > 0 then {plus} else {minus})"
        parts.append(f"-{size}*{slope}")
    if friction is not None and friction.offset:
        parts.append(f"-{names.of(friction.offset)}")
    for number, spring in enumerate(case.mechanics.springs, 1):
        factor = dict(spring.lever).get(place)
        if factor is not None:
            size = "" if abs(factor) == 1.0 else f"{abs(factor)!r}*"
            parts.append(f"{'-' if factor > 0.0 else ''}{size}{names.made(f'force_{number}')}")
    return " + ".join(parts).replace("+ -", "- ") or "0"
