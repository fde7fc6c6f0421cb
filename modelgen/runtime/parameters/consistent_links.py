"""The physically consistent estimate of an arm that is nearest to its base parameters.

Some distribution of mass makes the ten parameters of a link exactly if its pseudo-inertia (Wensing, Kim and
Slotine 2018), a symmetric matrix of four rows that is linear in them, has no negative eigenvalue. With
friction, rotor inertias and stiffness that are not negative, the nearest estimate is a convex problem.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.optional_library import optional_library
from modelgen.runtime.model.arm_functions import base_factors
from modelgen.runtime.parameters.thresholds import HELD, SMALLEST_CURVATURE, SOLVER_GAP, SOLVER_TOLERANCE

#: The ten parameters of a link, in the order in which `consistent_links` takes their names.
LINK = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m")
_ROOT = np.sqrt(2.0)
#: Entries of the upper triangle column by column: how often each of LINK counts.
_PSEUDO_INERTIA: tuple[Mapping[str, float], ...] = (
    {"Ixx": -0.5, "Iyy": 0.5, "Izz": 0.5},
    {"Ixy": -_ROOT},
    {"Ixx": 0.5, "Iyy": -0.5, "Izz": 0.5},
    {"Ixz": -_ROOT},
    {"Iyz": -_ROOT},
    {"Ixx": 0.5, "Iyy": 0.5, "Izz": -0.5},
    {"mx": _ROOT},
    {"my": _ROOT},
    {"mz": _ROOT},
    {"m": 1.0},
)


def _matrix(quantity: str) -> FloatArray:
    """Return what one of LINK adds to the pseudo-inertia, shape (4, 4), a unit of it (SI)."""
    found = np.zeros((4, 4))
    for column, row, entry in zip(*np.tril_indices(4), _PSEUDO_INERTIA, strict=True):
        value = entry.get(quantity, 0.0)
        found[row, column] = found[column, row] = value if row == column else value / _ROOT
    return found


#: What each of LINK adds to the pseudo-inertia of its link.
PSEUDO_INERTIA: Mapping[str, FloatArray] = {quantity: _matrix(quantity) for quantity in LINK}


@dataclass(frozen=True)
class Bodies:
    """What is to be consistent: names of all parameters, ten of each link, and those no less than zero.

    `known` are values of parameters of links that are not among the first.
    """

    parameters: tuple[str, ...]
    links: tuple[tuple[str, ...], ...]
    nonnegative: tuple[str, ...]
    known: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ConsistentEstimate:
    """The nearest consistent parameters.

    Attributes
    ----------
    base
        Base parameters, in the order of those that were given.
    parameters
        Physical parameters (SI) that make them; one choice of many where parameters count together only.
    cost
        How much chi-square rose: a sum of squares of deviations, zero where the estimate was consistent.
    held
        Places of the links that the bound moves: some mass or moment of inertia of theirs is zero.
    zero
        Those of the parameters no less than zero that are held there.
    """

    base: FloatArray
    parameters: Mapping[str, float]
    cost: float
    held: tuple[int, ...] = ()
    zero: tuple[str, ...] = ()


def consistent_links(
    estimate: FloatArray,
    covariance: FloatArray,
    base_from_physical: Callable[[Mapping[str, float]], FloatArray],
    parameters: Sequence[str],
    links: Sequence[Sequence[str]],
    nonnegative: Sequence[str] = (),
) -> ConsistentEstimate:
    """Return the consistent parameters whose base parameters are nearest to an estimate, by its covariance.

    Parameters
    ----------
    estimate, covariance : ndarray
        Base parameters in SI, shape (n,), and their covariance, shape (n, n), positive definite.
    base_from_physical : callable
        That of the arm's module: linear in the parameters.
    parameters : sequence of str
        All of them, ``PARAMETERS`` of the module.
    links : sequence of sequences of str
        Names of the ten parameters of every link, in the order of `LINK`.
    nonnegative : sequence of str
        Parameters that are no less than zero: friction, rotor inertias, stiffness.

    Raises
    ------
    DataError
        If Clarabel is not installed, the covariance is not positive definite, or the solver does not end.
    """
    where = "covariance of the base parameters"
    try:
        whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    except np.linalg.LinAlgError as error:
        remedy = "take out parameters that the record does not show"
        raise DataError.at(where, "is not positive definite", remedy) from error
    factors, offset = base_factors(base_from_physical, parameters)
    bodies = Bodies(tuple(parameters), tuple(map(tuple, links)), tuple(nonnegative))
    return nearest_bodies(estimate - offset, whitening, factors, bodies, offset)


def nearest_bodies(
    estimate: FloatArray, whitening: FloatArray, factors: FloatArray, bodies: Bodies, offset: FloatArray
) -> ConsistentEstimate:
    """Return the consistent parameters that make whitening @ (factors @ parameters - estimate) shortest.

    Parameters
    ----------
    estimate : ndarray
        Base parameters less `offset`, shape (n,).
    whitening : ndarray
        Shape (k, n); its product with the estimate's error has unit covariance.
    factors : ndarray
        How often each parameter counts in each base parameter, shape (n, parameters).
    bodies : Bodies
    offset : ndarray
        What known parameters contribute to the base parameters, shape (n,).
    """
    clarabel = optional_library("clarabel", "arms", "the physically consistent estimate of an arm")
    white = whitening @ factors
    size = np.linalg.norm(white, axis=0)
    # in columns of unit length; what no base parameter sees is scaled as what is seen
    size = np.where(size > 0.0, size, np.median(size[size > 0.0]) if np.any(size) else 1.0)
    scaled = white / size
    curvature = scaled.T @ scaled + SMALLEST_CURVATURE * np.eye(len(size))
    rows, level = _cones(bodies)
    counts = len(bodies.nonnegative), len(bodies.links)
    # every cone in a unit of its own, in which its largest factor is one
    largest = np.max(np.abs(rows / size), axis=1)
    largest[counts[0] :] = np.repeat(np.max(largest[counts[0] :].reshape(-1, 10), axis=1, initial=0.0), 10)
    rows, level = rows / size / largest[:, None], level / largest
    # the move from parameters that make the estimate: by itself it is a few deviations, where the parameters
    # are many thousands of them, of which the solver's tolerance is more than one
    free = np.linalg.lstsq(factors / size, estimate, rcond=None)[0]
    left = whitening @ (factors @ (free / size) - estimate)
    level = level + rows @ free
    unit = max(1.0, float(np.max(np.abs(level))))
    move, forces = _solved(clarabel, curvature, scaled.T @ left / unit, rows, level / unit, counts)
    found, forces = free + unit * move, unit * forces
    # what each bound pulls parameters by, in deviations that they would have if all others were known
    pulls = rows * forces[:, None]
    zero = tuple(n for n, pull in zip(bodies.nonnegative, pulls, strict=False) if np.max(np.abs(pull)) > HELD)
    each = pulls[counts[0] :].reshape(counts[1], 10, -1).sum(axis=1)
    held = tuple(index for index, pull in enumerate(each) if np.max(np.abs(pull)) > HELD)
    found = np.where(np.isin(bodies.parameters, zero), 0.0, found / size)
    values = dict(zip(bodies.parameters, found.tolist(), strict=True))
    for names in bodies.links:
        _lift(values, bodies.known, names)
    base = factors @ np.array([values[name] for name in bodies.parameters])
    left = whitening @ (base - estimate)
    return ConsistentEstimate(base + offset, values, float(left @ left), held, zero)


def _cones(bodies: Bodies) -> tuple[FloatArray, FloatArray]:
    """Return matrix and vector: their product with the parameters, and sum, lie in the cones."""
    place = {name: k for k, name in enumerate(bodies.parameters)}
    rows = np.zeros((len(bodies.nonnegative) + 10 * len(bodies.links), len(place)))
    level = np.zeros(len(rows))
    for row, name in enumerate(bodies.nonnegative):
        rows[row, place[name]] = 1.0
    at = len(bodies.nonnegative)
    for names in bodies.links:
        own = dict(zip(LINK, names, strict=True))
        for entry in _PSEUDO_INERTIA:
            for quantity, factor in entry.items():
                if own[quantity] in place:
                    rows[at, place[own[quantity]]] += factor
                else:
                    level[at] += factor * bodies.known[own[quantity]]
            at += 1
    return rows, level


def _lift(values: dict[str, float], known: Mapping[str, float], names: Sequence[str]) -> None:
    """Add to a link's masses what the solver's rounding left below zero, if anything."""
    every = {**known, **values}
    matrix = sum(every[name] * PSEUDO_INERTIA[quantity] for quantity, name in zip(LINK, names, strict=True))
    below = max(0.0, -float(np.linalg.eigvalsh(matrix)[0]))
    for quantity, name in zip(LINK, names, strict=True):
        if name in values:
            values[name] += below * {"Ixx": 2.0, "Iyy": 2.0, "Izz": 2.0, "m": 1.0}.get(quantity, 0.0)


def _solved(
    clarabel: Any,
    curvature: FloatArray,
    slope: FloatArray,
    rows: FloatArray,
    level: FloatArray,
    counts: tuple[int, int],
) -> tuple[FloatArray, FloatArray]:
    """Return the minimum of x P x / 2 + q x with rows x + level in the cones, and the forces of the cones.

    `counts` are those of the half-lines and of the triangles of matrices.
    """
    from scipy.sparse import csc_matrix

    halves, triangles = counts
    kinds = ([clarabel.NonnegativeConeT(halves)] if halves else []) + [
        clarabel.PSDTriangleConeT(4) for _ in range(triangles)
    ]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_feas = SOLVER_TOLERANCE
    settings.tol_gap_abs = settings.tol_gap_rel = SOLVER_GAP
    # what Clarabel adds to its equations is less than the curvature of what nothing sees (1e-8 by itself)
    settings.static_regularization_constant = 0.1 * SMALLEST_CURVATURE
    solver = clarabel.DefaultSolver(
        csc_matrix(np.triu(curvature)), slope, csc_matrix(-rows), level, kinds, settings
    )
    solution = solver.solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        what = f"has no optimum that Clarabel finds ({solution.status})"
        raise DataError.at(
            "the physically consistent estimate", what, "look at the base parameters for outliers"
        )
    return np.array(solution.x), np.array(solution.z)
