"""Signals, and the terms of equations: parameter times coefficient times signal.

Equations are kept as sparse lists of terms with exact rational coefficients. That is all the algebra that
sums, differentiation and base parameters need, it grows linearly with the chain, and no string ever has to
be parsed.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Literal, NamedTuple

#: An exact rational number. Integers stay integers: they are many times faster than fractions.
Exact = int | Fraction

SignalKind = Literal["coordinate", "force", "one", "sign", "forward", "backward", "cube"]

#: characters of 2.53303e-06, six digits with an exponent
LONGEST_FRACTION = 11

#: kinds of signal that depend on the direction of a body's motion
DIRECTIONS = ("sign", "forward", "backward")


class Signal(NamedTuple):
    """One signal of the equations of motion; `order` counts time derivatives.

    ==========  =========================================================================
    kind        meaning
    ==========  =========================================================================
    coordinate  q_name differentiated `order` times; name is a body
    force       the actuator's force differentiated `order` times; name is an actuator
    one         the constant 1 (an offset's signal)
    sign        sign of the body's velocity
    forward     1 while the body moves forwards, else 0; times q_name^(order) if order > 0
    backward    1 while the body moves backwards, else 0; times q_name^(order) if order > 0
    cube        cube of a link's deflection; name is the link's place in the spec
    ==========  =========================================================================
    """

    kind: SignalKind
    name: str
    order: int = 0


class Term(NamedTuple):
    """parameter * coefficient * signal; a parameter of None marks the known, left-hand side of the row."""

    parameter: str | None
    signal: Signal
    coefficient: Exact


def quotient(left: Exact, right: Exact) -> Exact:
    """Return left / right exactly, as an integer where it is one."""
    value = Fraction(left) / right
    return value.numerator if value.denominator == 1 else value


def short_text(size: Exact) -> str:
    """Return a magnitude as the fraction that it is, or to six digits where the fraction is longer.

    Ratios such as 2 pi / 0.01 are fractions of many digits: names hold this text, computations the fraction.
    """
    text = str(size)
    if len(text) <= LONGEST_FRACTION:
        return text
    return f"{float(size):.6g}".replace("e+", "e")


def coordinate(body: str, order: int) -> Signal:
    """Return the signal q_body differentiated `order` times."""
    return Signal("coordinate", body, order)


def collect(terms: Iterable[Term]) -> tuple[Term, ...]:
    """Add up terms of the same parameter and signal, in order of first appearance; drop those that cancel."""
    sums: dict[tuple[str | None, Signal], Exact] = {}
    for parameter, signal, coefficient in terms:
        key = (parameter, signal)
        sums[key] = sums.get(key, 0) + coefficient
    return tuple(Term(parameter, signal, value) for (parameter, signal), value in sums.items() if value)


def differentiate(terms: Iterable[Term], times: int) -> tuple[Term, ...]:
    """Differentiate every term; valid away from reversals, where sign() and the like are constant.

    A cubed deflection has no derivative in this alphabet: the caller must not ask for one.
    """
    if times == 0:
        return tuple(terms)
    kept = []
    for parameter, signal, coefficient in terms:
        if signal.kind == "cube":
            raise ValueError("a cubic stiffness cannot be differentiated")
        vanishes = signal.kind in ("one", "sign") or (
            signal.kind in ("forward", "backward") and signal.order == 0
        )
        if not vanishes:
            kept.append(Term(parameter, signal._replace(order=signal.order + times), coefficient))
    return tuple(kept)
