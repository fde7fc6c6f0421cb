"""The short answer: parameters with the digits that they have, modes, a verdict, and what to do next."""

from __future__ import annotations

import html
import re
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from modelgen.errors import listed, shortened, visible
from modelgen.runtime.modes.mode_values import PairValues
from modelgen.runtime.modes.modes import Antiresonance, Mode, cells, peak_hz, posture_ranges, shown
from modelgen.runtime.parameters.grouped_reasons import grouped_reasons
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.rounded import with_interval
from modelgen.runtime.results.thresholds import COLUMNS, MANY, REASON
from modelgen.runtime.results.verdict import verdict

if TYPE_CHECKING:
    from modelgen.runtime.results.estimate import Estimate

NAME = 30  # characters of a base parameter's formula


def answer_text(estimate: Estimate) -> str:
    """Return the answer in about ten lines of at most 80 characters, ending with a newline."""
    judged = verdict(estimate)
    lines = [
        *_wrapped(f"{estimate.model}, records {listed(estimate.records, most=3)}", ""),
        *_parameters(asked_for(estimate)),
        *numbered_lines(estimate),
        *known_lines(estimate),
        *modes_lines(estimate),
        *refused_lines(estimate),
        *_wrapped(f"Verdict: {judged.word} - {_sentence(judged.reasons[0])}", "  "),
    ]
    if judged.action:
        lines += _wrapped(f"Next: {judged.action}.", "  ")
    further = len(judged.reasons) - 1
    if further:
        lines.append(f"{further} further finding{'s' * (further > 1)}: --details, or summary() in Python.")
    return "\n".join(lines) + "\n"


def answer_html(estimate: Estimate) -> str:
    """Return the answer as HTML for notebooks; every text in it is escaped."""
    judged = verdict(estimate)
    rows = "".join(
        f"<tr><th>{html.escape(entry.name)}</th><td>{html.escape(plus_minus(entry))}</td>"
        f"<td>{html.escape(entry.unit)}</td></tr>"
        for entry in asked_for(estimate)
    )
    below = [
        *(
            line.strip()
            for line in (*numbered_lines(estimate), *known_lines(estimate), *modes_lines(estimate))
        ),
        *refused_lines(estimate),
    ]
    said = "".join(f"<p>{html.escape(line)}</p>" for line in below)
    why = html.escape(_sentence(judged.reasons[0]))
    action = f" Next: {html.escape(judged.action)}." if judged.action else ""
    return (
        f"<p><strong>{judged.word.capitalize()}:</strong> {why}{action}</p>"
        "<table><thead><tr><th>parameter</th><th>value, 95 %</th><th>unit</th></tr></thead>"
        f"<tbody>{rows}</tbody></table>{said}"
    )


def asked_for(estimate: Estimate) -> tuple[Parameter, ...]:
    """Return the physical parameters, and base parameters that hold more than these say.

    Beside physical parameters composites that a number stands for, their formulas being long, are left out.
    """
    more = set(_numbered(estimate)) if estimate.parameters.physical else set()
    combined = [entry for entry in _beyond_physical(estimate) if entry.name not in more]
    return (*estimate.parameters.physical, *combined)


def _beyond_physical(estimate: Estimate) -> list[Parameter]:
    """Return base parameters that hold parameters without a value, all where no parameter has one."""
    found = estimate.parameters
    named = {entry.name for entry in found.physical}
    formulas = {**estimate.model.composites, **estimate.model.groupings}
    return [
        entry
        for entry in found.identified
        if entry.name not in named
        and (
            not found.physical
            or any(
                name in found.not_identifiable
                for name in re.findall(r"\w+", formulas.get(entry.name, entry.name))
            )
        )
    ]


def _numbered(estimate: Estimate) -> list[str]:
    """Return the composites with values that have a number as their name, such as C15."""
    formulas = estimate.model.composites
    names = [entry.name for entry in _beyond_physical(estimate)]
    return [name for name in names if formulas.get(name, name) != name]


