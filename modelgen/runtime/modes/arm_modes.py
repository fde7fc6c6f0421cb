"""Modes of an elastic arm about the postures of its records: linear about rest, with intervals.

Springs and the mass matrix make them; what gravity adds to the stiffness is left out, so that an arm whose
motors are free moves freely as a whole. Motors that are held (by brakes, or by a controller far stiffer than
the springs) leave the links to swing by themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import listed
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.mode_values import PairValues, pair_values
from modelgen.runtime.modes.modes import Modes, PostureModes
from modelgen.runtime.modes.pole_pairs import PolePair, pair_slopes, pole_pairs, undamped_modes
from modelgen.runtime.modes.thresholds import MOST_POSTURES, ROUNDING, STRETCHED
from modelgen.runtime.modes.uncertain_chain import UncertainChain
from modelgen.runtime.numerics.decorrelation import square_root
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.arms.arm_coordinates import (
    ArmCoordinates,
    arm_coordinates,
    coordinates_about_rest,
)
from modelgen.runtime.simulation.arms.arm_plant import ArmPlant

#: Mass, damping and stiffness about each posture, shape (postures, coordinates, coordinates) each.
Matrices = tuple[FloatArray, FloatArray, FloatArray]
ELSEWHERE = (
    "No modes: those of an elastic arm need rows of motors and links apart, and encoders or tachometers, not "
    "gyros, for the speeds in them; payloads and coupled motors' own rows have none yet."
)
LACKING = "No modes: {names} without a number."
NOT_SOLID = "No modes: the mass matrix of the estimate is not positive definite; no links have these values."


@dataclass(frozen=True, eq=False)
class _About:
    """Matrices about postures, and what each base parameter adds to them per unit."""

    matrices: Matrices
    changes: tuple[Matrices, ...]

    def at(self, values: FloatArray, known: FloatArray) -> Matrices:
        """Return the matrices with other values of the base parameters."""
        moved = [whole.copy() for whole in self.matrices]
        for value, before, change in zip(values, known, self.changes, strict=True):
            for whole, part in zip(moved, change, strict=True):
                whole += (value - before) * part
        return moved[0], moved[1], moved[2]


def modes_of_arm(
    model: Model, params: Mapping[str, float], covariance: FloatArray, records: Sequence[Record]
) -> Modes:
    """Return modes at those postures of the records in which one is lowest or highest.

    Parameters
    ----------
    model : Model
    params : mapping of str to float
        Base parameters that have a number (SI),
    covariance : array, shape (params, params)
        and their covariance.
    records : sequence of Record
    """
    own = _coordinates(model)
    if own is None:
        elastic = any(role.role == "stiffness" for role in model.roles.values())
        return Modes(notes=(ELSEWHERE,)) if elastic else Modes()
    if not own.elastic or not records:
        return Modes()
    places, postures = _postures(own, records)
    return arm_modes(model, params, covariance, postures, places)


def arm_modes(
    model: Model,
    params: Mapping[str, float],
    covariance: FloatArray,
    postures: FloatArray,
    places: Sequence[tuple[str, float]] = (),
) -> Modes:
    """Return modes at those postures in which one of them is lowest or highest.

    Parameters
    ----------
    postures : array, shape (joints, postures)
        Positions of the links, rad or m.
    places : sequence of (record, time in s), optional
        Where each was taken from; without them all postures are told.
    """
    own = _coordinates(model)
    if own is None:
        return Modes(notes=(ELSEWHERE,))
    known = np.array([params.get(name, 0.0) for name in model.base_parameters])
    lacking = [name for name in model.base_parameters if name not in params]
    needed, damped = _holding(model, own, lacking, postures[:, :1])
    if needed:
        return Modes(notes=(LACKING.format(names=listed(needed)),))
    whole = _matrices(ArmPlant(model, known, own), postures)
    try:
        kept = _extremes(own, whole) if places else range(postures.shape[1])
    except np.linalg.LinAlgError:
        return Modes(notes=(NOT_SOLID,))
    chosen = postures[:, list(kept)]
    about = _about(model, own, known, chosen)
    root = np.zeros((len(known), len(params)))
    root[[model.base_parameters.index(name) for name in params]] = square_root(covariance)
    none = np.zeros((len(known), 0))
    chain = UncertainChain(model.base_parameters, known, root, none, none)
    found = []
    for k, place in enumerate(kept):
        record, time_s = places[place] if places else ("", None)
        where = dict(zip(own.joints, chosen[:, k].tolist(), strict=True))
        sides = (_values(own, about, k, chain, held, damped) for held in (False, True))
        found.append(PostureModes(record, time_s, where, *sides))
    return Modes(postures=tuple(found))


def _coordinates(model: Model) -> ArmCoordinates | None:
    return arm_coordinates(model) or coordinates_about_rest(model)


def _holding(
    model: Model, own: ArmCoordinates, lacking: Sequence[str], postures: FloatArray
) -> tuple[list[str], bool]:
    """Return which of these parameters mass and stiffness hold, and whether damping holds none."""
    nothing = _matrices(ArmPlant(model, np.zeros(len(model.base_parameters)), own), postures)
    needed, damped = [], True
    for name in lacking:
        unit = np.array([float(name == one) for one in model.base_parameters])
        change = _matrices(ArmPlant(model, unit, own), postures)
        mass, damping, stiffness = (bool((a != b).any()) for a, b in zip(change, nothing, strict=True))
        needed += [name] if mass or stiffness else []
        damped &= not damping
    return needed, damped


def _postures(own: ArmCoordinates, records: Sequence[Record]) -> tuple[list[tuple[str, float]], FloatArray]:
    """Return postures at equal steps along the records, with record and time in s."""
    a_record = max(2, MOST_POSTURES // len(records))
    places, found = [], []
    for record in records:
        samples = np.unique(np.linspace(0, record.n - 1, a_record).round().astype(int))
        signals = {
            key: np.asarray(record.signals[key])[samples] for key in own.channels if key in record.signals
        }
        found.append(_seen(own, signals))
        places += [(record.name, float(k / record.fs)) for k in samples.tolist()]
    return places, np.hstack(found)


def _seen(own: ArmCoordinates, signals: Mapping[str, FloatArray]) -> FloatArray:
    """Return positions of links, shape (joints, N); where not all is seen, as if no spring deflected."""
    if len(signals) == len(own.channels):
        return own.seen_in(signals)[: len(own.joints)]
    together = own.reads[[own.channels.index(key) for key in signals]] @ own.stiff
    return np.asarray(np.linalg.pinv(together) @ np.array([*signals.values()], dtype=float))


def _about(model: Model, own: ArmCoordinates, known: FloatArray, postures: FloatArray) -> _About:
    """Return the matrices about postures; they are linear in the base parameters."""
    nothing = _matrices(ArmPlant(model, np.zeros_like(known), own), postures)
    changes = []
    for unit in np.eye(len(known)):
        one = _matrices(ArmPlant(model, unit, own), postures)
        changes.append(tuple(a - b for a, b in zip(one, nothing, strict=True)))
    return _About(_matrices(ArmPlant(model, known, own), postures), tuple((m, d, k) for m, d, k in changes))


def _matrices(plant: ArmPlant, postures: FloatArray) -> Matrices:
    """Return mass, damping and stiffness at rest about postures of the links, springs unloaded."""
    own, at_rest = plant.coordinates, plant.coordinates.stiff @ postures
    rest, n = np.zeros_like(at_rest), len(own.names)
    springs = [(joint, motor) for joint, motor in enumerate(own.driven) if motor != joint]
    units = [one[:, None] + rest for one in np.eye(n)]
    motions = [(at_rest, rest, rest), *((at_rest, rest, one) for one in units)]
    motions += [(at_rest, speed * one, rest) for speed in (2.0, 1.0, -1.0, -2.0) for one in units]
    motions += [
        (at_rest + way * STRETCHED * units[motor], rest, rest) for way in (-1.0, 1.0) for _, motor in springs
    ]
    every = plant.balance(*(np.hstack(parts) for parts in zip(*motions, strict=True)))
    # (motion, posture, balance)
    found = np.transpose(every.reshape(n, len(motions), -1), (1, 2, 0))
    mass = np.transpose(found[1 : n + 1] - found[0], (1, 2, 0))
    forward_2, forward, backward, backward_2 = (found[1 + k * n :][:n] for k in range(1, 5))
    # Coulomb friction and what grows with squares of speeds cancel
    damping = np.transpose(0.5 * (forward_2 - forward + backward - backward_2), (1, 2, 0))
    stiffness = np.zeros_like(mass)
    behind, ahead = (found[1 + 5 * n + k * len(springs) :][: len(springs)] for k in range(2))
    for pulled, (joint, motor) in zip(behind - ahead, springs, strict=True):
        spring = pulled[:, joint] / (2.0 * STRETCHED)
        for row, column, sign in (
            (joint, joint, 1),
            (joint, motor, -1),
            (motor, joint, -1),
            (motor, motor, 1),
        ):
            stiffness[:, row, column] = sign * spring
    damping[np.abs(damping) < ROUNDING * np.abs(damping).max(initial=0.0)] = 0.0
    return 0.5 * (mass + np.transpose(mass, (0, 2, 1))), damping, stiffness


def _extremes(own: ArmCoordinates, matrices: Matrices) -> list[int]:
    """Return places of the postures in which a mode is lowest or highest, in order."""
    squares = np.array([undamped_modes(m, k).squares for m, k in zip(matrices[0], matrices[2], strict=True)])[
        :, len(own.joints) :
    ]
    return sorted({*squares.argmin(axis=0).tolist(), *squares.argmax(axis=0).tolist()})


def _values(
    own: ArmCoordinates, about: _About, place: int, chain: UncertainChain, held: bool, damped: bool
) -> tuple[PairValues, ...]:
    """Return the modes at a posture, with motors held or free; free motions are left out."""
    size = len(own.names)
    links = [k for k in range(len(own.joints)) if own.driven[k] != k]
    block = np.ix_(links, links) if held else np.ix_(range(size), range(size))
    mass, damping, stiffness = (one[place][block] for one in about.matrices)
    changes = [tuple(one[place][block] for one in change) for change in about.changes]
    undamped = undamped_modes(mass, stiffness)
    pairs = pole_pairs(mass, damping, stiffness, undamped)
    found = []
    slopes = pair_slopes(mass, damping, stiffness, undamped, pairs, [(m, d, s) for m, d, s in changes])
    for k, pair in enumerate(pairs):
        if undamped.squares[k] <= 0.0:
            continue

        def at(moved: dict[str, float], k: int = k) -> PolePair | None:
            values = np.array([moved[name] for name in chain.names])
            m, d, s = (one[place][block] for one in about.at(values, chain.values))
            try:
                return pole_pairs(m, d, s, undamped)[k]
            except np.linalg.LinAlgError:
                return None

        told = pair_values(pair, slopes[k], False, chain, at, frozenset())
        found.append(
            told if damped and damping.any() else replace(told, damping_ratio=None, time_constants_s=())
        )
    return tuple(found)
