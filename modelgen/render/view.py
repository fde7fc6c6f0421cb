"""The variables of the template: plain strings and tuples, nothing symbolic."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

from sympy.polys.rings import PolyElement

from modelgen.render.constants import Parts, as_floats, column_tables, module_constants
from modelgen.render.printer import literal, weighted_sum
from modelgen.render.state_space_lines import state_space_lines
from modelgen.render.units import column_units
from modelgen.symbolic.base_parameters import BaseModel, BaseParameter
from modelgen.symbolic.equations.newton import motion_equations
from modelgen.symbolic.equations.row import Feature, IdentificationRows
from modelgen.symbolic.equations.state_space import state_space

SAFE_FILE_NAME = re.compile(r"[A-Za-z0-9_.-]{1,100}\Z")


def model_view(model: BaseModel) -> dict[str, Any]:
    """Return all that a template prints: constants as (name, source), functions as lines of source."""
    rows, spec = model.rows, model.rows.spec
    space = state_space(motion_equations(spec), rows.sensors)
    column = {base.combination[0][0]: index for index, base in enumerate(model.base)}
    units = column_units(rows)
    nonlinear = bool(rows.composites)
    measurement, regressor = column_tables(model)
    feature_keys = {feature.key for feature in rows.features}
    return dict(
        chain=spec.name,
        sensor_set=rows.sensor_set,
        source=spec.source if SAFE_FILE_NAME.match(spec.source) else f"{spec.name}.toml",
        sha256=spec.sha256,
        row_summaries=tuple(f"{i}. {r.name}: {r.origin}; order {r.order}" for i, r in enumerate(rows.rows)),
        base_summaries=tuple(f"{b.name} [{units[b.combination[0][0]]}]" for b in model.base),
        absent_summaries=tuple(f"{name}: {reason}" for name, reason in model.absent.items()),
        constants=module_constants(model, space, units),
        first_key=next(signal.key for signal in rows.signals),
        row_count=len(rows.rows),
        column_count=len(model.base),
        state_count=2 * len(space.bodies),
        actuator_count=len(space.actuators),
        resistance_count=len(space.resistances),
        output_count=len(space.outputs),
        has_features=bool(rows.features),
        # friction of known size stands on the left-hand side
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
        columns_measurement=literal(tuple(as_floats(parts) for parts in measurement)),
        columns_regressor=literal(
            tuple({index: as_floats(parts) for index, parts in table.items()} for table in regressor)
        ),
        base_lines=tuple(_base_source(rows, base) for base in model.base),
        physical_lines=tuple(
            (name, f"float(base[{column[name]}])") for name in model.identifiable if not nonlinear
        ),
        composite_summaries=tuple(f"{n} = {c.formula}" for n, c in rows.composites.items() if n != c.formula),
        nonlinear=nonlinear,
        directions=literal({r.body: 1.0 for r in space.resistances if r.asymmetric}),
        state_space_lines=tuple(state_space_lines(space)),
        has_cubic=bool(space.springs),
    )


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