def numbered_lines(estimate: Estimate) -> list[str]:
    """Return how many composites of long formulas are left out, in one line; none where there are none."""
    names = _numbered(estimate) if estimate.parameters.physical else []
    if not names:
        return []
    some = names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"
    what = "composite of a long formula" if len(names) == 1 else "composites of long formulas"
    return _wrapped(f"  and {len(names)} {what} ({some}): --details, or summary() in Python", "    ")


def plus_minus(entry: Parameter) -> str:
    """Return a value with its 95 % interval, rounded by it."""
    return with_interval(entry.value, *entry.interval())


def _parameters(entries: Sequence[Parameter]) -> list[str]:
    names = [shortened(visible(entry.name), NAME) for entry in entries]
    width = max(map(len, names), default=0)
    lines = [
        f"  {name.ljust(width)}  {plus_minus(entry)} {entry.unit}".rstrip()
        for name, entry in zip(names, entries, strict=True)
    ]
    half = COLUMNS // 2
    if len(lines) <= MANY or max(map(len, lines)) >= half:
        return [line + " (95 %)" for line in lines]
    rows = (len(lines) + 1) // 2
    right = [*lines[rows:], ""]
    return [
        "  with 95 % intervals:",
        *(f"{a.ljust(half)}{b}".rstrip() for a, b in zip(lines[:rows], right, strict=False)),
    ]


def known_lines(estimate: Estimate) -> list[str]:
    """Return what was known and not estimated, in one line; none where there is no such parameter."""
    known = [f"{visible(name)} = {value:.6g}" for name, value in estimate.model.known.items()]
    return _wrapped(f"  known, not estimated: {listed(known, most=6)}", "    ") if known else []


def modes_lines(estimate: Estimate) -> list[str]:
    """Return a line for every mode, one for the antiresonances, and what is to be said of them."""
    found = estimate.modes()
    lines = [line for mode in found for line in _wrapped(f"  mode: {_mode(mode)}", "    ")]
    by_actuator: dict[str, list[Antiresonance]] = {}
    for zero in found.antiresonances:
        by_actuator.setdefault(zero.actuator, []).append(zero)
    for actuator, zeros in by_actuator.items():
        values = ", ".join(shown(zero.frequency_hz) for zero in zeros if zero.frequency_hz)
        lines += _wrapped(f"  antiresonance of {actuator}: {values} Hz", "    ")
    for one in posture_ranges(found):
        text = f"mode, motors {one.motors}: {_hertz(one.low)} to {_hertz(one.high)} Hz over the postures"
        lines += _wrapped(f"  {text}", "    ")
    return [*lines, *(line for note in found.notes for line in _wrapped(f"  {note}", "    "))]


def _hertz(one: PairValues) -> str:
    return shown(one.frequency_hz) if one.frequency_hz else "0"


def _mode(mode: Mode) -> str:
    constants = ", ".join(shown(value) for value in mode.time_constants_s)
    if mode.frequency_hz is None:
        return f"free motion, time constant {constants} s" if constants else "free motion, 0 Hz"
    text = _frequency(mode) + (f", measured peak {peak_hz(mode)}" if mode.measured else "")
    return f"{text}; overdamped, time constants {constants} s" if constants else text


def _frequency(one: PairValues) -> str:
    hertz, radians, damping, _ = cells(one)
    return f"{hertz} Hz ({radians} rad/s)" + ("" if damping == "-" else f", damping ratio {damping}")


def refused_lines(estimate: Estimate) -> list[str]:
    """Return what has no number: names with one kind of reason share a line, with the reason of the first."""
    return [
        line
        for one in grouped_reasons(estimate.unanswered)
        # cut at the end, between words: half a number is none
        for line in _wrapped(
            f"No number for {one.who}: {textwrap.shorten(one.why, REASON, placeholder=' ...')}", "  "
        )
    ]


def _sentence(text: str) -> str:
    return text if text.endswith(".") else f"{text}."


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(
        visible(text), COLUMNS, initial_indent="", subsequent_indent=indent, break_on_hyphens=False,
        drop_whitespace=True,
    )  # fmt: skip
