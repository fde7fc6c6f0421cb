"""What the template sees: plain strings and tuples, nothing symbolic."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from sympy.polys.rings import PolyElement

from modelgen.render.printer import literal, weighted_sum
from modelgen.spec.load import ChainSpec, Sensor
from modelgen.spec.units import Motion, force_unit, signal_unit
from modelgen.symbolic.base_parameters import BaseModel, BaseParameter
from modelgen.symbolic.equations.equation_sums import levers
from modelgen.symbolic.equations.newton import motion_equations
from modelgen.symbolic.equations.row import Feature, IdentificationRows, NeededSignal, Row
from modelgen.symbolic.equations.signals import Exact
from modelgen.symbolic.equations.state_space import Entry, Output, StateSpace, state_space

CONTRACT_VERSION = 1
SAFE_FILE_NAME = re.compile(r"[A-Za-z0-9_.-]{1,100}\Z")


@dataclass(frozen=True)
class ModelView:
    """Everything a template prints: constants as (name, source) pairs, function bodies as lines of source."""

    chain: str
    sensor_set: str
    source: str
    sha256: str
    row_summaries: tuple[str, ...]
    base_summaries: tuple[str, ...]
    absent_summaries: tuple[str, ...]
    constants: tuple[tuple[str, str], ...]
    first_key: str
    row_count: int
    column_count: int
    state_count: int
    actuator_count: int
    resistance_count: int
    output_count: int
    has_features: bool
    measures_features: bool  # friction of known size stands on the left-hand side
    feature_lines: tuple[tuple[str, str], ...]
    measurement_lines: tuple[str, ...]
    regressor_lines: tuple[str, ...]
    columns_measurement: str
    columns_regressor: str
    base_lines: tuple[str, ...]
    physical_lines: tuple[tuple[str, str], ...]
    composite_summaries: tuple[str, ...]
    nonlinear: bool
    directions: str
    state_space_lines: tuple[str, ...]
    has_cubic: bool


def model_view(model: BaseModel) -> ModelView:
    """Print every number and expression of a model as source."""
    rows, spec = model.rows, model.rows.spec
    space = state_space(motion_equations(spec), rows.sensors)
    column = {base.combination[0][0]: index for index, base in enumerate(model.base)}
    units = column_units(rows)
    nonlinear = bool(rows.composites)
    measurement, regressor = _column_tables(rows, column)
    feature_keys = {feature.key for feature in rows.features}
    return ModelView(
        chain=spec.name,
        sensor_set=rows.sensor_set,
        source=spec.source if SAFE_FILE_NAME.match(spec.source) else f"{spec.name}.toml",
        sha256=spec.sha256,
        row_summaries=tuple(f"{i}. {r.name}: {r.origin}; order {r.order}" for i, r in enumerate(rows.rows)),
        base_summaries=tuple(f"{b.name} [{units[b.combination[0][0]]}]" for b in model.base),
        absent_summaries=tuple(f"{name}: {reason}" for name, reason in model.absent.items()),
        constants=_constants(model, space, units),
        first_key=next(signal.key for signal in rows.signals),
        row_count=len(rows.rows),
        column_count=len(model.base),
        state_count=2 * len(space.bodies),
        actuator_count=len(space.actuators),
        resistance_count=len(space.resistances),
        output_count=len(space.outputs),
        has_features=bool(rows.features),
        measures_features=any(key in feature_keys for parts in measurement for _, key in parts),
        feature_lines=tuple((feature.key, _feature_source(feature)) for feature in rows.features),
        measurement_lines=tuple(
            f"y[:, {row}] = {_signal_sum(parts, feature_keys)}"
            for row, parts in enumerate(measurement)
            if parts
        ),
        regressor_lines=tuple(
            f"D[:, {row}, {index}] = {_signal_sum(parts, feature_keys)}"
            for row, table in enumerate(regressor)
            for index, parts in table.items()
        ),
        columns_measurement=literal(tuple(_as_floats(parts) for parts in measurement)),
        columns_regressor=literal(
            tuple({index: _as_floats(parts) for index, parts in table.items()} for table in regressor)
        ),
        base_lines=tuple(_base_source(rows, base) for base in model.base),
        physical_lines=tuple(
            (name, f"float(base[{column[name]}])") for name in model.identifiable if not nonlinear
        ),
        composite_summaries=tuple(f"{n} = {c.formula}" for n, c in rows.composites.items() if n != c.formula),
        nonlinear=nonlinear,
        directions=literal({r.body: 1.0 for r in space.resistances if r.asymmetric}),
        state_space_lines=tuple(_state_space_lines(space)),
        has_cubic=bool(space.springs),
    )


def column_units(rows: IdentificationRows) -> dict[str, str]:
    """Return the unit of every physical parameter and composite; a composite's is row over signal."""
    units = {parameter.name: parameter.unit for parameter in rows.spec.parameters}
    by_key = {signal.key: _signal_unit(signal, rows) for signal in rows.signals}
    for row in rows.rows:
        for term in row.terms:
            if term.parameter in rows.composites:
                signal = by_key.get(term.key, "1")
                units.setdefault(
                    term.parameter or "", row.unit if signal == "1" else f"({row.unit})/({signal})"
                )
    return units


