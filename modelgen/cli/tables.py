"""The output of commands, as plain values for --json and as rich tables.

Each pair of functions belongs together: `describe_...` turns a result into dicts and lists, and `..._tables`
lays those out. Nothing is computed here.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from modelgen.errors import listed, signed_sum
from modelgen.progress import is_terminal

if TYPE_CHECKING:
    from modelgen.symbolic.base_parameters import BaseModel
    from modelgen.symbolic.equations.newton import Equation, MotionEquations
    from modelgen.symbolic.equations.signals import Exact, Signal
    from modelgen.symbolic.sensor_set_overview import SetSummary

#: Coefficients with a larger denominator are shown as decimals.
LARGEST_DENOMINATOR = 1000
#: What exact algebra promises is an upper bound.
WITHOUT_NOISE = "without noise of the sensors (modelgen design says what noise leaves)"
#: Characters of a formula that a person still reads.
TWO_LINES = 160
PRIMES = ("", "'", "''")
Description = dict[str, Any]


def console() -> Console:
    """Return the console on stdout; what is piped into a file is wider than the 80 columns rich assumes."""
    narrow = not is_terminal(sys.stdout) and "COLUMNS" not in os.environ
    return Console(width=120 if narrow else None, highlight=False)


def table(title: str, headings: Iterable[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a plain table; columns whose heading begins with > stand at the right."""
    result = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for heading in headings:
        result.add_column(heading.removeprefix(">"), justify="right" if heading.startswith(">") else "left")
    for row in rows:
        result.add_row(*(Text(cell) for cell in row))
    return result


def describe_chain(
    motion: MotionEquations, found: Sequence[SetSummary], proved: bool | None = None
) -> Description:
    """Return a chain's equations and what each sensor set makes of them, as plain values."""
    return {
        "chain": motion.spec.name,
        "title": motion.spec.title,
        "equations": [{"body": e.body, "equation": _equation_text(e)} for e in motion.equations],
        "newton_equals_lagrange": proved,
        "known": dict(motion.spec.known),
        "sensor_sets": [_describe_set(summary) for summary in found],
    }


def chain_tables(described: Description) -> Group:
    """Lay out what `describe_chain` says: a single sensor set in detail, several side by side."""
    known = [f"known: {name} = {value!r}" for name, value in described["known"].items()]
    equations = [f"  {entry['equation']}" for entry in described["equations"]]
    head = [f"{described['chain']}: {described['title']}", "", "Equations of motion", *equations, *known]
    if described["newton_equals_lagrange"] is not None:
        word = "equal" if described["newton_equals_lagrange"] else "DO NOT equal"
        head.append(f"proved: the Newton-Euler equations {word} those of Lagrange with Rayleigh dissipation")
    sets = described["sensor_sets"]
    parts = _model_tables(sets[0]) if len(sets) == 1 else _overview(sets)
    return Group(*(Text(line) for line in head), *parts)


def _overview(sets: Sequence[Description]) -> list[Table | Text]:
    columns = ("sensors", "rows", ">order", ">columns", "identifiable", "lost")
    lines = []
    for entry in sets:
        if "reason" in entry:
            lines.append((entry["sensor_set"], "none", "", "", entry["reason"], ", ".join(entry["lost"])))
            continue
        rows, identifiable = entry["rows"], entry["identifiable"]
        lines.append(
            (
                entry["sensor_set"],
                ", ".join(row["name"] + "'" * row["differentiated"] for row in rows),
                str(max(row["order"] for row in rows)),
                str(len(entry["base_parameters"])),
                ", ".join(identifiable) or "none",
                ", ".join(entry["lost"]) or "-",
            )
        )
    legend = [
        "rows: bodies whose equations a row holds; a prime for each time it is differentiated",
        "order: highest derivative of a coordinate; columns: base parameters",
        "lost: identifiable with a position sensor on every body, but not with this set",
        "modelgen show SPEC --sensors S shows one set in detail",
    ]
    title = f"Sensor sets, {WITHOUT_NOISE}"
    return [Text(""), table(title, columns, lines), Text(""), *(Text(line) for line in legend)]


def _describe_set(summary: SetSummary) -> Description:
    if summary.model is None:
        return {"sensor_set": summary.name, "reason": summary.reason, "lost": list(summary.lost)}
    return {**_describe_model(summary.model), "lost": list(summary.lost)}


