"""Plain-text summary of an estimate: a pure function from numbers to lines."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from modelgen.errors import aligned, listed
from modelgen.runtime.parameters.grouped_reasons import grouped_reasons
from modelgen.runtime.results.check_tables import CheckTable, check_tables

if TYPE_CHECKING:
    from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.parameters.parameter import Parameter

WIDTH = 100
INTERVAL_KINDS = {
    "hac": "Standard deviations add in squares: noise, allowing for coloured residuals of changing size "
    "(Newey-West), and drift with cut-off and weights. Eq. (11) is for white residuals only.",
    "printed": "Standard deviations and intervals are the paper's, eq. (11): for white residuals only.",
}
ERRORS = (
    "Errors in % of the row's force, or of its largest term where it holds none; the relative error above is "
    "that of all rows together, weighted."
)
DEGREES_OF_FREEDOM = {"r-c": "r - c", "r-1": "r - 1, not as in eq. (11)"}


def summary_text(estimate: Estimate) -> str:
    """Return the summary of an estimate, ending with a newline."""
    parts = [
        _heading(estimate),
        _table(_parameter_rows(estimate)),
        _sentences("Sums of parameters", _groupings(estimate)),
        textwrap.wrap(INTERVAL_KINDS[estimate.fit.covariance_kind], WIDTH, break_on_hyphens=False),
        _composites(estimate),
        _physical(estimate),
        _quality(estimate),
        _refused(estimate),
        _rows(estimate),
        _pruning(estimate),
        _sentences("Filters", estimate.fit.filtering.sentences),
        _sentences("Notes", estimate.fit.filtering.notes + estimate.fit.notes),
        *(_titled(table) for table in check_tables(estimate.checks)),
        _sentences("Warnings", [advice.sentence for advice in estimate.checks.advice]),
    ]
    return "\n\n".join("\n".join(part) for part in parts if part) + "\n"


def _heading(estimate: Estimate) -> list[str]:
    known = [f"{name} = {value:.6g}" for name, value in estimate.model.known.items()]
    return [
        f"{estimate.model}: {estimate.fit.method} ({estimate.fit.method_title})",
        f"Records: {', '.join(estimate.records)}",
        *([f"Known, not estimated: {', '.join(known)}"] if known else []),
    ]


def _parameter_rows(estimate: Estimate) -> list[list[str]]:
    intervals = estimate.conf_int()
    detailed = estimate.fit.covariance_kind == "hac"
    header = ["parameter", "unit", "value", "std. dev.", "%", "95 % from", "to"]
    periods = estimate.checks.periods
    named = (["noise", "drift", "eq. (11)"] if detailed else []) + (["periods"] if periods else [])
    rows = [header + named]
    hidden = _told_otherwise(estimate)
    for index, entry in enumerate(estimate.parameters.identified):
        if entry.name in hidden:
            continue
        parts = [entry.noise_std, entry.drift_std, entry.printed_std] if detailed else []
        parts += [periods.std[index]] if periods else []
        interval = [_number(bound) for bound in intervals[entry.name]]
        rows.append([*_leading(entry), *interval, *(_number(part, 3) for part in parts)])
    return rows


def _told_otherwise(estimate: Estimate) -> tuple[str, ...]:
    """Return the composites by a short symbol that are given in place of physical parameters."""
    symbols = [
        entry.name for entry in estimate.parameters.identified if entry.name in estimate.model.composites
    ]
    return tuple(symbols) if estimate.parameters.physical else ()


def _groupings(estimate: Estimate) -> list[str]:
    """Return what the short names of sums stand for."""
    return [
        f"{name} = {sum_of}" for name, sum_of in estimate.model.groupings.items() if name in estimate.params
    ]


def _composites(estimate: Estimate) -> list[str]:
    """Return what became of composites whose formulas are too long for a name."""
    symbols = [name for name in estimate.model.composites if name in estimate.params]
    if not symbols:
        return []
    told = _told_otherwise(estimate)
    said = "the physical parameters below say what they hold" if told else "no physical parameter follows"
    text = f"Composites of them: {listed(symbols)}; {said}; formulas and values are in the JSON (--output)."
    return textwrap.wrap(text, WIDTH)


def _leading(entry: Parameter) -> list[str]:
    value, spread = _number(entry.value), _number(entry.std, 4)
    return [entry.name, entry.unit, value, spread, _number(entry.relative_std, 3)]


def _physical(estimate: Estimate) -> list[str]:
    """Return the table of physical parameters, unless it would repeat the base parameters."""
    if all(entry.name in estimate.params for entry in estimate.parameters.physical):
        return []
    rows = [["physical", "unit", "value", "std. dev.", "%", "95 % from", "to"]]
    for entry in estimate.parameters.physical:
        rows.append([*_leading(entry), *(_number(bound) for bound in entry.interval())])
    return _table(rows)


def _quality(estimate: Estimate) -> list[str]:
    fit = estimate.fit
    return [
        f"Samples r = {estimate.nobs}, condition number {estimate.condition_number:.4f} with columns of unit "
        f"length, {fit.condition_number_raw:.4f} as they are",
        f"Error norm {fit.error_norm:.4f}, relative error {100.0 * fit.relative_error:.4f} %, "
        f"sigma {fit.sigma:.4f} over {DEGREES_OF_FREEDOM[fit.residual_dof]}",
        *(_delay(name, delay, estimate.delay_std.get(name)) for name, delay in estimate.delays.items()),
    ]


def _delay(name: str, delay: float, std: float | None) -> str:
    spread = "" if std is None else f", standard deviation {1e6 * std:.2g} us"
    return f"Delay of {name}: {1e6 * delay:.1f} us{spread}"


def _refused(estimate: Estimate) -> list[str]:
    reasons = dict(estimate.unanswered)
    lines = []
    if estimate.model.groupings:  # of most parameters of an arm their sums say the same
        grouped = [
            name for name, reason in reasons.items() if reason.startswith(("no motion", "only in comb"))
        ]
        reasons = {name: reason for name, reason in reasons.items() if name not in grouped}
        lines = [f"by themselves: {', '.join(grouped)}"] if grouped else []
    lines += [f"{one.who}: {one.why}" for one in grouped_reasons(reasons)]
    return _sentences("Not identifiable", lines)


def _rows(estimate: Estimate) -> list[str]:
    rows = [["record", "row", "unit", "used", "masked", "weight", "residual rms", "error %"]]
    for entry in estimate.fit.rows:
        error = None if entry.relative_error is None else 100.0 * entry.relative_error
        numbers = [_number(entry.weight, 4), _number(entry.residual_rms, 4), _number(error, 4)]
        rows.append([entry.record, entry.row, entry.unit, str(entry.used), str(entry.masked), *numbers])
    return _table(rows, left=3) + textwrap.wrap(ERRORS, WIDTH)


def _pruning(estimate: Estimate) -> list[str]:
    pruning = estimate.fit.pruning
    if not pruning.steps:
        return [f"No parameter has a relative standard deviation of {pruning.percent:g} % or more."]
    lines = [f"Without parameters of {pruning.percent:g} % and more, largest first:"]
    for step in pruning.steps:
        lines.append(
            f"  {step.removed} ({step.relative_std:.3g} %) removed: relative error now "
            f"{100.0 * step.relative_error:.4f} %"
        )
    kept = ", ".join(f"{name} {_number(value)} ({spread:.3g} %)" for name, value, spread in pruning.kept)
    return lines + textwrap.wrap(
        f"What is left: {kept}", WIDTH, initial_indent="  ", subsequent_indent="    "
    )


def _sentences(title: str, sentences: Sequence[str]) -> list[str]:
    if not sentences:
        return []
    lines = [f"{title}:"]
    for sentence in sentences:
        lines += textwrap.wrap(sentence, WIDTH, initial_indent="  ", subsequent_indent="    ")
    return lines


def _titled(found: CheckTable) -> list[str]:
    table = _table([list(row) for row in found.rows], found.left) if found.rows else []
    lines = [f"{found.title}:", *(f"  {line}" for line in table)]
    for sentence in found.sentences:
        lines += textwrap.wrap(sentence, WIDTH, initial_indent="  ", subsequent_indent="    ")
    return lines


def _table(rows: list[list[str]], left: int = 2) -> list[str]:
    """Align the columns of a table, the first `left` of them to the left; a rule under the header."""
    lines = aligned(rows, left)
    return [lines[0], "-" * max(len(line) for line in lines), *lines[1:]]


def _number(value: float | None, digits: int = 6) -> str:
    """Return a number in so many significant digits; without an exponent where that is short."""
    if value is None:
        return "-"
    if value == 0.0:
        return "0"
    if not math.isfinite(value):
        return "inf" if value > 0.0 else "-inf" if value < 0.0 else "nan"
    return f"{value:#.{digits}g}".rstrip(".")
