"""The same equations of motion by Lagrange with Rayleigh dissipation, by computer algebra.

Independent of newton.py on purpose: energies go in, SymPy differentiates, and `newton_minus_lagrange` must
be zero. Slow (it is a proof, not a step of the generator); used by tests and by `show --prove`.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from modelgen.spec.chain import Body, ChainSpec
from modelgen.symbolic.equations.newton import MotionEquations, deflection
from modelgen.symbolic.equations.signals import Signal

TIME = sp.Symbol("t", real=True)


def newton_minus_lagrange(motion: MotionEquations) -> tuple[sp.Expr, ...]:
    """Return, per body, the expanded difference of the two derivations: all zero if both are right."""
    spec = motion.spec
    lagrange = lagrange_equations(spec)
    return tuple(
        sp.expand(
            sum(
                (-term.coefficient if term.parameter is None else term.coefficient * _symbol(term.parameter))
                * _signal(term.signal, spec)
                for term in equation.terms
            )
            - lagrange[equation.body]
        )
        for equation in motion.equations
    )


def lagrange_equations(spec: ChainSpec) -> Mapping[str, sp.Expr]:
    """Return d/dt dT/dq' - dT/dq + dV/dq + dR/dq' - Q for every body; each is zero along a motion."""
    q = {body.name: _coordinate(body.name) for body in spec.bodies}
    kinetic = sum(_symbol(body.inertia) * q[body.name].diff(TIME) ** 2 / 2 for body in spec.bodies)
    potential, dissipation = sp.Integer(0), sum((_friction(body) for body in spec.bodies), sp.Integer(0))
    for link in spec.links:
        stretch = sum((coefficient * q[body] for body, coefficient in deflection(link)), sp.Integer(0))
        potential += _symbol(link.stiffness) * stretch**2 / 2
        if link.stiffness3:
            potential += _symbol(link.stiffness3) * stretch**4 / 4
        if link.damping:
            dissipation += _symbol(link.damping) * stretch.diff(TIME) ** 2 / 2
    equations = {}
    for body in spec.bodies:
        position, velocity = q[body.name], q[body.name].diff(TIME)
        generalised = _signal(Signal("force", body.actuator), spec) if body.actuator else sp.Integer(0)
        if body.offset:
            generalised -= _symbol(body.offset)
        equations[body.name] = (
            kinetic.diff(velocity).diff(TIME)
            - kinetic.diff(position)
            + potential.diff(position)
            + dissipation.diff(velocity)
            - generalised
        )
    return equations


def _friction(body: Body) -> sp.Expr:
    """Dissipation of the body's friction to ground.

    sign() and the two directions are plain symbols: they are constant except at reversals, where the
    velocity that multiplies them is zero, so the dissipation stays continuous.
    """
    velocity = _coordinate(body.name).diff(TIME)
    if body.friction == "symmetric":
        parts = ((body.viscous, "", sp.Integer(1)), (body.coulomb, "", _direction("sign", body.name)))
        return sum(
            (
                _symbol(name + suffix) * factor * (velocity**2 / 2 if name == body.viscous else velocity)
                for name, suffix, factor in parts
                if name
            ),
            sp.Integer(0),
        )
    total = sp.Integer(0)
    for suffix, direction, sign in (("_plus", "forward", 1), ("_minus", "backward", -1)):
        moving = _direction(direction, body.name)
        if body.viscous:
            total += _symbol(body.viscous + suffix) * moving * velocity**2 / 2
        if body.coulomb:
            total += sign * _symbol(body.coulomb + suffix) * moving * velocity
    return total


def _signal(signal: Signal, spec: ChainSpec) -> sp.Expr:
    if signal.kind == "coordinate":
        return (
            _coordinate(signal.name).diff((TIME, signal.order)) if signal.order else _coordinate(signal.name)
        )
    if signal.kind == "force":
        return sp.Function(f"force_{signal.name}", real=True)(TIME)
    if signal.kind == "one":
        return sp.Integer(1)
    if signal.kind == "cube":
        link = spec.links[int(signal.name)]
        return sum((c * _coordinate(body) for body, c in deflection(link)), sp.Integer(0)) ** 3
    direction = _direction(signal.kind, signal.name)
    return direction * (_coordinate(signal.name).diff((TIME, signal.order)) if signal.order else 1)


def _coordinate(body: str) -> sp.Expr:
    return sp.Function(f"q_{body}", real=True)(TIME)


def _symbol(parameter: str) -> sp.Symbol:
    # Names come from the validated spec and reach SymPy as symbols only; nothing is ever sympified.
    return sp.Symbol(parameter, positive=True)


def _direction(kind: str, body: str) -> sp.Symbol:
    return sp.Symbol(f"{kind} {body}", real=True)