def _base_source(rows: IdentificationRows, base: BaseParameter) -> str:
    parts = []
    for name, factor in base.combination:
        composite = rows.composites.get(name)
        if composite is None:
            parts.append((factor, f'p["{name}"]'))
            continue
        top, bottom = polynomial(composite.numerator), polynomial(composite.denominator)
        single = bottom == "1.0" and (factor == 1 or len(composite.numerator) == 1)
        parts.append((factor, top if single else f"({top}) / ({bottom})"))
    return weighted_sum(parts)


def polynomial(poly: PolyElement) -> str:
    """Return a polynomial in the physical parameters as source."""
    names = [symbol.name for symbol in poly.ring.symbols]
    terms = []
    for exponents, coefficient in poly.terms():
        factors = [
            f'p["{name}"]' if exponent == 1 else f'p["{name}"] ** {exponent}'
            for name, exponent in zip(names, exponents, strict=True)
            if exponent
        ]
        value = Fraction(int(coefficient.numerator), int(coefficient.denominator))
        terms.append((value, " * ".join(factors) or "1.0"))
    return weighted_sum(terms)


Parts = tuple[tuple[Exact, str], ...]


def _column_tables(
    rows: IdentificationRows, column: Mapping[str, int]
) -> tuple[list[Parts], list[dict[int, Parts]]]:
    """Sort every row's terms into its left-hand side and its columns; regrouped parameters have no column."""
    measurement: list[Parts] = []
    regressor: list[dict[int, Parts]] = []
    for row in rows.rows:
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


def _as_floats(parts: Parts) -> tuple[tuple[float, str], ...]:
    return tuple((float(coefficient), key) for coefficient, key in parts)


def _constants(model: BaseModel, space: StateSpace, units: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
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
        "ACTUATORS": tuple(
            {
                "key": b.actuator,
                "body": b.name,
                "unit": force_unit(b.motion, 0),
                "lever": lever_of[b.name],
            }
            for b in spec.bodies
            if b.actuator
        ),
        "PARAMETERS": tuple(p.name for p in spec.parameters if p.name not in spec.known),
        "KNOWN": dict(spec.known),
        "BASE_PARAMETERS": tuple(base.name for base in model.base),
        "IDENTIFIABLE": model.identifiable,
        "ABSENT": dict(model.absent),
        "COMPOSITES": {name: composite.formula for name, composite in rows.composites.items()},
        "UNITS": {**{p.name: p.unit for p in spec.parameters}, **base_units},
        "ROLES": {p.name: {"role": p.role, "bodies": p.bodies} for p in spec.parameters},
        "PARAMETER_SETS": {name: dict(table) for name, table in spec.parameter_sets.items()},
        "SIGNALS": tuple(_signal(signal, rows) for signal in rows.signals),
        "FEATURES": tuple(
            {
                "key": f.key,
                "function": f.function,
                "of": f.of if isinstance(f.of, str) else _as_floats(f.of),
                "times": f.times,
            }
            for f in rows.features
        ),
        "ROWS": tuple(_row(row, lever_of) for row in rows.rows),
        "FRICTION": tuple(
            {
                "body": r.body,
                "state": r.state,
                "coulomb_plus": r.coulomb_plus,
                "coulomb_minus": r.coulomb_minus,
                "offset": r.offset,
                "asymmetric": r.asymmetric,
            }
            for r in space.resistances
        ),
    }
    if space.springs:
        values["CUBIC_SPRINGS"] = tuple(
            {"parameter": s.parameter, "deflection": tuple((i, float(c)) for i, c in s.deflection)}
            for s in space.springs
        )
    return tuple((name, literal(value)) for name, value in values.items())