def _describe_model(model: BaseModel) -> Description:
    from modelgen.render.units import column_units

    units = column_units(model.rows)
    return {
        "sensor_set": model.rows.sensor_set,
        "sensors": [
            {
                "key": sensor.key,
                "body": sensor.body,
                "deflection": list(sensor.deflection) if sensor.deflection else None,
                "measures": sensor.measures,
            }
            for sensor in model.rows.sensors
        ],
        "signals": [signal.key for signal in model.rows.signals],
        "rows": [
            {
                "name": row.name,
                "origin": row.origin,
                "order": row.order,
                "differentiated": row.differentiated,
                "unit": row.unit,
                "columns": [
                    base.name
                    for base in model.base
                    if base.combination[0][0] in [term.parameter for term in row.terms]
                ],
            }
            for row in model.rows.rows
        ],
        "base_parameters": [
            {"name": base.name, "unit": units[base.combination[0][0]]} for base in model.base
        ],
        "composites": {name: composite.formula for name, composite in model.rows.composites.items()},
        "identifiable": list(model.identifiable),
        "absent": dict(model.absent),
    }


def _model_tables(described: Description) -> list[Table | Text]:
    sensors = ", ".join(
        f"{sensor['key']} ({sensor['measures']} of {sensor['body'] or ' - '.join(sensor['deflection'])})"
        for sensor in described["sensors"]
    )
    rows = table(
        "Rows",
        ("row", "origin", ">order", ">differentiated", "columns"),
        [
            (r["name"], r["origin"], str(r["order"]), str(r["differentiated"]), ", ".join(r["columns"]))
            for r in described["rows"]
        ],
    )
    base = table(
        "Base parameters",
        (">column", "base parameter", "unit"),
        [(str(i), b["name"], b["unit"]) for i, b in enumerate(described["base_parameters"])],
    )
    answered = Text(f"\nidentifiable {WITHOUT_NOISE}: {', '.join(described['identifiable']) or 'none'}")
    absent = [Text(f"not identifiable: {name}: {why}") for name, why in described["absent"].items()]
    given = [signal for signal in described["signals"] if signal.startswith("sign_")]
    asked = f"directions that the records must bring, or identify --direction name: {', '.join(given)}"
    formulas = _formulas(described["composites"])
    head = Text(f"\nSensors {described['sensor_set']}: {sensors}\n", style="bold")
    return [head, rows, Text(""), base, *formulas, answered, *absent, *([Text(asked)] if given else [])]


def _formulas(composites: Mapping[str, str]) -> list[Text]:
    """Return the formulas of short symbols that fit on two lines, and where the others are."""
    shown = {name: f"{name} = {formula}" for name, formula in composites.items() if name != formula}
    long = [name for name, text in shown.items() if len(text) > TWO_LINES]
    lines = [Text(text) for name, text in shown.items() if name not in long]
    if long:
        said = "have formulas" if len(long) > 1 else "has a formula"
        lines.append(Text(f"{listed(long)} {said} of more than two lines, which --json holds"))
    return lines


def _equation_text(equation: Equation) -> str:
    """Return "Gamma_m = J_m q_m'' + K (q_m - q_c)": a parameter once, with all it multiplies of one order."""
    grouped: dict[tuple[str | None, str, int], list[tuple[Exact, str]]] = {}
    for term in equation.terms:
        key = (term.parameter, term.signal.kind, term.signal.order)
        grouped.setdefault(key, []).append((term.coefficient, _signal_text(term.signal)))
    left = [_sum_text(parts) for (parameter, _, _), parts in grouped.items() if parameter is None]
    right = [_product_text(parameter, parts) for (parameter, _, _), parts in grouped.items() if parameter]
    return f"{' + '.join(left) or '0'} = {' + '.join(right).replace('+ -', '- ')}"


def _product_text(parameter: str, parts: Sequence[tuple[Exact, str]]) -> str:
    if len(parts) > 1:
        return f"{parameter} ({_sum_text(parts)})"
    coefficient, signal = parts[0]
    size = "" if abs(coefficient) == 1 else f"{_size_text(coefficient)} "
    return f"{'-' if coefficient < 0 else ''}{size}{parameter}{f' {signal}' if signal else ''}"


def _size_text(coefficient: Exact) -> str:
    """Return a magnitude as a short fraction, or rounded where the fraction is no help to the eye."""
    size = coefficient if coefficient > 0 else -coefficient
    return str(size) if size.denominator <= LARGEST_DENOMINATOR else f"{float(size):.6g}"


def _sum_text(parts: Sequence[tuple[Exact, str]]) -> str:
    parts = sorted(parts, key=lambda part: part[0] < 0)  # q_c - q_m reads better than -q_m + q_c
    return signed_sum((c < 0, signal if abs(c) == 1 else f"{_size_text(c)} {signal}") for c, signal in parts)


def _signal_text(signal: Signal) -> str:
    if signal.kind == "one":
        return ""
    if signal.kind == "force":
        return signal.name
    if signal.kind == "cube":
        return f"(deflection of link {int(signal.name) + 1})^3"
    if signal.kind == "coordinate":
        return f"q_{signal.name}{PRIMES[signal.order]}"
    motion = f" q_{signal.name}{PRIMES[signal.order]}" if signal.order else ""
    return f"{signal.kind}(q_{signal.name}'){motion}"
