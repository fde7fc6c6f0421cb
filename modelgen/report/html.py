"""What all pages are made with: templates that escape, the policy of the script, numbers as printed."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from functools import cache
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup, escape

from modelgen.render.environment import template_environment
from modelgen.runtime.modes.modes import cells, peak_hz
from modelgen.runtime.results.answer import plus_minus
from modelgen.template_folder import template_text


@cache
def report_environment() -> jinja2.Environment:
    """Return what makes pages of templates: every text is escaped, an unknown name is an error."""
    env = template_environment(html=True)
    env.filters["number"] = _number
    env.filters["unit"] = _unit
    env.filters["reached"] = lambda entry: _typeset(plus_minus(entry))
    env.filters["peak"] = lambda mode: _typeset(peak_hz(mode))
    env.filters["cells"] = lambda one: [_typeset(text) for text in cells(one)]
    return env


def rendered(template: str, plots: Sequence[Any], **fields: Any) -> str:
    """Return a page from a template, with the script that draws its plots, its style, and these fields."""
    script = template_text("report.js")
    return (
        report_environment()
        .get_template(template)
        .render(
            fields,
            script=Markup(script),
            style=Markup(template_text("report.css")),
            policy=policy_of(script),
            plots=plots,
            data=safe_json(plots),
        )
    )


def policy_of(script: str) -> str:
    """Return the policy that allows this script alone, and no connection."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    return f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; img-src data:"


def safe_json(value: Any) -> Markup:
    """Return JSON that cannot end the element that contains it."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _number(value: float | None, digits: int = 5) -> Markup:
    if value is None or not np.isfinite(value):
        return Markup("–")
    mantissa, _, exponent = f"{value:.{digits}g}".replace("-", "−").partition("e")
    power = exponent.replace("+", "").replace("−0", "−").lstrip("0")
    return Markup("{}·10<sup>{}</sup>").format(mantissa, power) if exponent else Markup(mantissa)


def _typeset(text: str) -> Markup:
    """Return "(9.87 +- 0.02)e-06" with its signs and power as they are printed."""
    mantissa, _, exponent = text.replace("+-", "±").replace("-", "−").partition(")e")
    if not exponent:
        return escape(mantissa)
    power = exponent.replace("+", "").replace("−0", "−").lstrip("0")
    return Markup("{})·10<sup>{}</sup>").format(mantissa, power)


def _unit(text: str) -> Markup:
    """Return "N m/s^2" with its powers raised."""
    head, *rest = text.split("^")
    return Markup("").join(
        [escape(head), *(Markup("<sup>{}</sup>{}").format(part[:1], part[1:]) for part in rest)]
    )
