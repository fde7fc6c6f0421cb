"""Rows of a model -> MathML, so that a browser sets the equations without any script or font of ours."""

from __future__ import annotations

import re
from collections.abc import Sequence

from markupsafe import Markup, escape

from modelgen.runtime.model.model import Feature, Model, Terms

GREEK = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "Gamma": "Γ",
    "delta": "δ",
    "theta": "θ",
    "tau": "τ",
    "phi": "φ",
    "omega": "ω",
    "Omega": "Ω",
    "mu": "μ",
}
DOTS = {1: "˙", 2: "¨"}


def row_equations(model: Model) -> list[tuple[str, Markup]]:
    """Return (what the row is, its equation) for every row: measurement = sum of parameter times column."""
    return [(f"{info.name}: {info.origin}", _equation(model, index)) for index, info in enumerate(model.rows)]


def symbol(name: str, dots: str = "") -> Markup:
    """Return "J_m" as J with the index m, dots above J; what is no plain name (a composite) as text."""
    match = re.fullmatch(r"([A-Za-z]+)_?([A-Za-z0-9_]*)", name)
    if not match:
        return Markup("<mtext>{}</mtext>").format(name)
    base = GREEK.get(match.group(1), match.group(1))
    letter = Markup("<mi>{}</mi>").format(base)
    if dots:
        letter = Markup('<mover accent="true">{}<mo>{}</mo></mover>').format(letter, dots)
    if not match.group(2):
        return letter
    return Markup("<msub>{}<mtext>{}</mtext></msub>").format(letter, match.group(2).replace("_", ","))


def _equation(model: Model, row: int) -> Markup:
    left = _sum(model, model.measurement_columns[row])
    parts = []
    for column, terms in sorted(model.regressor_columns[row].items()):
        inner = _sum(model, terms)
        if len(terms) > 1:
            inner = Markup("<mo>(</mo>{}<mo>)</mo>").format(inner)
        sign, inner = _leading_sign(model, terms, inner)
        product = Markup("{}<mo>&#x2062;</mo>{}").format(symbol(model.base_parameters[column]), inner)
        parts.append((sign, product))
    right = _joined(parts)
    body = Markup("<mrow>{}</mrow><mo>=</mo><mrow>{}</mrow>").format(left, right)
    return Markup('<math display="block">{}</math>').format(body)


def _leading_sign(model: Model, terms: Terms, inner: Markup) -> tuple[str, Markup]:
    """Take the minus of a single term in front of its parameter."""
    if len(terms) == 1 and terms[0][0] < 0.0:
        return "-", _sum(model, ((-terms[0][0], terms[0][1]),))
    return "+", inner


def _sum(model: Model, terms: Terms) -> Markup:
    parts = []
    # q_c - q_m reads better than -q_m + q_c
    for coefficient, key in sorted(terms, key=lambda term: term[0] < 0.0):
        size = abs(coefficient)
        factor = Markup("") if size == 1.0 else Markup("<mn>{}</mn>").format(f"{size:.6g}")
        parts.append(("-" if coefficient < 0.0 else "+", factor + _signal(model, key)))
    return _joined(parts) if parts else Markup("<mn>0</mn>")


def _joined(parts: Sequence[tuple[str, Markup]]) -> Markup:
    text = Markup("")
    for index, (sign, part) in enumerate(parts):
        if sign == "-":
            text += Markup("<mo>−</mo>")
        elif index:
            text += Markup("<mo>+</mo>")
        text += part
    return text


def _signal(model: Model, key: str) -> Markup:
    if key == "1":
        return Markup("<mn>1</mn>")
    feature = next((f for f in model.features if f.key == key), None)
    if feature is not None:
        return _feature(model, feature)
    signal = next((s for s in model.signals if s.key == key), None)
    if signal is None:
        return Markup("<mtext>{}</mtext>").format(key)
    name = signal.sensor or signal.actuator or signal.key
    base = symbol(name, DOTS.get(signal.derivative, ""))
    if signal.derivative <= max(DOTS):
        return base
    return Markup("<msup>{}<mrow><mo>(</mo><mn>{}</mn><mo>)</mo></mrow></msup>").format(
        base, signal.derivative
    )


def _feature(model: Model, feature: Feature) -> Markup:
    if feature.function == "kernel":  # of an arm: a line of its module
        letter, _, number = feature.key.partition(" ")
        line = Markup("<msub><mi>{}</mi><mn>{}</mn></msub>").format({"entry": "w"}.get(letter, "k"), number)
        return line + Markup("<mo>(</mo><mi>q</mi><mo>)</mo>")
    inner = _signal(model, feature.of) if isinstance(feature.of, str) else _sum(model, feature.of)
    if feature.function == "cube":
        text = Markup("<msup><mrow><mo>(</mo>{}<mo>)</mo></mrow><mn>3</mn></msup>").format(inner)
    else:
        names = {"sign": "sign", "forward": "[+]", "backward": "[−]"}
        name = names.get(feature.function, feature.function)
        text = Markup("<mi>{}</mi><mo>(</mo>{}<mo>)</mo>").format(escape(name), inner)
    return text if feature.times is None else text + _signal(model, feature.times)
