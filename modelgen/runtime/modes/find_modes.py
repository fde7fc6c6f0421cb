"""Modes of a chain from what is known of its parameters; those that the records leave open are named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import listed
from modelgen.runtime.model.chain_matrices import ChainMatrices, chain_matrices
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.mode_values import PairValues, pair_values
from modelgen.runtime.modes.modes import Antiresonance, Mode, Modes
from modelgen.runtime.modes.pole_pairs import PolePair, UndampedModes, pair_slopes, pole_pairs, undamped_modes
from modelgen.runtime.modes.thresholds import LOOSE_PART, LOOSE_SIZE, OPEN_SHARE, ROUNDING, TRIED
from modelgen.runtime.modes.uncertain_chain import UncertainChain, without_inertia

LINEAR = "Linear about rest: {names} is the cube of a deflection and has no part there."
BOTH_WAYS = "Friction that depends on the direction counts with the mean of both."
OPEN = "{count} of {total} modes cannot be computed: they need {names}, which the records leave open."
UNDAMPED = (
    "Damping ratios and time constants need {names}, which the records leave open; the frequencies hold for "
    "{taken}."
)
DECAY = "The time constant needs {names}, which the records leave open."
IMPOSSIBLE = "No modes: {why}."
PUSHED = "{count} of {total} modes would run away: stiffnesses below zero."


def modes_at(model: Model, values: Mapping[str, float]) -> Modes:
    """Return the modes of a chain whose parameters are known (SI), known ones of the model included."""
    names = model.parameters
    exact = np.array([float({**model.known, **values}[name]) for name in names])
    none = np.zeros((len(names), 0))
    return find_modes(model, UncertainChain(names, exact, none, none, none))


def find_modes(
    model: Model,
    chain: UncertainChain,
    again: Callable[[Mapping[str, float]], UncertainChain] | None = None,
) -> Modes:
    """Return the modes that follow from what is known of a chain.

    Parameters
    ----------
    model : Model
    chain : UncertainChain
    again : callable, optional
        Gives the chain that fits the base parameters as well, near other values: what is the same there does
        not depend on what they leave open. Needed where `chain.open` is not empty.
    """
    matrices = chain_matrices(model)
    weightless = without_inertia(model, chain)
    if weightless:
        return Modes(notes=(IMPOSSIBLE.format(why=weightless),))
    other = None
    if chain.open.shape[1] and again is not None:
        other = again(_moved_along(chain))
    found = _pairs(model, matrices, chain, other)
    modes = tuple(
        Mode(
            one.frequency_hz, one.damping_ratio, one.time_constants_s, _shape(matrices, found.inertia, shape)
        )
        for one, shape in zip(found.values, found.shapes, strict=True)
        if one is not None
    )
    zeros = [
        Antiresonance(one.frequency_hz, one.damping_ratio, one.time_constants_s, key, body)
        for key, body in _driven(model)
        for one in _pairs(model, _held(matrices, body), chain, other).values
        if one is not None and one.frequency_hz is not None
    ]
    return Modes(modes, tuple(zeros), _notes(model, matrices, chain, found))


class _Found:
    """Values of the pairs of one chain, None for those that are open or run away, and their shapes."""

    def __init__(self, inertia: FloatArray, undamped: UndampedModes) -> None:
        self.inertia = inertia
        self.shapes = list(undamped.shapes.T)
        self.values: list[PairValues | None] = []
        self.free = bool((undamped.squares == 0.0).any())
        self.open = self.undamped = self.pushed = 0


def _pairs(
    model: Model, matrices: ChainMatrices, chain: UncertainChain, other: UncertainChain | None
) -> _Found:
    values = _values(model, chain)
    inertia, _, K = matrices.at(values)
    undamped = undamped_modes(inertia, K)
    found = _Found(inertia, undamped)
    if not matrices.bodies:
        return found
    pairs, slopes = _slopes(matrices, chain, values, undamped)
    unknown = _depend(slopes, chain) | _loose(pairs, slopes, chain, undamped)
    if other is not None:
        at_other = _values(model, other)
        mass, _, stiffness = matrices.at(at_other)
        if np.all(mass > 0.0):  # else it is no chain that has modes
            elsewhere = undamped_modes(mass, stiffness)
            unknown |= _depend(_slopes(matrices, other, at_other, elsewhere)[1], other)
    solid = frozenset(matrices.inertias)
    for k, pair in enumerate(pairs):

        def at(moved: dict[str, float], k: int = k) -> PolePair | None:
            try:
                return pole_pairs(*matrices.at({**model.known, **moved}), undamped)[k]
            except np.linalg.LinAlgError:
                return None

        free = bool(undamped.squares[k] == 0.0)
        damping_open, frequency_open = unknown[k] & (True, not free)
        found.open += bool(frequency_open)
        found.undamped += bool(damping_open and not frequency_open)
        found.pushed += bool(undamped.squares[k] < 0.0)
        if frequency_open or not (free or pair.product > 0.0):
            found.values.append(None)
            continue
        told = pair_values(pair, slopes[k], free, chain, at, solid)
        found.values.append(PairValues(told.frequency_hz, None, ()) if damping_open else told)
    return found


def _slopes(
    matrices: ChainMatrices, chain: UncertainChain, values: Mapping[str, float], undamped: UndampedModes
) -> tuple[list[PolePair], FloatArray]:
    """Return the pairs, and the slopes of each one's sum and product, shape (pairs, 2, parameters)."""
    inertia, D, K = matrices.at(values)
    pairs = pole_pairs(inertia, D, K, undamped)
    none = np.zeros_like(K)
    changes = [
        (
            np.array([float(inertia_of == name) for inertia_of in matrices.inertias]),
            matrices.damping.get(name, none),
            matrices.stiffness.get(name, none),
        )
        for name in chain.names
    ]
    return pairs, pair_slopes(inertia, D, K, undamped, pairs, changes)


