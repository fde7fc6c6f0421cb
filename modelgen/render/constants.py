"""The constants of a module as (name, source) pairs: everything that the runtime reads from it."""

from __future__ import annotations

from collections.abc import Mapping

from modelgen.render.printer import literal
from modelgen.render.units import motion_of, unit_of_signal
from modelgen.spec.chain import Body, ChainSpec
from modelgen.spec.units import force_unit, signal_unit
from modelgen.symbolic.base_parameters import BaseModel
from modelgen.symbolic.equations.equation_sums import levers
from modelgen.symbolic.equations.row import Row
from modelgen.symbolic.equations.signals import Exact
from modelgen.symbolic.equations.state_space import Output, StateSpace

CONTRACT_VERSION = 1

Parts = tuple[tuple[Exact, str], ...]


def module_constants(
    model: BaseModel, space: StateSpace, units: Mapping[str, str]
) -> tuple[tuple[str, str], ...]:
    """Return the constants of a model's module in their order; `units` as `column_units` gives them."""
    rows, spec = model.rows, model.rows.spec
    lever_of = levers(spec)
    base_units = {base.name: units[base.combination[0][0]] for base in model.base}
    values: dict[str, object] = {
        "CONTRACT_VERSION": CONTRACT_VERSION,
        "CHAIN": spec.name,
        "TITLE": spec.title,
        "SENSOR_SET": rows.sensor_set,
        "SPEC_SHA256": spec.sha256,
        "SENSORS": tuple(_sensor(output, spec) for output in space.outputs),
        "ACTUATORS": tuple(_actuator(b, lever_of) for b in spec.bodies if b.actuator),
        "PARAMETERS": tuple(p.name for p in spec.parameters if p.name not in spec.known),
        "KNOWN": dict(spec.known),
        "BASE_PARAMETERS": tuple(base.name for base in model.base),
        "IDENTIFIABLE": model.identifiable,
        "ABSENT": dict(model.absent),
        "COMPOSITES": {name: composite.formula for name, composite in rows.composites.items()},
        "UNITS": {**{p.name: p.unit for p in spec.parameters}, **base_units},
        "ROLES": {p.name: {"role": p.role, "bodies": p.bodies} for p in spec.parameters},
        "PARAMETER_SETS": {name: dict(table) for name, table in spec.parameter_sets.items()},
        "SIGNALS": tuple({**vars(one), "unit": unit_of_signal(one, rows)} for one in rows.signals),
        "FEATURES": tuple(
            {**vars(f), "of": f.of if isinstance(f.of, str) else as_floats(f.of)} for f in rows.features
        ),
        "ROWS": tuple(_row(row, lever_of) for row in rows.rows),
        "FRICTION": tuple(dict(vars(r)) for r in space.resistances),
    }
    if space.springs:
        values["CUBIC_SPRINGS"] = tuple(
            {"parameter": s.parameter, "deflection": tuple((i, float(c)) for i, c in s.deflection)}
            for s in space.springs
        )
    return tuple((name, literal(value)) for name, value in values.items())


def _sensor(output: Output, spec: ChainSpec) -> dict[str, object]:
    sensor = output.sensor
    return {**vars(sensor), "unit": signal_unit(motion_of(sensor.key, spec, (sensor,)), sensor.measures, 0)}


def _actuator(body: Body, lever_of: Mapping[str, float]) -> dict[str, object]:
    return {
        "key": body.actuator,
        "body": body.name,
        "unit": force_unit(body.motion, 0),
        "lever": lever_of[body.name],
    }


def _row(row: Row, lever_of: Mapping[str, float]) -> dict[str, object]:
    names = ("name", "origin", "bodies", "differentiated", "order", "reversals", "unit")
    return {**{name: getattr(row, name) for name in names}, "lever": lever_of[row.bodies[0]]}


def column_tables(model: BaseModel) -> tuple[list[Parts], list[dict[int, Parts]]]:
    """Sort every row's terms into its left-hand side and its columns; regrouped parameters have no column."""
    column = {base.combination[0][0]: index for index, base in enumerate(model.base)}
    measurement: list[Parts] = []
    regressor: list[dict[int, Parts]] = []
    for row in model.rows.rows:
        left: list[tuple[Exact, str]] = []
        right: dict[int, list[tuple[Exact, str]]] = {}
        for term in row.terms:
            if term.parameter is None:
                left.append((term.coefficient, term.key))
            elif term.parameter in column:
                right.setdefault(column[term.parameter], []).append((term.coefficient, term.key))
        measurement.append(tuple(left))
        regressor.append({index: tuple(right[index]) for index in sorted(right)})
    return measurement, regressor


def as_floats(parts: Parts) -> tuple[tuple[float, str], ...]:
    """Return the parts of a sum with their exact coefficients as floats."""
    return tuple((float(coefficient), key) for coefficient, key in parts)
