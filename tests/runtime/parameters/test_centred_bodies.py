"""Bodies inside the cones: nearer to the truth than those on their border, whatever their size and place."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.methods import WLS, run_wls
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.model.model import Model
from modelgen.runtime.parameters.centred_bodies import _slopes, _unlikeliness, centred_bodies
from modelgen.runtime.parameters.consistent_fit import bodies_of
from modelgen.runtime.parameters.consistent_links import LINK, PSEUDO_INERTIA, Bodies, nearest_bodies
from tests.runtime.parameters.test_consistent_fit import FILTERS, QUICK, made

pytest.importorskip("clarabel", reason="the extra arms is not installed")
BASIS = np.array([PSEUDO_INERTIA[quantity] for quantity in LINK])


def body(seed: int) -> FloatArray:
    """Return the ten parameters of a body of points, shape (10,)."""
    rng = np.random.default_rng(seed)
    points, masses = rng.normal(0.02, 0.1, (8, 3)), rng.uniform(0.1, 1.0, 8)
    tensor = np.einsum("k,kij->ij", masses, np.einsum("ka,ka,ij->kij", points, points, np.eye(3)))
    tensor = tensor - np.einsum("k,ki,kj->ij", masses, points, points)
    return np.array([*tensor[np.triu_indices(3)], *(masses @ points), masses.sum()])


def matrix(parameters: FloatArray) -> FloatArray:
    return np.asarray(np.tensordot(parameters, BASIS, 1))


def test_the_matrix_is_that_of_moments_and_mass() -> None:
    P, parameters = matrix(body(1)), body(1)
    np.testing.assert_allclose(np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3], inertia(parameters))
    np.testing.assert_allclose(P[:, 3], parameters[6:])


def inertia(parameters: FloatArray) -> FloatArray:
    tensor = np.zeros((3, 3))
    tensor[np.triu_indices(3)] = parameters[:6]
    return np.asarray(tensor + np.triu(tensor, 1).T)


def test_how_unlikely_a_body_is_depends_on_its_shape_alone() -> None:
    P = matrix(body(2))
    turned = np.eye(4)
    turned[:3, :3] = 3.0 * np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turned[:3, 3] = (0.3, -2.0, 0.7)
    assert _unlikeliness(7.0 * turned @ P @ turned.T) == pytest.approx(_unlikeliness(P), rel=1e-9)
    ball = np.diag([0.4, 0.4, 0.4, 3.0])
    assert abs(_unlikeliness(turned @ ball @ turned.T)) < 1e-9 < _unlikeliness(P)
    assert _unlikeliness(np.diag([1.0, 1.0, 0.0, 1.0])) == np.inf


def test_slopes_and_curvatures_are_those_of_differences() -> None:
    x, h = body(4), 1e-5
    slope, convex, concave = _slopes(matrix(x), BASIS)
    steps = h * np.abs(x).max() * np.eye(10)
    for step, own, bend in zip(steps, slope, (convex + concave).T, strict=True):
        above, below = (_unlikeliness(matrix(x + sign * step)) for sign in (1.0, -1.0))
        assert (above - below) / (2.0 * step.max()) == pytest.approx(own, rel=1e-4, abs=1e-4)
        up, down = (_slopes(matrix(x + sign * step), BASIS)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose(
            (up - down) / (2.0 * step.max()), bend, rtol=1e-3, atol=1e-3 * abs(bend).max()
        )
    assert np.linalg.eigvalsh(convex)[0] > 0.0 > np.linalg.eigvalsh(concave)[0]


@cache
def rows(known: bool = False) -> tuple[Model, Fit, FloatArray]:
    """Return a model, a fit whose rows tell some of its parameters badly, and the truth."""
    model, record, values = made(False, 0.5, 3, **({"m2": 1.0} if known else {}))
    fit = run_wls(prepared(model, record, WLS(), FILTERS, QUICK).job)[1]
    assert fit.columns == model.base_parameters
    return model, fit, model.base_from_physical(values)


@pytest.mark.parametrize("known", [False, True])
def test_errors_are_smaller_inside(known: bool) -> None:
    model, fit, truth = rows(known)
    links, bounded = bodies_of(model)
    bodies = Bodies(model.parameters, tuple(links.values()), bounded, model.known)
    c = len(truth)
    whitening = fit.triangle[:c, :c] * np.sqrt(fit.count) / fit.residual_norm
    deviation = np.linalg.norm(np.linalg.inv(whitening), axis=1)
    factors = model.base_jacobian({})
    offset = model.base_from_physical(dict.fromkeys(model.parameters, 0.0))
    rng, errors, inside = np.random.default_rng(4), [], []
    for _ in range(20):
        estimate = truth + np.linalg.solve(whitening, rng.standard_normal(c))
        given = (estimate - offset, whitening, factors, bodies)
        nearest = nearest_bodies(*given, offset)
        found = centred_bodies(*given, nearest.parameters)
        values = dict(zip(model.parameters, found.parameters.tolist(), strict=True)) | dict(model.known)
        assert all(values[name] > 0.0 for name in bounded)
        for names in links.values():
            assert np.linalg.eigvalsh(matrix(np.array([values[name] for name in names])))[0] > 0.0
        base = model.base_from_physical(values)
        errors.append([(one - truth) / deviation for one in (estimate, nearest.base, base)])
        likely = factors @ np.linalg.solve(found.curvature, factors.T)
        inside.append(np.abs(errors[-1][2]) < 1.96 * np.sqrt(np.diag(likely)) / deviation)
    without, at_bound, centred = np.sqrt(np.mean(np.square(errors), axis=(0, 2)))
    assert centred < 0.97 * at_bound < 0.97 * without
    assert np.mean(inside) > 0.8
