"""Equations of motion by Newton and Euler: one balance of forces a body.

    Gamma_i = J_i q_i'' + F_v,i q_i' + F_s,i sign(q_i') + O_i
              + sum over the links of body i of (F_d s + K) deflection + K3 deflection^3

with the deflection q_i / N - q_k of a link (i, k) of ratio N; on body i the link's force acts divided by N.
For two bodies and one link these are (1) and (2) of Pham 2002.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from modelgen.spec.chain import Body, ChainSpec, Link
from modelgen.symbolic.equations.signals import Exact, Signal, Term, collect, coordinate, quotient
from modelgen.symbolic.equations.term_sum import paused_collector


@dataclass(frozen=True)
class Equation:
    """Balance of forces of one body: terms without a parameter (the left-hand side) equal those with one."""

    body: str
    terms: tuple[Term, ...]

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies whose coordinates the equation holds, its own included."""
        return tuple(dict.fromkeys(t.signal.name for t in self.terms if t.signal.kind == "coordinate"))


@dataclass(frozen=True)
class MotionEquations:
    """The chain and one equation a body, in the order of the spec."""

    spec: ChainSpec
    equations: tuple[Equation, ...]


@paused_collector()
def motion_equations(spec: ChainSpec) -> MotionEquations:
    """Derive one equation a body from the chain's elements."""
    terms: dict[str, list[Term]] = {body.name: list(_body_terms(body)) for body in spec.bodies}
    for index, link in enumerate(spec.links):
        for body, term in _link_terms(index, link):
            terms[body].append(term)
    return MotionEquations(spec, tuple(Equation(body, collect(terms[body])) for body in terms))


def deflection(link: Link) -> tuple[tuple[str, Exact], ...]:
    """Return the link's deflection q_i / N - q_k as (body, coefficient) pairs; the ground does not move."""
    first, second = link.bodies
    pairs = ((first, quotient(1, link.ratio)), (second, -1))
    return tuple((body, coefficient) for body, coefficient in pairs if body != "ground")


def _body_terms(body: Body) -> Iterator[Term]:
    if body.actuator:
        yield Term(None, Signal("force", body.actuator), 1)
    yield Term(body.inertia, coordinate(body.name, 2), 1)
    if body.friction == "symmetric":
        if body.viscous:
            yield Term(body.viscous, coordinate(body.name, 1), 1)
        if body.coulomb:
            yield Term(body.coulomb, Signal("sign", body.name), 1)
    else:
        for suffix, direction, sign in (("_plus", "forward", 1), ("_minus", "backward", -1)):
            if body.viscous:
                yield Term(body.viscous + suffix, Signal(direction, body.name, 1), 1)  # type: ignore[arg-type]
            if body.coulomb:
                yield Term(body.coulomb + suffix, Signal(direction, body.name), sign)  # type: ignore[arg-type]
    if body.offset:
        yield Term(body.offset, Signal("one", ""), 1)


def _link_terms(index: int, link: Link) -> Iterator[tuple[str, Term]]:
    """Yield (body, term) for both ends; the deflection's coefficient is also the lever of the force."""
    ends = deflection(link)
    for body, lever in ends:
        for parameter, order in ((link.damping, 1), (link.stiffness, 0)):
            if parameter:
                for other, coefficient in ends:
                    yield body, Term(parameter, coordinate(other, order), lever * coefficient)
        if link.stiffness3:
            yield body, Term(link.stiffness3, Signal("cube", str(index)), lever)
