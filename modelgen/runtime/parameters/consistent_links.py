"""The physically consistent estimate of an arm that is nearest to its base parameters.

Some distribution of mass makes the ten parameters of a link exactly if its pseudo-inertia (Wensing, Kim and
Slotine 2018), a symmetric matrix of four rows that is linear in them, has no negative eigenvalue. With
friction, rotor inertias and stiffness that are not negative, the nearest estimate is a convex problem.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.optional_library import optional_library
from modelgen.runtime.model.arm_functions import base_factors
from modelgen.runtime.parameters.thresholds import SMALLEST_CURVATURE

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
    """

    base: FloatArray
    parameters: Mapping[str, float]
    cost: float


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
        Base parameters, shape (n,), and their covariance, shape (n, n), positive definite.
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
    clarabel = optional_library("clarabel", "arms", "the physically consistent estimate of an arm")
    where = "covariance of the base parameters"
    try:
        whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    except np.linalg.LinAlgError as error:
        remedy = "take out parameters that the record does not show"
        raise DataError.at(where, "is not positive definite", remedy) from error
    place = {name: k for k, name in enumerate(parameters)}
    factors, offset = base_factors(base_from_physical, parameters)
    white = whitening @ factors
    residual = whitening @ (estimate - offset)
    curvature = white.T @ white
    curvature += SMALLEST_CURVATURE * float(np.max(np.diag(curvature))) * np.eye(len(parameters))
    found = _solved(clarabel, curvature, -white.T @ residual, _cones(place, links, nonnegative))
    base = factors @ found + offset
    left = whitening @ (base - estimate)
    return ConsistentEstimate(base, dict(zip(parameters, map(float, found), strict=True)), float(left @ left))


def _cones(
    place: Mapping[str, int], links: Sequence[Sequence[str]], nonnegative: Sequence[str]
) -> tuple[FloatArray, int, int]:
    """Return the matrix whose product with the parameters lies in the cones, and the number of each."""
    rows = np.zeros((len(nonnegative) + 10 * len(links), len(place)))
    for row, name in enumerate(nonnegative):
        rows[row, place[name]] = 1.0
    at = len(nonnegative)
    for names in links:
        own = dict(zip(LINK, names, strict=True))
        for entry in _PSEUDO_INERTIA:
            for quantity, factor in entry.items():
                rows[at, place[own[quantity]]] += factor
            at += 1
    return rows, len(nonnegative), len(links)


def _solved(
    clarabel: Any, curvature: FloatArray, slope: FloatArray, cones: tuple[FloatArray, int, int]
) -> FloatArray:
    """Return the minimum of x P x / 2 + q x with rows x in the cones; P and q are scaled."""
    from scipy.sparse import csc_matrix

    rows, halves, triangles = cones
    scale = 1.0 / max(float(np.max(np.diag(curvature))), np.finfo(float).tiny)
    kinds = ([clarabel.NonnegativeConeT(halves)] if halves else []) + [
        clarabel.PSDTriangleConeT(4) for _ in range(triangles)
    ]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    solver = clarabel.DefaultSolver(
        csc_matrix(np.triu(scale * curvature)),
        scale * slope,
        csc_matrix(-rows),
        np.zeros(len(rows)),
        kinds,
        settings,
    )
    solution = solver.solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        what = f"has no optimum that Clarabel finds ({solution.status})"
        raise DataError.at(
            "the physically consistent estimate", what, "look at the base parameters for outliers"
        )
    return np.array(solution.x)
