"""What a command prints, as one HTML page: tables, sentences, intervals side by side, signals at any zoom."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

import modelgen
from modelgen.report.html import rendered
from modelgen.report.plots import zoomable
from modelgen.report.svg import axis_for, interval_plot
from modelgen.runtime.simulation.validation import Validation

#: label, value, low and high end of an interval
Interval = tuple[str, float, float, float]


@dataclass(frozen=True)
class ResultTable:
    """A table: its title, headings, rows of texts, and for each column whether it is numbers."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: tuple[bool, ...]


@dataclass(frozen=True)
class ResultHeading:
    """A heading between parts of a page."""

    text: str


Part = ResultTable | ResultHeading | str


def result_page(
    title: str,
    command: str,
    parts: Sequence[Part],
    options: Mapping[str, str],
    intervals: Mapping[str, Sequence[Interval]] | None = None,
    validations: Sequence[Validation] = (),
) -> str:
    """Return a page as HTML; the same inputs give the same bytes.

    Parameters
    ----------
    title : str
    command : str
        What the page is the result of.
    parts : sequence of ResultTable, ResultHeading or str
        A text is a paragraph.
    options : mapping of str to str
        What the user asked for.
    intervals : mapping of str to sequence of intervals, optional
        By parameter, with its unit: 95 % intervals that are drawn side by side.
    validations : sequence of Validation, optional
        Measured and simulated signals, drawn by the page's script.
    """
    facts = [
        ("command", command),
        ("modelgen", modelgen.__version__),
        ("Python, NumPy", f"{platform.python_version()}, {np.__version__}"),
        *options.items(),
    ]
    return rendered(
        "result.html.j2",
        zoomable((), validations),
        title=title,
        parts=[(type(part).__name__, part) for part in parts],
        pictures=[_picture(name, rows) for name, rows in (intervals or {}).items() if rows],
        facts=facts,
    )


def _picture(name: str, rows: Sequence[Interval]) -> Markup:
    ends = np.array([row[1:] for row in rows], dtype=float)
    told = [row for row in rows if np.isfinite(row[1:]).all()]
    return interval_plot(axis_for(name, [ends]), told, f"95 % intervals of {name}")
