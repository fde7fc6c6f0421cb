"""Random chains with random elements and sensors, and exact motions of them, for property tests."""

from __future__ import annotations

import random
from collections.abc import Mapping
from types import ModuleType

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ORDER = {"position": 0, "velocity": 1, "acceleration": 2}


def random_spec(rng: random.Random, most_bodies: int = 6) -> str:
    """Return the TOML of a connected chain, tree or loop with one random sensor set called "set"."""
    count = rng.randint(1, most_bodies)
    lines = ["[chain]", 'name = "chain"', 'title = "random"', 'motion = "rotation"']
    driven = rng.randrange(count)
    for i in range(count):
        lines += ["[[bodies]]", f'name = "b{i}"', f'inertia = "J{i}"']
        lines += [f'{kind} = "{kind}{i}"' for kind in ("viscous", "coulomb", "offset") if rng.random() < 0.4]
        if i == driven or rng.random() < 0.2:
            lines.append(f'actuator = "Gamma{i}"')
    pairs = [(rng.randrange(i), i) for i in range(1, count)]
    if count > 2 and rng.random() < 0.25 and (0, count - 1) not in pairs:
        pairs.append((0, count - 1))
    ends = [(f"b{i}", f"b{k}") for i, k in pairs]
    if rng.random() < 0.4:
        ends.append((f"b{rng.randrange(count)}", "ground"))
    for n, (i, k) in enumerate(ends):
        lines += ["[[links]]", f'bodies = ["{i}", "{k}"]', f'stiffness = "K{n}"']
        lines += [f'damping = "D{n}"'] if rng.random() < 0.6 else []
        lines += [f"ratio = {rng.choice(['2.0', '0.5', '-1.5', '1.25'])}"] if rng.random() < 0.3 else []
    return "\n".join([*lines, "[sensors.set]", *_sensors(rng, count, ends)])


def _sensors(rng: random.Random, count: int, ends: list[tuple[str, str]]) -> list[str]:
    lines = []
    for i in range(count):
        if rng.random() < 0.55:
            lines.append(f'z{i} = {{ body = "b{i}", measures = "{rng.choice(list(ORDER))}" }}')
            if rng.random() < 0.2:
                lines.append(f'a{i} = {{ body = "b{i}", measures = "acceleration" }}')
    inner = [pair for pair in ends if "ground" not in pair]
    if inner and rng.random() < 0.25:
        i, k = rng.choice(inner)
        lines.append(f'rel = {{ deflection = ["{i}", "{k}"], measures = "{rng.choice(list(ORDER))}" }}')
    if not lines:
        lines.append(f'z0 = {{ body = "b0", measures = "{rng.choice(list(ORDER))}" }}')
    return lines


class ExactMotion:
    """A smooth motion of a module's state space with all derivatives known: sums of exponentials.

    The bodies' directions never change: a constant drift of force is not needed, one growing exponential
    outweighs the oscillations. Constant forces of actuators hold friction and offsets.
    """

    def __init__(self, module: ModuleType, truth: Mapping[str, float], seed: int, modes: int = 24) -> None:
        rng = np.random.default_rng(seed)
        space = module.state_space(truth)
        states, actuators = space.B.shape
        self.bodies = states // 2
        self.space = space
        stiff, damp, drive = (
            space.A[self.bodies :, : self.bodies],
            space.A[self.bodies :, self.bodies :],
            space.B,
        )
        rates = rng.uniform(-0.3, 0.3, modes) + 1j * rng.uniform(0.3, 2.5, modes)
        self.rates = np.concatenate([[0.37], rates])
        forces = rng.standard_normal((modes, actuators)) + 1j * rng.standard_normal((modes, actuators))
        self.forces = np.vstack([rng.uniform(0.5, 1.5, actuators), 1e-2 * forces])
        self.shapes = np.array(
            [
                np.linalg.solve(r**2 * np.eye(self.bodies) - stiff - r * damp, drive[self.bodies :] @ g)
                for r, g in zip(self.rates, self.forces, strict=True)
            ]
        )
        self.time = np.sort(rng.uniform(0.0, 3.0, 80))
        # The growing mode must lead at every body, by enough for its oscillations.
        while np.any(np.abs(self.coordinate(1).sum(axis=0)) == 0) or self._turns():
            self.forces[1:] *= 0.3
            self.shapes[1:] *= 0.3
        directions = np.sign(self.coordinate(1)[0])
        friction = np.array(
            [
                truth.get(f["coulomb_plus"] or "", 0.0) * directions[f["state"] - self.bodies]
                + truth.get(f["offset"] or "", 0.0)
                for f in module.FRICTION
            ]
        )
        load = space.E[self.bodies :] @ friction
        steady = np.hstack([stiff, drive[self.bodies :]])
        rest = np.linalg.lstsq(steady, -load, rcond=None)[0]
        assert np.allclose(steady @ rest, -load)
        self.rest, self.hold = rest[: self.bodies], rest[self.bodies :]

    def _turns(self) -> bool:
        velocity = self.coordinate(1)
        return bool(np.any(np.sign(velocity) != np.sign(velocity[0])))

    def coordinate(self, order: int) -> FloatArray:
        """Return all coordinates differentiated `order` times, shape (samples, bodies)."""
        growth = np.exp(np.outer(self.time, self.rates)) * self.rates**order
        value = (growth @ self.shapes).real
        return value + self.rest if order == 0 and hasattr(self, "rest") else value

    def force(self, column: int, order: int) -> FloatArray:
        """Return one actuator's force differentiated `order` times, shape (samples,)."""
        growth = np.exp(np.outer(self.time, self.rates)) * self.rates**order
        value = (growth @ self.forces[:, column]).real
        return value + self.hold[column] if order == 0 else value

    def signals(self, module: ModuleType) -> dict[str, FloatArray]:
        """Return every signal that a module asks for."""
        inertias = [role["bodies"][0] for role in module.ROLES.values() if role["role"] == "inertia"]
        place = {body: index for index, body in enumerate(inertias)}
        keys = [actuator["key"] for actuator in module.ACTUATORS]
        found = {}
        for signal in module.SIGNALS:
            if signal["sensor"] is not None:
                sensor = next(s for s in module.SENSORS if s["key"] == signal["sensor"])
                value = self.coordinate(ORDER[sensor["measures"]] + signal["derivative"])
                found[signal["key"]] = value @ reads(module, sensor, place)
            elif signal["actuator"] is not None:
                found[signal["key"]] = self.force(keys.index(signal["actuator"]), signal["derivative"])
            else:
                body = signal["key"].removeprefix("sign_")
                found[signal["key"]] = np.sign(self.coordinate(1)[:, place[body]])
        return found


def reads(module: ModuleType, sensor: Mapping[str, object], place: Mapping[str, int]) -> FloatArray:
    """Return the combination of coordinates a sensor reads, from the module's own output matrix."""
    row = next(i for i, s in enumerate(module.SENSORS) if s["key"] == sensor["key"])
    space = module.state_space(dict.fromkeys(module.PARAMETERS, 1.0))
    order, bodies = ORDER[str(sensor["measures"])], len(place)
    if order < 2:
        return np.asarray(space.C[row, bodies * order : bodies * (order + 1)])
    pair = sensor["deflection"]
    combination = np.zeros(bodies)
    if pair is None:
        combination[place[str(sensor["body"])]] = 1.0
        return combination
    # of the acceleration rows of A this row of C is the same combination as the sensor's of the coordinates
    return np.asarray(np.linalg.lstsq(space.A[bodies:].T, space.C[row], rcond=None)[0])
