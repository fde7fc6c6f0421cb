"""What is printed, and intervals of estimates, as parts of a page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from modelgen.report.result_page import Interval, Part


def parts_of(printed: Any) -> list[Part]:
    """Return the parts of a page from what is printed: rich groups, tables and texts, or plain lines."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    from modelgen.report.result_page import ResultHeading, ResultTable

    if isinstance(printed, Group):
        return [part for one in printed.renderables for part in parts_of(one)]
    if isinstance(printed, (list, tuple)):
        return [part for one in printed for part in parts_of(one)]
    if isinstance(printed, Table):
        rows = zip(*(list(map(_plain, column.cells)) for column in printed.columns), strict=True)
        headings = tuple(_plain(column.header) for column in printed.columns)
        numeric = tuple(column.justify == "right" for column in printed.columns)
        return [ResultTable(_plain(printed.title or ""), headings, tuple(rows), numeric)]
    text = _plain(printed).strip("\n")
    if not text:
        return []
    return [ResultHeading(text) if isinstance(printed, Text) and printed.style == "bold" else text]


def _plain(cell: Any) -> str:
    from rich.text import Text

    return cell.plain if isinstance(cell, Text) else str(cell)


def intervals_of(estimates: Mapping[str, Any]) -> dict[str, list[Interval]]:
    """Return the 95 % intervals of each parameter that several estimates give, by its name and unit."""
    found: dict[str, list[Interval]] = {}
    for title, one in estimates.items():
        entries = {entry.name: entry for entry in (*one.parameters.identified, *one.parameters.physical)}
        for entry in entries.values():
            label = f"{entry.name} in {entry.unit}" if entry.unit else entry.name
            found.setdefault(label, []).append((title, entry.value, *entry.interval()))
    return {label: rows for label, rows in found.items() if len(rows) > 1}
