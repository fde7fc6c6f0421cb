"""The direct model x' = A x + B Gamma + E f of a chain, as sparse symbolic entries.

x holds all positions, then all velocities, in the order of the spec. This is (17)-(19) of Pham 2002 for two
bodies, corrected: the printed rows 3 and 4 are damaged, and the Coulomb torque acts with a minus sign.
"""

from __future__ import annotations

from dataclasses import dataclass

from modelgen.spec.chain import Sensor
from modelgen.spec.units import ORDER
from modelgen.symbolic.equations.newton import MotionEquations, deflection
from modelgen.symbolic.equations.sensor_span import Sensing
from modelgen.symbolic.equations.signals import Exact, Term

#: sum of coefficient * parameter (a parameter of None counts as 1)
LinearForm = tuple[tuple[Exact, str | None], ...]


@dataclass(frozen=True)
class Entry:
    """One element of a matrix: `form` divided by `inertia` (not divided if that is None).

    `directions` selects the entry by the direction of a body's motion: (body, +1), (body, -1) or None.
    """

    row: int
    column: int
    form: LinearForm
    inertia: str
    direction: tuple[str, int] | None = None


@dataclass(frozen=True)
class Resistance:
    """A body with Coulomb friction or an offset: one column of E."""

    body: str
    state: int
    coulomb_plus: str | None
    coulomb_minus: str | None
    offset: str | None
    asymmetric: bool


@dataclass(frozen=True)
class Output:
    """One sensor: its order and the combination of coordinates that it reads."""

    sensor: Sensor
    order: int
    combination: tuple[tuple[int, Exact], ...]


@dataclass(frozen=True)
class Spring:
    """A cubic stiffness: force `parameter` times the cube of a combination of coordinates."""

    parameter: str
    deflection: tuple[tuple[int, Exact], ...]


@dataclass(frozen=True)
class StateSpace:
    """Accelerations as sparse entries; the module's state_space() spells them out."""

    bodies: tuple[str, ...]
    actuators: tuple[str, ...]
    a: tuple[Entry, ...]
    b: tuple[Entry, ...]
    e: tuple[Entry, ...]
    resistances: tuple[Resistance, ...]
    outputs: tuple[Output, ...]
    springs: tuple[Spring, ...]


def state_space(motion: MotionEquations, sensors: tuple[Sensor, ...]) -> StateSpace:
    """Solve every equation for its body's acceleration; the mass matrix of a chain is diagonal."""
    spec = motion.spec
    place = {body.name: index for index, body in enumerate(spec.bodies)}
    count = len(spec.bodies)
    actuators = tuple(body.actuator for body in spec.bodies if body.actuator)
    resistances = tuple(
        Resistance(
            body.name,
            count + place[body.name],
            _direction_name(body.coulomb, body.friction, "_plus"),
            _direction_name(body.coulomb, body.friction, "_minus"),
            body.offset,
            body.friction == "asymmetric",
        )
        for body in spec.bodies
        if body.coulomb or body.offset or (body.friction == "asymmetric" and body.viscous)
    )
    a: list[Entry] = []
    b: list[Entry] = []
    for body, equation in zip(spec.bodies, motion.equations, strict=True):
        row = count + place[body.name]
        forms: dict[tuple[int, tuple[str, int] | None], list[tuple[Exact, str | None]]] = {}
        for term in equation.terms:
            column = _column(term, place, count)
            if column is not None:
                forms.setdefault(column, []).append((-term.coefficient, term.parameter))
            elif term.signal.kind == "force":
                b.append(Entry(row, actuators.index(term.signal.name), ((1, None),), body.inertia))
        for (column_index, direction), form in sorted(
            forms.items(), key=lambda item: (item[0][0], str(item[0][1]))
        ):
            a.append(Entry(row, column_index, tuple(form), body.inertia, direction))
    inertia = {body.name: body.inertia for body in spec.bodies}
    e = tuple(Entry(r.state, column, ((-1, None),), inertia[r.body]) for column, r in enumerate(resistances))
    sensing = Sensing.of(spec, sensors)
    outputs = tuple(
        Output(sensor, ORDER[sensor.measures], tuple((place[b], c) for b, c in combination.items()))
        for sensor, combination in zip(sensors, sensing.combinations, strict=True)
    )
    springs = tuple(
        Spring(link.stiffness3, tuple((place[body], c) for body, c in deflection(link)))
        for link in spec.links
        if link.stiffness3
    )
    return StateSpace(tuple(place), actuators, tuple(a), tuple(b), e, resistances, outputs, springs)


def _direction_name(coulomb: str | None, friction: str, suffix: str) -> str | None:
    if coulomb is None or friction == "symmetric":
        return coulomb
    return coulomb + suffix


def _column(term: Term, place: dict[str, int], count: int) -> tuple[int, tuple[str, int] | None] | None:
    """Return the state a term multiplies; None for what is no linear function of the state."""
    signal = term.signal
    if signal.kind == "coordinate" and signal.order < 2:
        return place[signal.name] + count * signal.order, None
    if signal.kind in ("forward", "backward") and signal.order == 1:
        return place[signal.name] + count, (signal.name, 1 if signal.kind == "forward" else -1)
    return None
