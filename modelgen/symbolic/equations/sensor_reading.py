"""Reading a row: every coordinate in it becomes readings of sensors, every sign() a feature."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

from modelgen.errors import ModelError
from modelgen.spec.chain import ChainSpec
from modelgen.spec.units import force_unit, signal_unit
from modelgen.symbolic.equations.newton import deflection
from modelgen.symbolic.equations.row import Feature, KeyTerm, NeededSignal, Row
from modelgen.symbolic.equations.sensor_span import Combination, Sensing, SensorTerm
from modelgen.symbolic.equations.signals import DIRECTIONS, Exact, Signal, Term, differentiate

TIMES = {0: "", 1: ", differentiated once", 2: ", differentiated twice"}


class Candidate(NamedTuple):
    """An equation that may become a row: whose balances it holds, and where it comes from.

    `masked` names bodies whose reversals spoil the row even before it is differentiated.
    """

    name: str
    bodies: tuple[str, ...]
    terms: tuple[Term, ...]
    origin: str
    masked: tuple[str, ...] = ()


class Reader:
    """Turns candidates into rows and gathers the signals and features on the way."""

    def __init__(self, spec: ChainSpec, sensing: Sensing, where: str) -> None:
        self.spec = spec
        self.sensing = sensing
        self.where = where
        self.signals: dict[str, NeededSignal] = {}
        self.features: dict[str, Feature] = {}
        self._known = {name: Fraction(str(value)) for name, value in spec.known.items()}
        self._motion = {body.name: body.motion for body in spec.bodies}

    def row(self, candidate: Candidate, times: int) -> Row:
        """Differentiate a candidate `times` times and read every signal in it."""
        bodies = candidate.bodies
        terms = differentiate(candidate.terms, times)
        total: dict[tuple[str | None, str], Exact] = {}
        for parameter, key, coefficient in self._read_all(terms):
            known = self._known.get(parameter or "")
            place = (parameter, key) if known is None else (None, key)
            value = coefficient if known is None else -known * coefficient
            total[place] = total.get(place, 0) + value
        return Row(
            name=candidate.name,
            origin=candidate.origin + TIMES[times],
            bodies=bodies,
            differentiated=times,
            order=max(t.signal.order for t in terms if t.signal.kind not in ("force", "one")),
            terms=tuple(KeyTerm(p, key, c) for (p, key), c in total.items() if c),
            reversals=self._reversals(candidate, times),
            unit=self._unit(candidate, times),
        )

    def _unit(self, candidate: Candidate, times: int) -> str:
        """Return the unit of a row: a force's, or a coordinate's where that stands on the left-hand side."""
        left = [term.signal for term in candidate.terms if term.parameter is None]
        if left and all(signal.kind == "coordinate" for signal in left):
            return signal_unit(self._motion[left[0].name], "position", left[0].order + times)
        return force_unit(self._motion[candidate.bodies[0]], times)

    def signals_in_order(self) -> tuple[NeededSignal, ...]:
        """Return the needed signals: sensors in the order of the set, then forces, then given directions."""
        place = {sensor.key: index for index, sensor in enumerate(self.sensing.sensors)}
        actuators = {body.actuator: index for index, body in enumerate(self.spec.bodies)}

        def rank(signal: NeededSignal) -> tuple[int, int, int, str]:
            if signal.sensor is not None:
                return 0, place[signal.sensor], signal.derivative, ""
            if signal.actuator is not None:
                return 1, actuators[signal.actuator], signal.derivative, ""
            return 2, 0, 0, signal.key

        return tuple(sorted(self.signals.values(), key=rank))

    def _read_all(self, terms: Sequence[Term]) -> Iterable[KeyTerm]:
        """Read the terms column by column, so that a relative sensor can serve a whole deflection."""
        combined: dict[tuple[str | None, int], dict[str, Exact]] = {}
        for parameter, signal, coefficient in terms:
            if signal.kind == "coordinate":
                combined.setdefault((parameter, signal.order), {})[signal.name] = coefficient
            else:
                yield from self._read_other(parameter, signal, coefficient)
        for (parameter, order), combination in combined.items():
            for reading in self._readings(combination, order):
                yield KeyTerm(parameter, self._key(reading), reading.coefficient)

    def _read_other(self, parameter: str | None, signal: Signal, coefficient: Exact) -> Iterable[KeyTerm]:
        if signal.kind == "force":
            yield KeyTerm(parameter, self._force(signal), coefficient)
        elif signal.kind == "one":
            yield KeyTerm(parameter, "1", coefficient)
        elif signal.kind == "cube":
            yield KeyTerm(parameter, self._cube(signal), coefficient)
        else:
            yield from self._directed(parameter, signal, coefficient)

    def _readings(self, combination: Combination, order: int) -> tuple[SensorTerm, ...]:
        readings = self.sensing.read(combination, order)
        assert readings is not None, "a row is only read after enough differentiations"
        return readings

    def _key(self, reading: SensorTerm) -> str:
        key = f"d{reading.derivative}_{reading.sensor}" if reading.derivative else reading.sensor
        self.signals[key] = NeededSignal(key, reading.sensor, None, reading.derivative)
        return key

    def _force(self, signal: Signal) -> str:
        key = f"d{signal.order}_{signal.name}" if signal.order else signal.name
        self.signals[key] = NeededSignal(key, None, signal.name, signal.order)
        return key

    def _directed(self, parameter: str | None, signal: Signal, coefficient: Exact) -> Iterable[KeyTerm]:
        direction = self._direction(signal.name)
        if signal.order == 0:
            yield KeyTerm(parameter, self._feature(signal.kind, direction, None), coefficient)
            return
        for reading in self._readings({signal.name: coefficient}, signal.order):
            key = self._feature(signal.kind, direction, self._key(reading))
            yield KeyTerm(parameter, key, reading.coefficient)

    def _feature(self, function: str, of: str, times: str | None) -> str:
        key = f"{function}({of})" + (f"*{times}" if times else "")
        self.features[key] = Feature(key, function, of, times)  # type: ignore[arg-type]
        return key

    def _cube(self, signal: Signal) -> str:
        link = self.spec.links[int(signal.name)]
        parts = tuple((r.coefficient, self._key(r)) for r in self._readings(dict(deflection(link)), 0))
        key = f"cube({link.bodies[0]}-{link.bodies[1]})"
        self.features[key] = Feature(key, "cube", parts)
        return key

    def _direction(self, body: str) -> str:
        """Return the key of the body's velocity, or of a direction that the record has to bring."""
        velocity = self.sensing.velocity(body)
        if velocity is not None:
            return self._key(velocity)
        key = f"sign_{body}"
        self.signals[key] = NeededSignal(key, None, None, 0)
        return key

    def _reversals(self, candidate: Candidate, times: int) -> tuple[str, ...]:
        """Return the directions of motion whose change spoils the row: those it has differentiated."""
        bodies = list(candidate.masked)
        if times:
            bodies += [term.signal.name for term in candidate.terms if term.signal.kind in DIRECTIONS]
        return tuple(self._direction(body) for body in dict.fromkeys(bodies))

    def refuse_cubes(self, candidate: Candidate, times: int) -> None:
        """Refuse a row that would have to differentiate a cubed deflection, or to read what no sensor gives.

        Raises
        ------
        ModelError
        """
        for term in candidate.terms:
            if term.signal.kind != "cube":
                continue
            link = self.spec.links[int(term.signal.name)]
            stretch = dict(deflection(link))
            if times or self.sensing.read(stretch, 0) is None:
                missing = [b for b in stretch if self.sensing.read({b: 1}, 0) is None]
                bodies = ", ".join(missing or stretch)
                raise ModelError.at(
                    self.where,
                    f"the cubic stiffness {link.stiffness3} needs its link's deflection undifferentiated",
                    f"add a position sensor on {bodies}, or a deflection sensor on that link",
                )
