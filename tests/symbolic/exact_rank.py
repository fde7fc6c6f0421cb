"""The exact rank of a regressor along motions of its chain, in a prime field.

Between reversals a motion is a sum of exponentials and a constant. Their rates, forces and weights are random
elements of the field, so the rank needs no tolerance, whatever the order of the derivatives.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from fractions import Fraction

from modelgen.symbolic.base_parameters import BaseModel
from modelgen.symbolic.equations.identifiability import PRIME, add_modular, modular, reduce_modular
from modelgen.symbolic.equations.newton import MotionEquations, motion_equations
from modelgen.symbolic.equations.sensor_span import ORDER, Sensing


def rank_along_motions(model: BaseModel, seed: int) -> int:
    """Return the rank of the regressor of a chain with symmetric friction and no cubic stiffness."""
    rng = random.Random(seed)
    columns = [base.combination[0][0] for base in model.base]
    motion = motion_equations(model.rows.spec)
    point = {p.name: rng.randrange(1, PRIME) for p in model.rows.spec.parameters}
    point.update({name: modular(Fraction(str(value))) for name, value in model.rows.spec.known.items()})
    modes = [_mode(motion, point, rng) for _ in range(6 * len(motion.equations) + 12)]
    pivots: dict[int, dict[int, int]] = {}
    for _ in range(2 * len(columns) + 10):
        if len(pivots) == len(columns):
            break
        values = _values(model, modes, _at_rest(motion, point, rng), rng)
        for row in model.rows.rows:
            vector: dict[int, int] = {}
            for term in row.terms:
                if term.parameter in columns:
                    place = columns.index(term.parameter)
                    add_modular(vector, {place: modular(term.coefficient)}, values[term.key])
            reduce_modular(vector, pivots)
            if vector:
                pivots[min(vector)] = vector
    return len(pivots)


class _Motion:
    """One exponential: its rate, and the amplitude of every body and actuator."""

    def __init__(self, rate: int, amplitude: Mapping[str, int]) -> None:
        self.rate, self.amplitude = rate, amplitude

    def value(self, name: str, order: int) -> int:
        return self.amplitude[name] * pow(self.rate, order, PRIME) % PRIME


def _mode(motion: MotionEquations, point: Mapping[str, int], rng: random.Random) -> _Motion:
    rate = rng.randrange(1, PRIME)
    return _Motion(rate, _solve(_names(motion), _balances(motion, point, rate, {}), rng))


def _at_rest(
    motion: MotionEquations, point: Mapping[str, int], rng: random.Random
) -> tuple[_Motion, dict[str, int]]:
    """Return positions and forces at rest in front of friction in random directions, and these."""
    signs = {e.body: rng.choice((1, -1)) for e in motion.equations}
    return _Motion(0, _solve(_names(motion), _balances(motion, point, 0, signs), rng)), signs


def _names(motion: MotionEquations) -> list[str]:
    actuators = [b.actuator for b in motion.spec.bodies if b.actuator]
    return [*(equation.body for equation in motion.equations), *actuators]


def _balances(
    motion: MotionEquations, point: Mapping[str, int], rate: int, signs: Mapping[str, int]
) -> list[dict[str, int]]:
    """Return one linear equation a body in the amplitudes of bodies and actuators; "" is the constant."""
    found = []
    for equation in motion.equations:
        balance: dict[str, int] = {}
        for parameter, signal, coefficient in equation.terms:
            value = modular(coefficient) * (1 if parameter is None else point[parameter])
            if signal.kind == "coordinate":
                name, value = signal.name, value * pow(rate, signal.order, PRIME)
            elif signal.kind == "force":
                name, value = signal.name, -value
            elif signs:
                name, value = "", value * (signs[signal.name] if signal.kind == "sign" else 1)
            else:
                continue
            balance[name] = (balance.get(name, 0) + value) % PRIME
        found.append({name: value for name, value in balance.items() if value})
    return found


def _solve(names: list[str], balances: list[dict[str, int]], rng: random.Random) -> dict[str, int]:
    """Return a random solution; what no equation determines is random."""
    pivots: dict[str, dict[str, int]] = {}
    for balance in balances:
        vector = dict(balance)
        reduce_modular(vector, pivots)
        lead = next((name for name in vector if name), None)
        assert lead is not None or not vector, "no such motion"
        if lead is not None:
            pivots[lead] = vector
    found = {name: rng.randrange(PRIME) for name in names if name not in pivots}
    for lead in reversed(list(pivots)):
        rest = sum(v * (found[n] if n else 1) for n, v in pivots[lead].items() if n != lead)
        found[lead] = -rest * pow(pivots[lead][lead], -1, PRIME) % PRIME
    return found


def _values(
    model: BaseModel, modes: list[_Motion], rest: tuple[_Motion, dict[str, int]], rng: random.Random
) -> dict[str, int]:
    """Return every signal and feature of one sample."""
    weights = [rng.randrange(PRIME) for _ in modes]
    parts = [*zip(modes, weights, strict=True), (rest[0], 1)]
    sensing = Sensing.of(model.rows.spec, model.rows.sensors)
    combination_of = {s.key: c for s, c in zip(sensing.sensors, sensing.combinations, strict=True)}
    order_of = {s.key: ORDER[s.measures] for s in sensing.sensors}
    values, body_of = {"1": 1}, {}
    for signal in model.rows.signals:
        if signal.sensor is not None:
            order, combination = order_of[signal.sensor], combination_of[signal.sensor]
            body_of[signal.key] = next(iter(combination))
            values[signal.key] = sum(
                weight * modular(factor) * motion.value(body, order + signal.derivative)
                for motion, weight in parts
                for body, factor in combination.items()
            ) % PRIME  # fmt: skip
        elif signal.actuator is not None:
            order = signal.derivative
            values[signal.key] = sum(w * m.value(signal.actuator, order) for m, w in parts) % PRIME
        else:
            body_of[signal.key] = signal.key.removeprefix("sign_")
    for feature in model.rows.features:
        assert feature.function == "sign" and isinstance(feature.of, str)
        values[feature.key] = rest[1][body_of[feature.of]]
    return values
