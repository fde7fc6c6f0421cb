"""A start from measured frequency responses: the chain whose responses to its force come closest to them.

Rows of a chain with unseen bodies hold high derivatives, and noise in these hides its resonances; the
responses show them. A search comes to the nearest resonances only, so many chains are tried: the responses of
a chain cost next to nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log, pi

import numpy as np

from modelgen.array_types import ComplexArray, FloatArray
from modelgen.errors import ModelgenError
from modelgen.magnitudes import SMALLEST
from modelgen.runtime.iv.instrumental_variables import Setting
from modelgen.runtime.iv.thresholds import (
    COHERENT,
    FARTHEST_RESPONSE,
    MOST_COHERENT,
    RESPONSE_EVALUATIONS,
    RESPONSE_LINES,
    RESPONSE_SEARCHES,
    TRIED_CHAINS,
)
from modelgen.runtime.least_squares.thresholds import EARLIEST, LATEST
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.bounds import parameters_of
from modelgen.runtime.simulation.closed_loop import rigid_motion
from modelgen.runtime.simulation.plant import make_plant

# what a response depends on, and is above zero
SHAPING = ("inertia", "stiffness", "damping", "viscous")


@dataclass(frozen=True)
class ResponseStart:
    """Physical parameters (SI), delays of forces (s), and by what share responses miss the measured ones.

    `missed` is the median over the lines of what is left of the logarithm of their ratio.
    """

    values: Mapping[str, float]
    delays: Mapping[str, float]
    missed: float


@dataclass(frozen=True, eq=False)
class _Measured:
    """Responses of one sensor, by its place in the model: s = j omega (rad/s), all of shape (lines,)."""

    sensor: int
    s: ComplexArray
    response: ComplexArray
    weight: FloatArray


def response_start(
    setting: Setting,
    near: Mapping[str, float],
    late: Sequence[str],
    others: Sequence[Mapping[str, float]] = (),
) -> ResponseStart | None:
    """Return the chain whose responses come closest to the measured ones; None of several forces, or of none.

    Parameters
    ----------
    setting : Setting
    near : mapping of str to float
        All physical parameters (SI); what responses do not depend on is taken from there.
    late : sequence of str
        Forces whose delay is free.
    others : sequence of mapping
        Further chains (SI) to search from.
    """
    rigid = rigid_motion(setting.model)
    measured = _measured(setting) if rigid and len(setting.model.actuators) == 1 else []
    if not measured:
        return None
    sample = 1.0 / min(record.fs for record in setting.records)
    near = {name: value if np.isfinite(value) else 0.0 for name, value in near.items()}
    search = _Search(setting.model, measured, near, sample if late else 0.0)
    tried = sorted(_tried(setting.model, search, rigid), key=search.cost)
    known = [u for one in (near, *others) if (u := search.of(one)) is not None]
    found = [search.refined(one) for one in [*known, *tried[:RESPONSE_SEARCHES]]]
    if not found:
        return None
    best = min(found, key=search.cost)
    delays = dict.fromkeys(late, sample * float(best[-1]))
    values = search.values(best)
    rubbing = {name: near[name] for name in search.names if setting.model.roles[name].role == "viscous"}
    if min(rubbing.values(), default=0.0) >= 0.0:
        values |= rubbing  # a response takes Coulomb friction for viscous
    return ResponseStart(values, delays, search.missed(best))


def _measured(setting: Setting) -> list[_Measured]:
    """Return the responses of all sensors to the force in all records, where they are coherent."""
    model, found = setting.model, list[_Measured]()
    for record in setting.records:
        for place, sensor in enumerate(model.sensors):
            try:
                one = record.frequency_response(sensor.key, model.actuators[0].key)
            except ModelgenError:  # too short, or at rest
                continue
            f = one.frequency_hz
            good = np.flatnonzero((one.coherence > COHERENT) & (f < setting.choice.cutoff_hz))
            if good.size > RESPONSE_LINES:
                # as many in every octave, as far as there are
                wanted = np.geomspace(f[good[0]], f[good[-1]], RESPONSE_LINES)
                good = good[np.unique(np.searchsorted(f[good], wanted).clip(0, good.size - 1))]
            coherence = one.coherence[good]
            weight = np.sqrt(coherence / np.maximum(1.0 - coherence, 1.0 / MOST_COHERENT**2))
            if good.size:
                found.append(
                    _Measured(place, np.asarray(2j * pi * f[good], dtype=complex), one.response[good], weight)
                )
    return found


class _Search:
    """Chains by u: logarithms of the parameters of `names`, then the delay in samples."""

    def __init__(
        self, model: Model, measured: Sequence[_Measured], near: Mapping[str, float], sample: float
    ) -> None:
        self._model, self.measured, self._near, self._sample = model, measured, near, sample
        self.names = parameters_of(model, *SHAPING)

    def values(self, u: FloatArray) -> dict[str, float]:
        """Return all physical parameters, SI."""
        with np.errstate(over="ignore"):  # no chain has such a value, and none is made of it
            sizes = np.exp(u[:-1])
        return {**self._near, **dict(zip(self.names, sizes.tolist(), strict=True))}

    def of(self, values: Mapping[str, float]) -> FloatArray | None:
        """Return u of physical parameters, SI, without a delay; None where it has none."""
        sizes = np.array([abs(values[name]) for name in self.names])
        rubs = [self._model.roles[name].role in ("damping", "viscous") for name in self.names]
        sizes = np.where(rubs, np.maximum(sizes, SMALLEST), sizes)
        return np.r_[np.log(sizes), 0.0] if np.all(np.isfinite(sizes) & (sizes > 0.0)) else None

    def ratios(self, u: FloatArray) -> list[ComplexArray] | None:
        """Return logarithms of the chain's responses over the measured ones, shape (lines,) each, if any."""
        found = []
        with np.errstate(all="ignore"):
            try:
                plant = make_plant(self._model, self.values(u))
                space = plant.space(tuple(1 for _ in plant.sticking))
                rates, vectors = np.linalg.eig(np.asarray(space.A))
                entering = np.linalg.solve(vectors, np.asarray(space.B)[:, 0].astype(complex))
            except (ModelgenError, np.linalg.LinAlgError):
                return None
            shown, through = np.asarray(space.C) @ vectors, np.asarray(space.D)[:, 0]
            for one in self.measured:
                G = (1.0 / (one.s[:, None] - rates)) @ (shown[one.sensor] * entering) + through[one.sensor]
                ratio = np.log(G / one.response) + one.s * self._sample * u[-1]
                found.append(ratio.real + 1j * ((ratio.imag + pi) % (2.0 * pi) - pi))
        return found if all(np.all(np.isfinite(one)) for one in found) else None

    def errors(self, u: FloatArray) -> FloatArray:
        """Return these times the lines' weights, real parts and phases of each response in turn."""
        ratios = self.ratios(u)
        if ratios is None:
            return np.full(2 * sum(one.s.size for one in self.measured), FARTHEST_RESPONSE)
        weighted = [m.weight * one for m, one in zip(self.measured, ratios, strict=True)]
        return np.concatenate([part for one in weighted for part in (one.real, one.imag)])

    def cost(self, u: FloatArray) -> float:
        """Return what is left, with little weight on what is far off: friction bends a part of the lines."""
        return float(np.sum(np.sqrt(1.0 + self.errors(u) ** 2) - 1.0))

    def missed(self, u: FloatArray) -> float:
        """Return the median of what is left, without weights."""
        ratios = self.ratios(u)
        return np.inf if ratios is None else float(np.median(np.abs(np.concatenate(ratios))))

    def refined(self, u: FloatArray) -> FloatArray:
        """Return the chain that leaves least, near one."""
        from scipy.optimize import least_squares

        bounds = np.full((2, u.size), ((-np.inf,), (np.inf,)))
        bounds[:, -1] = EARLIEST, LATEST
        return np.asarray(
            least_squares(self.errors, u, bounds=bounds, loss="soft_l1", max_nfev=RESPONSE_EVALUATIONS).x
        )

    def sized(self, u: FloatArray) -> FloatArray | None:
        """Return a chain with all forces by the factor that the lines ask for: its responses fall by it."""
        ratios = self.ratios(u)
        if ratios is None:
            return None
        left = sum(float(m.weight @ one.real) for m, one in zip(self.measured, ratios, strict=True))
        share = left / sum(float(one.weight.sum()) for one in self.measured)
        return np.asarray(np.r_[u[:-1] + share, u[-1]])


