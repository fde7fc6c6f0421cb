"""A trend as plain values, and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Group
from rich.text import Text

from modelgen.cli.project.trend_sources import Machine
from modelgen.cli.tables import table
from modelgen.runtime.parameters.rounded import with_interval
from modelgen.runtime.trend.thresholds import Z95
from modelgen.runtime.trend.trend import Change, QuantityTrend, Trend


def describe(machine: Machine, found: Trend) -> dict[str, Any]:
    """Return what has changed of a machine as plain values."""
    return {
        "machine": machine.name,
        "entries": list(found.labels),
        "changed": [one.series.name for one in found.changed],
        "quantities": [_quantity(one, found.labels) for one in found.quantities],
        "notes": [*machine.notes, *found.notes],
    }


def _quantity(one: QuantityTrend, labels: Sequence[str]) -> dict[str, Any]:
    series = one.series
    std = [math.hypot(a, b) for a, b in zip(series.noise.tolist(), series.drift.tolist(), strict=True)]
    return {
        "name": series.name,
        "unit": series.unit,
        "entries": [labels[k] for k in series.entries.tolist()],
        "values": series.values.tolist(),
        "std": std,
        "p_value": one.p_value,
        "changes": [_change(change, labels) for change in one.changes],
        "scatters": one.scatters,
        "scatter_std": one.scatter.between_std,
        "mean": one.scatter.value,
        "mean_std": one.scatter.std,
    }


def _change(change: Change, labels: Sequence[str]) -> dict[str, Any]:
    percent = 100.0 * change.difference / abs(change.before) if change.before else None
    return {
        "since": labels[change.entry],
        "until": None if change.last is None else labels[change.last],
        "before": change.before,
        "after": change.after,
        "difference": change.difference,
        "difference_percent": percent,
        "std": change.std,
        "interval_95": list(change.interval),
        "p_value": change.p_value,
    }


def trend_tables(described: Sequence[Mapping[str, Any]]) -> Group:
    """Lay out what `describe` says of each machine: what has changed first."""
    parts: list[Any] = []
    for one in described:
        entries = one["entries"]
        heading = f"{one['machine']}: {len(entries)} estimates, {entries[0]} to {entries[-1]}"
        ordered = sorted(one["quantities"], key=lambda quantity: not quantity["changes"])
        rows = [row for quantity in ordered for row in _rows(quantity)]
        parts.append(table(heading, ("", "last (95 %)", "change", ">p"), rows))
        parts += [Text(f"note: {text}") for text in one["notes"]]
        verdict = "nothing has changed" if not one["changed"] else f"changed: {', '.join(one['changed'])}"
        parts.append(Text(f"{one['machine']}: {verdict} (false alarms 5 %, all quantities together)\n"))
    return Group(*parts)


def _rows(quantity: Mapping[str, Any]) -> list[tuple[str, ...]]:
    value, reach = quantity["values"][-1], Z95 * quantity["std"][-1]
    name = quantity["name"] + (f" [{quantity['unit']}]" if quantity["unit"] else "")
    last = with_interval(value, value - reach, value + reach)
    scatter = quantity["scatter_std"]
    spread = f"scatters by {scatter:.2g} beyond its intervals" if quantity["scatters"] else ""
    if not quantity["changes"]:
        return [(name, last, spread or "none", _chance(quantity["p_value"]))]
    rows: list[tuple[str, ...]] = []
    for change in quantity["changes"]:
        by = with_interval(change["difference"], *change["interval_95"])
        percent = change["difference_percent"]
        share = "" if percent is None else f" ({percent:+.2g} %)"
        since, until = change["since"], change["until"]
        when = f"since {since}" if until is None else f"{since} to {until}"
        when = f"at {since} only" if since == until else when
        rows.append((name, last, f"{when}: {by}{share}", _chance(change["p_value"])))
        name = last = ""
    return rows + ([("", "", spread, "")] if spread else [])


def _chance(p_value: float) -> str:
    return "< 1e-6" if p_value < 1e-6 else f"{p_value:.2g}"
