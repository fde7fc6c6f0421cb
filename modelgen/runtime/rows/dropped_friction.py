"""Coulomb friction whose derivatives a row drops, and how much of each of them the row holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.model.chain_matrices import chain_matrices
from modelgen.runtime.model.model import Model
from modelgen.runtime.rows.row_terms import mismatch_terms
from modelgen.runtime.simulation.plant import sensor_levers


@dataclass(frozen=True)
class DroppedFriction:
    """Coulomb friction of one body in one row.

    With s the sign of the body's velocity and F its friction, the row is

        Y = W X + F sum over k of c_k d^k s / dt^k

    where W lacks the columns of F. The c_k depend on the physical parameters (`felt_forces`).

    Attributes
    ----------
    body : str
    key : str
        Signal of its velocity, or of its direction.
    friction : str
        Physical parameter F.
    columns : tuple of int
        Base parameters in which the row holds F: those of s itself.
    """

    body: str
    key: str
    friction: str
    columns: tuple[int, ...]


@dataclass(frozen=True)
class SignTerm:
    """The sign of a body's velocity in a row: `factor` of feature `key` in a base parameter's column."""

    body: str
    key: str
    column: int
    factor: float


def sign_terms(model: Model, row: int) -> tuple[SignTerm, ...]:
    """Return the signs of velocities in a row, of bodies with one Coulomb friction for both directions."""
    signs = {one.key: str(one.of) for one in model.features if one.function == "sign" and one.times is None}
    found = []
    for column, terms in model.regressor_columns[row].items():
        for factor, key in terms:
            one = _of_body(model, signs[key], (column,)) if key in signs else None
            if one is not None:
                found.append(SignTerm(one.body, key, column, float(factor)))
    return tuple(found)


def dropped_friction(model: Model, row: int) -> tuple[DroppedFriction, ...]:
    """Return all friction of a row that drops some where it is differentiated; none if one is not known.

    That of bodies without a sensor counts as well.
    """
    reversing = model.rows[row].reversals
    if not reversing or model.is_arm:
        return ()
    signs = {one.key: str(one.of) for one in model.features if one.function == "sign"}
    held: dict[str, list[int]] = {key: [] for key in reversing}
    for column, terms in model.regressor_columns[row].items():
        turning = {signs[key] for _, key in terms if key in signs}
        if turning and any(key not in signs for _, key in terms):
            return ()
        for key in sorted(turning):
            held.setdefault(key, []).append(column)
    found = []
    for key, columns in held.items():
        one = _of_body(model, key, tuple(columns))
        if one is None:
            return ()
        found.append(one)
    return tuple(found)


def felt_forces(model: Model, values: Mapping[str, float]) -> tuple[FloatArray, ...]:
    """Return c_k of a force against the motion of each body, one array (orders, bodies) a row of the model.

    For motion q of the chain under forces f on its bodies, f = (M s^2 + D s + K) q, what a row does not
    fulfil is P(s) f. What it takes of the sensors is then P(s) (M s^2 + D s + K), and division gives P.

    Parameters
    ----------
    model : Model
    values : mapping of str to float
        Physical parameters (SI), all of them, of either sign.
    """
    chain = chain_matrices(model)
    M, D, K = chain.at({**model.known, **values})
    n = len(chain.bodies)
    shows = _shown_motion(model)
    found = []
    # friction that depends on the direction counts with the mean of both, as in D
    halves = {one.key: one.times for one in model.features if one.function in ("forward", "backward")}
    for weights in mismatch_terms(model, model.base_from_physical(values)):
        mean = dict(weights)
        for key, times in halves.items():
            if times is not None and key in weights:
                mean[times] = mean.get(times, 0.0) + 0.5 * weights[key]
        seen = [
            (shows[signal.sensor][1] + signal.derivative, mean[signal.key] * shows[signal.sensor][0])
            for signal in model.signals
            if signal.key in mean and signal.sensor in shows
        ]
        taken = np.zeros((max([2, *(order + 1 for order, _ in seen)]), n))
        for order, motion in seen:
            taken[order] += motion
        P = np.zeros((len(taken), n))
        for k in range(len(taken) - 3, -1, -1):
            # of a body that has lost its inertia it is not finite, and refused where it enters rows
            with np.errstate(divide="ignore", invalid="ignore"):
                P[k] = (taken[k + 2] - P[k + 1] @ D - P[k + 2] @ K) / M
        found.append(-P[: max(len(taken) - 2, 0)])
    return tuple(found)


@lru_cache(maxsize=8)
def _shown_motion(model: Model) -> dict[str, tuple[FloatArray, int]]:
    """Return the motion of the bodies that a sensor reads, shape (bodies,), and how often differentiated."""
    levers = sensor_levers(model)
    return {sensor.key: (levers[place], sensor.order) for place, sensor in enumerate(model.sensors)}


def _body(model: Model, key: str) -> str | None:
    """Return the body whose velocity a signal is, or whose direction."""
    signal = next(one for one in model.signals if one.key == key)
    if signal.sensor is None:
        return key.removeprefix("sign_")
    return next(one.body for one in model.sensors if one.key == signal.sensor)


def _of_body(model: Model, key: str, columns: tuple[int, ...]) -> DroppedFriction | None:
    body = _body(model, key)
    for one in model.friction:
        name = one.coulomb_plus
        if one.body == body and not one.asymmetric and name in model.parameters:
            return DroppedFriction(one.body, key, str(name), columns)
    return None