def _tried(model: Model, search: _Search, rigid: Mapping[str, float]) -> list[FloatArray]:
    """Return chains with resonances all over the range of the lines; `rigid` is as of `rigid_motion`."""
    rng = np.random.default_rng(0)
    rates = np.concatenate([np.abs(one.s) for one in search.measured])
    low, high = log(rates.min()), log(1.5 * rates.max())
    found = []
    for _ in range(TRIED_CHAINS):
        inertia = {body: 10.0 ** rng.uniform(-1.0, 1.0) / (one or 1.0) ** 2 for body, one in rigid.items()}
        rate_of = dict[tuple[str, ...], float]()
        u = np.zeros(len(search.names) + 1)
        for place, name in enumerate(search.names):
            role = model.roles[name]
            swinging = min(inertia[body] for body in role.bodies if body in inertia)
            rate = rate_of.setdefault(tuple(sorted(role.bodies)), float(np.exp(rng.uniform(low, high))))
            damping = 2.0 * 10.0 ** rng.uniform(-2.0, -0.7) * swinging
            sizes = {
                "inertia": swinging,
                "stiffness": swinging * rate**2,
                "damping": damping * rate,
                "viscous": damping * np.exp(low),
            }
            u[place] = log(sizes[role.role])
        sized = search.sized(u)
        if sized is not None:
            found.append(sized)
    return found
