"""The linear part of the equations as a matrix of polynomials in s = d/dt and the parameters.

    sum over coordinates of A(s, parameters) * coordinate = sum over actuators of force - friction, offsets

Polynomials live in a SymPy ring over the rationals (sparse dictionaries, no expression trees). Known
parameters are numbers in it. Coordinates are chosen so that every sensor reads a combination of measured
ones: bodies that the sensors give one by one, then relative sensors, then the bodies that no sensor reads.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from sympy import QQ, Symbol
from sympy.polys.rings import PolyElement, PolyRing

from modelgen.spec.chain import ChainSpec
from modelgen.symbolic.equations.newton import Equation
from modelgen.symbolic.equations.sensor_span import Sensing, express
from modelgen.symbolic.equations.signals import Exact, Signal, Term

#: a linear functional of the bodies' coordinates, as sorted (body, coefficient) pairs
Functional = tuple[tuple[str, Exact], ...]
#: what multiplies a polynomial: a functional of coordinates, or a coordinate taken in one direction of motion
Place = tuple[str, Functional]


@dataclass(frozen=True)
class Coordinates:
    """Measured functionals and unseen bodies that together span the motion of the chain."""

    measured: tuple[Functional, ...]
    unseen: tuple[str, ...]
    table: Mapping[str, tuple[tuple[Functional, Exact], ...]]


@dataclass(frozen=True)
class PolynomialEquation:
    """One body's equation: polynomials by coordinate, actuator, sign() or the constant 1, and cube."""

    body: str
    coordinates: Mapping[Place, PolyElement]
    forces: Mapping[str, PolyElement]
    constants: Mapping[Signal, PolyElement]
    cubes: Mapping[Signal, PolyElement]


@dataclass(frozen=True)
class PolynomialSystem:
    """A few equations in one ring: its first generator is s, the others are the parameters in them."""

    ring: PolyRing
    equations: Mapping[str, PolynomialEquation]


def unit(body: str) -> Functional:
    """Return the functional that reads one body's coordinate."""
    return ((body, 1),)


def choose_coordinates(bodies: Sequence[str], sensing: Sensing) -> Coordinates:
    """Choose measured coordinates (bodies first, then relative sensors) and bodies without a sensor."""
    if not sensing.has_relative_sensors:
        seen = {body for combination in sensing.combinations for body in combination}
        singles_only = {body: ((unit(body), 1),) for body in bodies}
        measured_bodies = tuple(unit(body) for body in bodies if body in seen)
        return Coordinates(measured_bodies, tuple(b for b in bodies if b not in seen), singles_only)
    sensed: list[Mapping[str, Exact]] = list(sensing.combinations)
    basis: list[Mapping[str, Exact]] = []
    singles = [{body: 1} for body in bodies if express({body: 1}, sensed) is not None]
    for candidate in [*singles, *sensed]:
        if express(candidate, basis) is None:
            basis.append(candidate)
    measured = len(basis)
    for body in bodies:
        if len(basis) < len(bodies) and express({body: 1}, basis) is None:
            basis.append({body: 1})
    functionals = [tuple(sorted(vector.items())) for vector in basis]
    unseen = tuple(functional[0][0] for functional in functionals[measured:])
    table = {}
    for body in bodies:
        weights = express({body: 1}, basis)
        assert weights is not None
        table[body] = tuple((functionals[index], weight) for index, weight in sorted(weights.items()))
    return Coordinates(tuple(functionals[:measured]), unseen, table)


def polynomial_system(
    spec: ChainSpec, equations: Sequence[Equation], coordinates: Coordinates
) -> PolynomialSystem:
    """Collect equations of motion as polynomials in s and those of their parameters that are not known."""
    held = {term.parameter for equation in equations for term in equation.terms}
    names = [p.name for p in spec.parameters if p.name in held and p.name not in spec.known]
    # Symbols are made from validated names; a string would be parsed.
    ring = PolyRing([Symbol("s derivative"), *(Symbol(name) for name in names)], QQ)
    values = dict(zip(names, ring.gens[1:], strict=True))
    for name, value in spec.known.items():
        values[name] = ring.ground_new(_rational(Fraction(str(value))))
    polynomials = {e.body: _equation(e.body, e.terms, ring, values, coordinates) for e in equations}
    return PolynomialSystem(ring, polynomials)


def _equation(
    body: str,
    terms: Sequence[Term],
    ring: PolyRing,
    values: Mapping[str, PolyElement],
    coordinates: Coordinates,
) -> PolynomialEquation:
    s = ring.gens[0]
    places: dict[Place, PolyElement] = {}
    forces: dict[str, PolyElement] = {}
    constants: dict[Signal, PolyElement] = {}
    cubes: dict[Signal, PolyElement] = {}
    for parameter, signal, coefficient in terms:
        factor = ring.ground_new(_rational(coefficient))
        value = factor * (values[parameter] if parameter is not None else ring.one)
        if signal.kind == "force":
            forces[signal.name] = forces.get(signal.name, ring.zero) + value
        elif signal.kind == "coordinate":
            for functional, weight in coordinates.table[signal.name]:
                place = ("", functional)
                term = value * s**signal.order * ring.ground_new(_rational(weight))
                places[place] = places.get(place, ring.zero) + term
        elif signal.kind in ("forward", "backward") and signal.order:
            place = (signal.kind, unit(signal.name))
            places[place] = places.get(place, ring.zero) + value * s**signal.order
        elif signal.kind == "cube":
            cubes[signal] = cubes.get(signal, ring.zero) + value
        else:
            constants[signal] = constants.get(signal, ring.zero) + value
    return PolynomialEquation(body, places, forces, constants, cubes)


def by_order(poly: PolyElement) -> Iterator[tuple[int, PolyElement]]:
    """Yield (power of s, its coefficient) of a polynomial, lowest power first."""
    ring = poly.ring
    table: dict[int, PolyElement] = {}
    for exponents, coefficient in poly.items():
        order, rest = exponents[0], (0, *exponents[1:])
        table.setdefault(order, ring.zero.copy())[rest] = coefficient
    yield from sorted(table.items())


def _rational(value: Exact) -> object:
    return QQ(value.numerator, value.denominator)
