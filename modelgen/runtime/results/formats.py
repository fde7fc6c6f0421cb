"""An estimate's parameter table in the formats of papers, notebooks and tables: pure functions to text."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from modelgen.runtime.parameters.grouped_reasons import grouped_reasons

if TYPE_CHECKING:
    from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.parameters.parameter import Parameter

HEADINGS = ("parameter", "unit", "value", "std. dev.", "%", "95 % from", "to")
_LATEX = {
    "\\": r"\textbackslash{}",
    "_": r"\_",
    "%": r"\%",
    "&": r"\&",
    "#": r"\#",
    "$": r"\$",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}


def latex_table(estimate: Estimate) -> str:
    """Return a LaTeX tabular (booktabs): value and standard deviation to the deviation's second digit."""
    lines = [r"\begin{tabular}{llrrrr}", r"\toprule"]
    lines.append(r"Parameter & Unit & Value & $\sigma$ & $\sigma$ in \% & 95\,\% interval \\")
    lines.append(r"\midrule")
    intervals = estimate.conf_int()
    for entry in estimate.parameters.told:
        low, high = intervals[entry.name]
        cells = [
            _latex_symbol(entry.name),
            _latex_unit(entry.unit),
            _latex_number(entry.value, _places(entry)),
            _latex_number(entry.std, 2),
            _latex_number(entry.relative_std, 2),
            f"{_latex_number(low, _places(entry))} to {_latex_number(high, _places(entry))}",
        ]
        lines.append(" & ".join(cells) + r" \\")
    lines += [r"\bottomrule", r"\end{tabular}"]
    return "\n".join(lines) + "\n"


def markdown_table(estimate: Estimate) -> str:
    """Return the parameters as a Markdown table, and below it what is not identifiable."""
    rows = [[_markdown(cell) for cell in row] for row in _rows(estimate)]
    lines = ["| " + " | ".join(HEADINGS) + " |", "|---|---|" + "---:|" * 5]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    grouped = grouped_reasons(estimate.unanswered)
    refused = [f"- {_markdown(one.who)}: {_markdown(one.why)}" for one in grouped]
    return "\n".join([*lines, *(["", "Not identifiable:", "", *refused] if refused else [])]) + "\n"


def data_frame(estimate: Estimate) -> Any:
    """Return the parameters as a pandas DataFrame, one row a parameter, indexed by name; base ones first.

    Raises
    ------
    ImportError
        Without pandas (extra `io`).
    """
    import pandas

    intervals = estimate.conf_int()
    rows = {
        entry.name: {
            "unit": entry.unit,
            "value": entry.value,
            "std": entry.std,
            "relative_std_percent": entry.relative_std,
            "conf_low": intervals[entry.name][0],
            "conf_high": intervals[entry.name][1],
            "noise_std": entry.noise_std,
            "drift_std": entry.drift_std,
            "printed_std": entry.printed_std,
        }
        for entry in estimate.parameters.told
    }
    return pandas.DataFrame.from_dict(rows, orient="index").rename_axis("parameter")


def _rows(estimate: Estimate) -> list[Sequence[str]]:
    intervals = estimate.conf_int()
    return [
        (
            entry.name,
            entry.unit,
            f"{entry.value:.6g}",
            f"{entry.std:.3g}",
            f"{entry.relative_std:.3g}",
            f"{intervals[entry.name][0]:.6g}",
            f"{intervals[entry.name][1]:.6g}",
        )
        for entry in estimate.parameters.told
    ]


def _places(entry: Parameter) -> int:
    """Return the significant digits of a value whose standard deviation is shown with two."""
    if not (entry.std > 0.0 and math.isfinite(entry.std) and entry.value):
        return 6
    return min(max(math.floor(math.log10(abs(entry.value))) - math.floor(math.log10(entry.std)) + 2, 2), 15)


def _latex_number(value: float, digits: int) -> str:
    if not math.isfinite(value):
        return "--"
    mantissa, _, exponent = f"{value:#.{digits}g}".partition("e")
    mantissa = mantissa.rstrip(".")
    return f"${mantissa} \\cdot 10^{{{int(exponent)}}}$" if exponent else f"${mantissa}$"


def _latex_symbol(name: str) -> str:
    match = re.fullmatch(r"([A-Za-z]+)_([A-Za-z0-9_]+)", name)
    if not match:
        return _latex_text(name)
    base, index = match.groups()
    greek = ("Gamma", "Omega", "alpha", "beta", "delta", "gamma", "mu", "omega", "phi", "tau", "theta")
    letter = f"\\{base}" if base in greek else base if len(base) == 1 else rf"\mathrm{{{base}}}"
    return f"${letter}_{{\\mathrm{{{_latex_text(index)}}}}}$"


def _latex_unit(unit: str) -> str:
    # the powers are raised, what else the unit holds is text
    parts = re.split(r"\^(-?\d+)", unit)
    return "".join(f"$^{{{part}}}$" if k % 2 else _latex_text(part) for k, part in enumerate(parts))


def _latex_text(text: str) -> str:
    return "".join(_LATEX.get(letter, letter) for letter in text)


def _markdown(text: str) -> str:
    return re.sub(r"([\\`*_{}\[\]<>|#])", r"\\\1", text)
