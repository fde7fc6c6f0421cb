"""What a further force changes in the readings of a chain, which rows feel it, and how bodies feel a link."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.runtime.filters.power_spectrum import quick_length
from modelgen.runtime.iv.companion_simulation import Simulated
from modelgen.runtime.iv.thresholds import FELT_SHARE, SEEN_AT
from modelgen.runtime.simulation.plant import Plant


def deflection_of(plant: Plant, stiffness: str) -> FloatArray:
    """Return the deflection of the link of a stiffness per motion of each body, shape (bodies,).

    From the direct model: A falls by (lever / inertia) lever^T per unit of stiffness. Other springs are taken
    away: beside a large one a unit would be lost in rounding.
    """
    n = len(plant.bodies)
    mode = tuple(1 for _ in plant.sticking)
    soft = {
        name: 0.0 if name in plant.model.roles and plant.model.roles[name].role == "stiffness" else value
        for name, value in plant.parameters.items()
    }
    without, alone = (
        replace(plant, parameters=values).space(mode).A[n:, :n] for values in (soft, {**soft, stiffness: 1.0})
    )
    square = plant.inertia[:, None] * (without - alone)
    size = np.sqrt(np.maximum(np.diag(square), 0.0))
    first = int(np.argmax(size))
    return np.asarray(square[first] / (size[first] or 1.0))


class Pushed(Mapping[str, FloatArray]):
    """What a further force changes in each channel, in SI, shape (n,), worked out when it is asked for.

    The chain is linear between reversals, and held in place (`HeldChain`). `push` is how the force acts on
    the bodies, `acts` whether there is any, and `size` the samples that its spectrum is of.
    """

    def __init__(self, simulated: Simulated, push: FloatArray, force: FloatArray) -> None:
        """Take how the force acts on the bodies, shape (bodies,), and the force in N m or N, shape (n,)."""
        record = simulated.record
        self._held, self._push, self._n, self._felt = simulated.held, push, record.n, simulated.felt
        self.push, self.acts = tuple(push.tolist()), bool(np.any(force))
        self._mismatch = simulated.mismatch
        self.size = quick_length(record.n)
        padded = np.concatenate([force, np.linspace(force[-1], force[0], self.size - record.n + 2)[1:-1]])
        self._spectrum = np.fft.rfft(padded)
        self._keys = tuple(key for key in self._held.readings if key in record.signals)
        self._found: dict[str, FloatArray] = {}

    def __getitem__(self, key: str) -> FloatArray:
        if key not in self._keys:
            raise KeyError(key)
        return self.among({key})[key]

    def among(self, keys: Collection[str]) -> dict[str, FloatArray]:
        """Return the changes of the channels among some keys, shape (n,) each, worked out together."""
        asked = [key for key in self._keys if key in keys]
        missing = [key for key in asked if key not in self._found]
        for key, way in self.ways(missing).items():
            self._found[key] = self.answered(way)
        return {key: self._found[key] for key in asked}

    def ways(self, keys: Collection[str]) -> dict[str, ComplexArray]:
        """Return what channels read per unit of the push, shape (frequencies,) each."""
        return self._held.read(keys, self._push)

    def answered(self, way: ComplexArray) -> FloatArray:
        """Return what answers the push in this way, shape (n,), from (frequencies,), in the way's unit."""
        return np.asarray(np.fft.irfft(way * self._spectrum, self.size)[: self._n])

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)

    def felt_rows(self) -> tuple[int, ...]:
        """Return the rows of the model that feel the force.

        A row that is the balance of other bodies is fulfilled by what the force does to them. Friction does
        not change its direction at the same instants then; that is no part of what the force does.
        """
        if self.push not in self._felt:
            self._felt[self.push] = self._feeling()
        return self._felt[self.push]

    def _feeling(self) -> tuple[int, ...]:
        held, model = self._held, self._held.plant.model
        places = slice(1, None, max((len(held.omega) - 1) // SEEN_AT, 1))
        omega = held.omega[places, None]
        keys, column = {*self._keys}, {key: index for index, key in enumerate(held.readings)}
        moved = [signal for signal in model.signals if signal.channel in keys]
        of = [column[signal.channel] for signal in moved]
        order = np.array([signal.derivative for signal in moved])
        read, most = held.readings_at(places, self._push)
        shares = np.zeros((len(moved), len(model.rows)))
        place = {signal.key: index for index, signal in enumerate(moved)}
        for row, weights in enumerate(self._mismatch):
            for key in weights.keys() & place.keys():
                shares[place[key], row] = weights[key]
        left = ((1j * omega) ** order * read[:, of]) @ shares
        size = (omega**order * most[:, of]) @ np.abs(shares)
        return tuple(np.flatnonzero(np.any(np.abs(left) > FELT_SHARE * size, axis=0)).tolist())


def pushed_body(simulated: Simulated, body: str, force: FloatArray) -> Pushed:
    """Return what a force on one body, in N m or N, shape (n,), changes in the channels."""
    push = np.array([float(name == body) for name in simulated.plant.bodies])
    return Pushed(simulated, push, force)


def pushed_link(simulated: Simulated, stiffness: str, force: FloatArray) -> Pushed:
    """Return what a further force in the link of a stiffness, in N m or N, shape (n,), changes."""
    return Pushed(simulated, deflection_of(simulated.plant, stiffness), -force)
