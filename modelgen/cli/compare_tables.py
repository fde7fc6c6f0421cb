"""Results of `modelgen compare` as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, isfinite, log10
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from modelgen.cli.tables import table


def comparison_tables(described: dict[str, Any]) -> Group:
    """Lay out what `describe` says."""
    rows, gain_rows, notes = [], [], []
    for m in described["models"]:
        number = m["condition_number"]
        shown = ("", "") if number is None else (f"{number:.4g}", f"{m['cutoff_hz']:.4g}")
        rows.append((m["model"], str(m["order"]), *shown, ", ".join(m["base_parameters"])))
        gain_rows += [
            (m["model"], g["channel"], str(g["derivative"]), f"{g['gain']:.4g}") for g in m["gains"]
        ]
        notes += [Text(f"{m['model']}: {m['why']}")] if "why" in m else []
    if not rows:  # saved estimates only
        return Group(*_estimate_parts(described["estimates"])[1:])
    columns = ("model", ">order", ">condition", ">cut-off Hz", "base parameters")
    parts: list[Any] = [table("Models", columns, rows), *notes, Text("")]
    if gain_rows:
        title = "Noise: standard deviation after filter and differences, per unit"
        gain_columns = ("model", "channel", ">derivative", ">gain 1/s^derivative")
        parts.append(table(title, gain_columns, gain_rows))
    if described["regressors"]:
        parts.append(Text("\nRegressors", style="bold"))
    for r in described["regressors"]:
        parts.append(Text(f"{r['first']} and {r['second']}: {r['verdict']}"))
        parts += [Text(f"  {line}") for line in r["rows"]]
    if "estimates" in described:
        parts += _estimate_parts(described["estimates"])
    for title, found in described.get("yardsticks", {}).items():
        parts += [Text(""), *_yardstick_parts(title, found)]
    return Group(*parts)


def interval_text(low: float, high: float) -> str:
    """Return an interval with as many digits as distinguish its two ends."""
    width, size = high - low, max(abs(low), abs(high))
    digits = 4
    if 0.0 < width < size and isfinite(width):
        digits = min(max(digits, ceil(log10(size / width)) + 2), 12)
    return f"{low:.{digits}g} .. {high:.{digits}g}"


def _estimate_parts(found: dict[str, Any]) -> list[Any]:
    parts: list[Any] = [Text(""), _intervals("Estimates, 95 % intervals", found["parameters"]), Text("")]
    for c in found["consistency"]:
        verdict = "consistent" if c["consistent"] else "NOT consistent"
        line = (
            f"{c['first']} and {c['second']}: {verdict} (chi2 {c['chi2']:.3g}, {len(c['names'])} parameters, "
        )
        parts.append(Text(f"{line}p {c['p_value']:.3g})"))
    return parts


def _yardstick_parts(title: str, found: dict[str, Any]) -> list[Any]:
    methods = found["methods"]
    times = ("time", *(f"{entry['seconds']:.2f} s" for entry in methods))
    sources = {entry["method"]: entry["parameters"] for entry in methods}
    parts: list[Any] = [_intervals(f"{title}: 95 % intervals by method", sources, times)]
    parts += [Text(f"{entry['method']}: {entry['reason']}") for entry in methods if entry["reason"]]
    for entry in found["modes"]:
        modes = ", ".join(
            f"{m['frequency_hz']:.4g} Hz, damping ratio {m['damping_ratio']:.3g}" for m in entry["modes"]
        )
        parts.append(Text(f"modes, {entry['source']}: {modes or 'none found'}"))
    return parts


def _intervals(title: str, sources: Mapping[str, Any], *first: Sequence[str]) -> Table:
    """Return a table of intervals, a column a source, below the rows `first`."""
    rows = list(first)
    for name in dict.fromkeys(name for entry in sources.values() for name in entry):
        cells = [entry.get(name) for entry in sources.values()]
        rows.append((name, *(interval_text(*c["interval_95"]) if c else "-" for c in cells)))
    return table(title, ("parameter", *(f">{one}" for one in sources)), rows)
