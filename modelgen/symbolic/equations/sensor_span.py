"""The combinations of coordinates that a sensor set can read at a given order of differentiation.

A sensor of order k (0 position, 1 velocity, 2 acceleration) gives every derivative of order j >= k of what it
measures, by differentiating its reading j - k times. Nothing is ever integrated.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

from modelgen.spec.chain import ChainSpec, Sensor
from modelgen.spec.units import ORDER
from modelgen.symbolic.equations.newton import deflection
from modelgen.symbolic.equations.signals import Exact, quotient

Key = TypeVar("Key", bound=Hashable)

HIGHEST_SENSOR_ORDER = 2

#: bodies and the coefficients their coordinates are added with
Combination = Mapping[str, Exact]


class SensorTerm(NamedTuple):
    """coefficient * (reading of `sensor` differentiated `derivative` times)."""

    coefficient: Exact
    sensor: str
    derivative: int


@dataclass(frozen=True)
class Sensing:
    """The sensors of one set, seen as linear combinations of the bodies' coordinates."""

    sensors: tuple[Sensor, ...]
    combinations: tuple[dict[str, Exact], ...] = field(repr=False)

    @classmethod
    def of(cls, spec: ChainSpec, sensors: tuple[Sensor, ...]) -> Sensing:
        """Resolve the sensors of a set; a deflection sensor on a link reads q_i / N - q_k of that link."""
        links = {link.bodies: dict(deflection(link)) for link in reversed(spec.links)}
        return cls(sensors, tuple(_combination(sensor, links) for sensor in sensors))

    def read(self, combination: Combination, order: int) -> tuple[SensorTerm, ...] | None:
        """Return how to read a combination of coordinates at an order of differentiation.

        The fewest differentiations come first (an accelerometer added to an encoder saves two), then the
        fewest readings. None if the set cannot give it without integration.
        """
        if not self.has_relative_sensors:
            return self._body_by_body(combination, order)
        ways = [self._whole(combination, order), self._body_by_body(combination, order)]
        found = [way for way in ways if way is not None]
        if not found and self.has_relative_sensors:
            way = self._solve(combination, order)
            found = [] if way is None else [way]
        if not found:
            return None
        return min(found, key=lambda way: (max((r.derivative for r in way), default=0), len(way)))

    def level(self, combination: Combination, order: int) -> int | None:
        """Return how often a term of that order must be differentiated before it can be read; None: never."""
        if not self.has_relative_sensors:
            lowest = [self._lowest.get(body) for body in combination]
            return None if None in lowest else max(0, max(k for k in lowest if k is not None) - order)
        for times in range(HIGHEST_SENSOR_ORDER + 1):
            if self.read(combination, order + times) is not None:
                return times
        return None

    def velocity(self, body: str) -> SensorTerm | None:
        """Return the reading of a body's velocity by one sensor, for its sign; None if there is none."""
        readings = self.read({body: 1}, 1)
        if readings is None or len(readings) != 1 or readings[0].coefficient < 0:
            return None
        return readings[0]

    @cached_property
    def has_relative_sensors(self) -> bool:
        """Whether any sensor reads a deflection."""
        return any(sensor.deflection for sensor in self.sensors)

    @cached_property
    def _by_support(self) -> dict[frozenset[str], list[int]]:
        """Sensors by the bodies they depend on, those of highest order first (they save differentiations)."""
        table: dict[frozenset[str], list[int]] = {}
        for index, combination in enumerate(self.combinations):
            table.setdefault(frozenset(combination), []).append(index)
        for indices in table.values():
            indices.sort(key=lambda index: -ORDER[self.sensors[index].measures])
        return table

    def _whole(self, combination: Combination, order: int) -> tuple[SensorTerm, ...] | None:
        """One sensor reads a multiple of the whole combination."""
        for index in self._by_support.get(frozenset(combination), ()):
            own, lowest = self.combinations[index], ORDER[self.sensors[index].measures]
            factors = {quotient(value, own[body]) for body, value in combination.items()}
            if len(factors) == 1 and lowest <= order:
                return (SensorTerm(factors.pop(), self.sensors[index].key, order - lowest),)
        return None

    @cached_property
    def _of_body(self) -> dict[str, list[tuple[int, str]]]:
        """Return per body the (order, key) of its own sensors, the highest order first."""
        table: dict[str, list[tuple[int, str]]] = {}
        for sensor in self.sensors:
            if sensor.body is not None:
                table.setdefault(sensor.body, []).append((ORDER[sensor.measures], sensor.key))
        for own in table.values():
            own.sort(key=lambda item: -item[0])
        return table

    @cached_property
    def _lowest(self) -> dict[str, int]:
        """Return per body the lowest order that a sensor of its own reads."""
        return {body: own[-1][0] for body, own in self._of_body.items()}

    def _body_by_body(self, combination: Combination, order: int) -> tuple[SensorTerm, ...] | None:
        """Every body of the combination has a sensor of its own."""
        readings = []
        for body, coefficient in combination.items():
            for lowest, key in self._of_body.get(body, ()):
                if lowest <= order:
                    readings.append(SensorTerm(coefficient, key, order - lowest))
                    break
            else:
                return None
        return tuple(readings)

    def _solve(self, combination: Combination, order: int) -> tuple[SensorTerm, ...] | None:
        """Combine the sensors that can be used, preferring those that need fewer differentiations."""
        usable = [i for i, sensor in enumerate(self.sensors) if ORDER[sensor.measures] <= order]
        usable.sort(key=lambda i: -ORDER[self.sensors[i].measures])
        weights = express(combination, [self.combinations[i] for i in usable])
        if weights is None:
            return None
        chosen = [(usable[n], weight) for n, weight in sorted(weights.items())]
        return tuple(
            SensorTerm(weight, self.sensors[i].key, order - ORDER[self.sensors[i].measures])
            for i, weight in chosen
        )


