"""Text files whose columns cannot be recognised from the lines alone: layouts of certain instruments.

Each function takes the first lines of a file and returns its layout, or None where it is of another kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from modelgen.runtime.files.text_layout import Head, Layout, number_from, took_from
from modelgen.runtime.files.timestamps import is_long_count
from modelgen.runtime.files.units import split_titles, states_no_unit

# rows of metadata that TwinCAT Scope repeats in front of every group of channels with one column of times
SCOPE_ROWS = ("Name", "SymbolName", "Data-Type", "SampleTime[ms]", "VariableSize", "Unit")
DSPACE_NAMES, DSPACE_VALUES = "trace_names", "trace_values"


def twincat_scope(head: Head) -> Layout | None:
    """Return the layout of a TwinCAT Scope export: "Name" marks the columns of times, which are in ms.

    With "Full Timestamp" the times are counts of 100 ns.
    """
    rows = {cells[0]: (number, cells) for number, cells in head.lines[: head.first]}
    started = "Starttime of export" in rows or "StartRecord" in rows
    if "Name" not in rows or not (started or any(key in rows for key in SCOPE_ROWS[1:])):
        return None
    # the metadata of the whole recording starts with a line of the same name
    number, titles = max(
        ((n, cells) for n, cells in head.lines[: head.first] if cells[0] == "Name"),
        key=lambda row: len(row[1]),
        default=(0, ()),
    )
    titles = tuple([*titles, *([""] * head.width)][: head.width])
    if not any(titles[1:]):
        return None
    names: list[str] = []
    clocks, clock, count = {}, "", 0
    for title in titles:
        if title == "Name":
            clock = f"time ({count + 1})" if clock else "time"
            names.append(clock)
        else:
            names.append(title)
            if title:
                clocks[title] = clock
        count += names[-1].startswith("time")
    cells = head.lines[head.first][1]
    first = next(cell for cell in cells if number_from(cell, head.decimal_comma) is not None)
    full = is_long_count(first)
    stamps = dict.fromkeys(clocks.values(), first) if full else {}
    units = dict.fromkeys(clocks.values(), "100ns" if full else "ms")
    unit_row = rows.get("Unit", (0, ()))[1]
    for title, unit in zip(names, unit_row, strict=False):
        if title in clocks and not states_no_unit(unit):
            units[title] = unit
    several = len(dict.fromkeys(clocks.values())) > 1
    layout = _layout(head, names, units, clocks if several else {}, ragged=True)
    return _with_took(replace(layout, stamps=stamps), "a TwinCAT Scope export", number)


def dspace_recorder(head: Head) -> Layout | None:
    """Return the layout of a dSPACE ControlDesk export: the first column names the contents of a line."""
    rows = {cells[0]: (number, cells) for number, cells in head.lines}
    if DSPACE_NAMES not in rows or DSPACE_VALUES not in rows:
        return None
    number, cells = rows[DSPACE_NAMES]
    names = ["", *([*cells[1:], *([""] * head.width)][: head.width - 1])]
    # the first trace is the time axis, whose name is empty or that of the task
    names[1] = names[1] if names[1] and names[1].lower() in ("time", "t") else "time"
    unit_row = next((rows[key][1] for key in ("unit", "units") if key in rows), ())
    stated = zip(names, unit_row, strict=False)
    units = {name: unit for name, unit in stated if name and not states_no_unit(unit)}
    units.setdefault(names[1], "s")
    # the first line of samples carries the label, the others start with an empty cell
    layout = _layout(head, names, units, {}, ragged=False, first_line=rows[DSPACE_VALUES][0])
    return _with_took(layout, "a dSPACE ControlDesk export", number)


def tektronix_tds(head: Head) -> Layout | None:
    """Return the layout of an older Tektronix scope: metadata and samples side by side, no line of names."""
    first = head.lines[0][1]
    if first[0] != "Record Length" or len(first) < 5:
        return None
    rows = {cells[0]: cells for _, cells in head.lines[:30]}
    source = rows.get("Source", ("", "CH1"))[1] or "CH1"
    units = {"time": rows.get("Horizontal Units", ("", "s"))[1] or "s"}
    vertical = rows.get("Vertical Units", ("", ""))[1]
    if vertical:
        units[source] = vertical
    layout = _layout(head, ["", "", "", "time", source], units, {}, ragged=False, first_line=head.lines[0][0])
    return _with_took(layout, "a Tektronix TDS export: samples in columns 4 and 5", head.lines[0][0])


def rigol(head: Head) -> Layout | None:
    """Return the layout of a Rigol scope: X counts samples, the second line states start and increment."""
    if len(head.lines) < 3:
        return None
    titles, units_row = head.lines[0][1], head.lines[1][1]
    fs = stated_frequency(head)
    if fs is None or not (titles[0] == "X" and "Increment" in titles and units_row[0] == "Sequence"):
        return None
    names = [name if name and name not in ("Start", "Increment") else "" for name in titles[: head.width]]
    names[0] = ""
    units = {name: units_row[i] for i, name in enumerate(names) if name and units_row[i : i + 1]}
    layout = _layout(head, names, units, {}, ragged=False)
    took = f"a Rigol export: no times, {fs:.9g} Hz by the increment in line 2"
    return _with_took(layout, took, head.lines[0][0])


def rigol_increment(head: Head) -> Layout | None:
    """Return the layout of a newer Rigol scope: the line of names ends with the start and the increment."""
    titles = head.lines[0][1]
    fs = stated_frequency(head)
    if fs is None or not any(title.startswith("tInc") for title in titles):
        return None
    first = [*head.lines[head.first][1], *([""] * head.width)]
    pairs = split_titles(titles[: head.width])
    names = [name if cell else "" for (name, _), cell in zip(pairs, first, strict=False)]
    units = {name: unit for (name, unit), cell in zip(pairs, first, strict=False) if unit and cell}
    layout = _layout(head, names, units, {}, ragged=False)
    took = f"a Rigol export: no times, {fs:.9g} Hz by the increment in line 1"
    return _with_took(layout, took, head.lines[0][0])


def yokogawa(head: Head) -> Layout | None:
    """Return the layout of a Yokogawa scope: a row of metadata a line, samples behind an empty cell."""
    rows = {cells[0]: (number, cells) for number, cells in head.lines[: head.first]}
    fs = stated_frequency(head)
    if fs is None or "TraceName" not in rows or "HResolution" not in rows:
        return None
    number, titles = rows["TraceName"]
    names = ["", *([*titles[1:], *([""] * head.width)][: head.width - 1])]
    unit_row = rows.get("VUnit", (0, ()))[1]
    units = {name: unit for name, unit in zip(names, unit_row, strict=False) if name and unit}
    layout = _layout(head, names, units, {}, ragged=False)
    took = f"a Yokogawa export: no times, {fs:.9g} Hz by HResolution"
    return _with_took(layout, took, number)


def stated_frequency(head: Head) -> float | None:
    """Return the sampling frequency in Hz that the lines above the samples state, None where they do not."""
    titles = head.lines[0][1]
    stated = [title.partition("=")[2] for title in titles if title.startswith("tInc")]
    if titles[0] == "X" and "Increment" in titles and len(head.lines) > 1:
        place = titles.index("Increment")
        stated += head.lines[1][1][place : place + 1]
    stated += [
        cell for _, cells in head.lines[: head.first] if cells[0] == "HResolution" for cell in cells[1:2]
    ]
    steps = [number_from(cell, head.decimal_comma) for cell in stated]
    return 1.0 / steps[0] if steps and steps[0] and 0.0 < steps[0] < inf else None


DIALECTS = (twincat_scope, dspace_recorder, tektronix_tds, rigol, rigol_increment, yokogawa)


def _layout(
    head: Head,
    names: Sequence[str],
    units: dict[str, str],
    clocks: dict[str, str],
    ragged: bool,
    first_line: int | None = None,
) -> Layout:
    header_line = (first_line or head.lines[head.first][0]) - 1
    return Layout(
        head.path,
        head.encoding,
        header_line,
        head.separator,
        head.decimal_comma,
        tuple(names),
        units,
        clocks,
        ragged,
    )


def _with_took(layout: Layout, kind: str, names_line: int) -> Layout:
    return replace(layout, took=(kind, *took_from(layout, names_line)))
