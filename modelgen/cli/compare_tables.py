"""Results of `modelgen compare` as tables."""

from __future__ import annotations

from math import ceil, isfinite, log10
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from rich.console import Group

Justify = Literal["left", "right"]


def comparison_tables(described: dict[str, Any]) -> Group:
    """Lay out what `describe` says."""
    from rich.console import Group
    from rich.text import Text

    from modelgen.cli.tables import table

    columns: list[tuple[str, Justify]] = [("model", "left"), ("order", "right"), ("condition", "right")]
    columns += [("cut-off Hz", "right"), ("base parameters", "left")]
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
    parts: list[Any] = [table("Models", columns, rows), *notes, Text("")]
    gain_columns: list[tuple[str, Justify]] = [
        ("model", "left"),
        ("channel", "left"),
        ("derivative", "right"),
    ]
    gain_columns.append(("gain 1/s^derivative", "right"))
    if gain_rows:
        title = "Noise: standard deviation after filter and differences, per unit"
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
    from rich.text import Text

    from modelgen.cli.tables import table

    titles = list(found["parameters"])
    names = dict.fromkeys(name for entry in found["parameters"].values() for name in entry)
    columns: list[tuple[str, Justify]] = [("parameter", "left"), *((title, "right") for title in titles)]
    rows = []
    for name in names:
        cells = [found["parameters"][title].get(name) for title in titles]
        shown = [interval_text(*c["interval_95"]) if c else "-" for c in cells]
        rows.append((name, *shown))
    parts: list[Any] = [Text(""), table("Estimates, 95 % intervals", columns, rows), Text("")]
    for c in found["consistency"]:
        verdict = "consistent" if c["consistent"] else "NOT consistent"
        line = (
            f"{c['first']} and {c['second']}: {verdict} (chi2 {c['chi2']:.3g}, {len(c['names'])} parameters, "
        )
        parts.append(Text(f"{line}p {c['p_value']:.3g})"))
    return parts


def _yardstick_parts(title: str, found: dict[str, Any]) -> list[Any]:
    from rich.text import Text

    from modelgen.cli.tables import table

    methods = found["methods"]
    names = dict.fromkeys(name for entry in methods for name in entry["parameters"])
    columns: list[tuple[str, Justify]] = [("parameter", "left")]
    columns += [(entry["method"], "right") for entry in methods]
    rows = [("time", *(f"{entry['seconds']:.2f} s" for entry in methods))]
    for name in names:
        cells = [entry["parameters"].get(name) for entry in methods]
        shown = [interval_text(*c["interval_95"]) if c else "-" for c in cells]
        rows.append((name, *shown))
    parts: list[Any] = [table(f"{title}: 95 % intervals by method", columns, rows)]
    parts += [Text(f"{entry['method']}: {entry['reason']}") for entry in methods if entry["reason"]]
    for entry in found["modes"]:
        modes = ", ".join(
            f"{m['frequency_hz']:.4g} Hz, damping ratio {m['damping_ratio']:.3g}" for m in entry["modes"]
        )
        parts.append(Text(f"modes, {entry['source']}: {modes or 'none found'}"))
    return parts