def _sensor(output: Output, spec: ChainSpec) -> dict[str, object]:
    sensor = output.sensor
    return {
        "key": sensor.key,
        "body": sensor.body,
        "deflection": sensor.deflection,
        "measures": sensor.measures,
        "unit": signal_unit(_motion(sensor.key, spec, (sensor,)), sensor.measures, 0),
    }


def _signal(signal: NeededSignal, rows: IdentificationRows) -> dict[str, object]:
    return {
        "key": signal.key,
        "sensor": signal.sensor,
        "actuator": signal.actuator,
        "derivative": signal.derivative,
        "unit": _signal_unit(signal, rows),
    }


def _signal_unit(signal: NeededSignal, rows: IdentificationRows) -> str:
    spec = rows.spec
    if signal.sensor is not None:
        measures = next(s.measures for s in rows.sensors if s.key == signal.sensor)
        return signal_unit(_motion(signal.sensor, spec, rows.sensors), measures, signal.derivative)
    if signal.actuator is not None:
        motion = next(body.motion for body in spec.bodies if body.actuator == signal.actuator)
        return force_unit(motion, signal.derivative)
    return "1"


def _motion(key: str, spec: ChainSpec, sensors: Iterable[Sensor]) -> Motion:
    """Return the kind of motion a sensor reads; a deflection is counted on its second body."""
    sensor = next(s for s in sensors if s.key == key)
    body = sensor.deflection[1] if sensor.deflection else sensor.body
    return next(b.motion for b in spec.bodies if b.name == body)


def _row(row: Row, lever_of: Mapping[str, float]) -> dict[str, object]:
    return {
        "name": row.name,
        "origin": row.origin,
        "bodies": row.bodies,
        "differentiated": row.differentiated,
        "order": row.order,
        "reversals": row.reversals,
        "unit": row.unit,
        "lever": lever_of[row.bodies[0]],
    }


def _signal_sum(parts: Parts, features: set[str]) -> str:
    def source(key: str) -> str:
        table = "f" if key in features else "s"
        return "1.0" if key == "1" else f'{table}["{key}"]'

    return weighted_sum((coefficient, source(key)) for coefficient, key in parts)


def _feature_source(feature: Feature) -> str:
    if isinstance(feature.of, tuple):
        total = weighted_sum((coefficient, f's["{key}"]') for coefficient, key in feature.of)
        return f"({total}) ** 3"
    value = f's["{feature.of}"]'
    source = {
        "sign": f"np.sign({value})",
        "forward": f"({value} > 0).astype(float)",
        "backward": f"({value} < 0).astype(float)",
    }[feature.function]
    return f'{source} * s["{feature.times}"]' if feature.times else source


def _state_space_lines(space: StateSpace) -> Iterable[str]:
    count = len(space.bodies)
    for index in range(count):
        yield f"A[{index}, {count + index}] = 1.0"
    for entry in space.a:
        yield from _entry_lines("A", entry)
    for name, entries in (("B", space.b), ("E", space.e)):
        for entry in entries:
            yield from _entry_lines(name, entry)
    for row, output in enumerate(space.outputs):
        for place, factor in output.combination:
            if output.order < 2:
                yield f"C[{row}, {place + count * output.order}] = {float(factor)!r}"
                continue
            for out, source in (("C", "A"), ("D", "B"), ("F", "E")):
                yield f"{out}[{row}, :] += {float(factor)!r} * {source}[{count + place}, :]"


def _entry_lines(matrix: str, entry: Entry) -> Iterable[str]:
    total = weighted_sum((c, "1.0" if name is None else f'p["{name}"]') for c, name in entry.form)
    total = f"({total})" if len(entry.form) > 1 else total
    line = f'{matrix}[{entry.row}, {entry.column}] += {total} / p["{entry.inertia}"]'
    if entry.direction is None:
        yield line
    else:
        body, sense = entry.direction
        relation = ">" if sense > 0 else "<"
        yield f'if d["{body}"] {relation} 0:'
        yield f"    {line}"