def _depend(slopes: FloatArray, chain: UncertainChain) -> npt.NDArray[np.bool_]:
    """Return which pairs' damping, and which frequencies, depend on what is left open, shape (pairs, 2).

    A frequency depends on damping by the square of it only: it is told where nothing but damping is open.
    """
    size = np.where(chain.values == 0.0, 1.0, np.abs(chain.values))
    scaled = slopes * size
    limit = OPEN_SHARE * np.linalg.norm(scaled, axis=2)
    damping = (np.linalg.norm(scaled @ chain.open, axis=2) > limit).any(axis=1)
    frequency = (np.linalg.norm(scaled @ chain.open_but_damping, axis=2) > limit).any(axis=1)
    return np.column_stack((damping, frequency))


def _loose(
    pairs: list[PolePair], slopes: FloatArray, chain: UncertainChain, undamped: UndampedModes
) -> npt.NDArray[np.bool_]:
    """Return the same for what is too uncertain for a linear step, shape (pairs, 2).

    Damping is in a pair's sum, the frequency is its product; of a free motion it is zero, whatever is known.
    """
    none = np.zeros((len(pairs), 2), dtype=bool)
    if chain.loose is None or not pairs:
        return none
    moved = np.linalg.norm(slopes @ chain.loose, axis=2)
    sizes = np.abs([(pair.sum, pair.product) for pair in pairs])
    lost = (moved > LOOSE_PART * np.linalg.norm(slopes @ chain.root, axis=2)) & (moved > LOOSE_SIZE * sizes)
    lost[:, 1] &= undamped.squares != 0.0
    return np.column_stack((lost.any(axis=1), lost[:, 1]))


def _moved_along(chain: UncertainChain) -> dict[str, float]:
    """Return values moved along all open directions at once."""
    step = chain.open.sum(axis=1)
    share = TRIED * step / max(float(np.abs(step).max()), np.finfo(float).tiny)
    return dict(zip(chain.names, (chain.values * np.exp(share)).tolist(), strict=True))


def _values(model: Model, chain: UncertainChain) -> dict[str, float]:
    return {**model.known, **chain.by_name}


def _driven(model: Model) -> list[tuple[str, str]]:
    """Return pairs of actuator and body, one a body."""
    bodies: dict[str, str] = {}
    for actuator in model.actuators:
        bodies.setdefault(actuator.body, actuator.key)
    return [(key, body) for body, key in bodies.items()]


def _held(matrices: ChainMatrices, body: str) -> ChainMatrices:
    """Return the chain whose body is held: its poles are the zeros from a force on it to its motion."""
    keep = [i for i, name in enumerate(matrices.bodies) if name != body]
    block = np.ix_(keep, keep)
    return replace(
        matrices,
        bodies=tuple(matrices.bodies[i] for i in keep),
        inertias=tuple(matrices.inertias[i] for i in keep),
        stiffness={name: matrix[block] for name, matrix in matrices.stiffness.items()},
        damping={name: matrix[block] for name, matrix in matrices.damping.items()},
    )


def _shape(matrices: ChainMatrices, inertia: FloatArray, shape: FloatArray) -> dict[str, float]:
    heaviest = int(np.argmax(inertia * shape**2))
    relative = shape / shape[heaviest]
    relative[np.abs(relative) < ROUNDING * np.abs(relative).max()] = 0.0
    return dict(zip(matrices.bodies, relative.tolist(), strict=True))


def _notes(model: Model, matrices: ChainMatrices, chain: UncertainChain, found: _Found) -> tuple[str, ...]:
    notes = []
    if found.open:
        names = listed(_left_open(chain.open_but_damping, chain, matrices))
        notes.append(OPEN.format(count=found.open, total=len(found.values), names=names))
    if found.undamped and not found.open:
        lost = _left_open(chain.open, chain, matrices)
        text = DECAY if len(found.values) == 1 and found.free else UNDAMPED
        taken = listed(f"{name} = {chain.by_name[name]:.4g}" for name in lost)
        notes.append(text.format(names=listed(lost), taken=taken))
    if found.pushed:
        notes.append(PUSHED.format(count=found.pushed, total=len(found.values)))
    if model.cubic_springs:
        names = listed([spring.parameter for spring in model.cubic_springs])
        notes.append(LINEAR.format(names=names))
    if any(friction.asymmetric for friction in model.friction):
        notes.append(BOTH_WAYS)
    return tuple(notes)


def _left_open(directions: FloatArray, chain: UncertainChain, matrices: ChainMatrices) -> list[str]:
    """Return the parameters of the matrices that move along these directions, or are too uncertain."""
    moving = np.abs(directions).max(axis=1, initial=0.0) > OPEN_SHARE
    lost = {n for n, m in zip(chain.names, moving, strict=True) if m} | {*chain.too_uncertain}
    return [name for name in chain.names if name in lost and name in matrices.parameters]