def _combination(sensor: Sensor, links: Mapping[tuple[str, str], dict[str, Exact]]) -> dict[str, Exact]:
    if sensor.body is not None:
        return {sensor.body: 1}
    assert sensor.deflection is not None
    first, second = sensor.deflection
    if (first, second) in links:
        return links[first, second]
    if (second, first) in links:
        return {body: -value for body, value in links[second, first].items()}
    return {first: 1, second: -1}


def express(target: Combination, basis: Iterable[Combination]) -> dict[int, Exact] | None:
    """Write `target` as a weighted sum of `basis` (exact elimination); None if it is not in their span."""
    pivots: list[tuple[str, dict[str, Exact], dict[int, Exact]]] = []

    def reduce(
        vector: dict[str, Exact], recipe: dict[int, Exact]
    ) -> tuple[dict[str, Exact], dict[int, Exact]]:
        for body, pivot, made_of in pivots:
            factor = vector.get(body, 0)
            if factor:
                vector = add_scaled(vector, pivot, -factor)
                recipe = add_scaled(recipe, made_of, -factor)
        return vector, recipe

    for index, candidate in enumerate(basis):
        vector, recipe = reduce(dict(candidate), {index: 1})
        if vector:
            body = min(vector)
            scale = quotient(1, vector[body])
            pivots.append(
                (body, {b: v * scale for b, v in vector.items()}, {i: w * scale for i, w in recipe.items()})
            )
    rest, recipe = reduce(dict(target), {})
    return None if rest else {index: -weight for index, weight in recipe.items()}


def add_scaled(left: Mapping[Key, Any], right: Mapping[Key, Any], factor: Any) -> dict[Key, Any]:
    """Return left + factor * right without zero entries, over any exact field."""
    total = dict(left)
    for key, value in right.items():
        total[key] = total.get(key, 0) + factor * value
    return {key: value for key, value in total.items() if value}
