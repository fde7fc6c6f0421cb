"""The nearest estimate that bodies can have: kept where it is one, nearer to the truth where it is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.parameters.consistent_links import ConsistentEstimate, consistent_links
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.elastic_arms import spatial

pytest.importorskip("clarabel", reason="the extra arms is not installed")
SPEC = spatial()
LINKS = [joint.link for joint in SPEC.joints]


def made(seed: int = 1) -> tuple[dict[str, Any], dict[str, float], FloatArray]:
    """Return a module, parameters of bodies that are made of points, and a covariance of base parameters."""
    module: dict[str, Any] = {}
    exec(arm_module(arm_base_model(arm_rows(SPEC, sensor_set="encoders"))), module)
    rng = np.random.default_rng(seed)
    values = {name: float(rng.uniform(0.1, 2.0)) for name in module["PARAMETERS"]}
    for names in LINKS:
        points, masses = rng.normal(0.0, 0.2, (6, 3)), rng.uniform(0.2, 2.0, 6)
        inertia = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, points, strict=True))
        tensor = inertia[np.triu_indices(3)]
        numbers = [*tensor, *(masses @ points), masses.sum()]
        values |= dict(zip(names, map(float, numbers), strict=True))
    signals = {key: rng.standard_normal(300) for key in module["SIGNALS"]}
    regressor = module["regressor"](signals)
    regressor = regressor.reshape(-1, regressor.shape[2])
    return module, values, np.linalg.inv(regressor.T @ regressor)


def consistent(module: dict[str, Any], estimate: FloatArray, covariance: FloatArray) -> ConsistentEstimate:
    drive = [name for name in module["PARAMETERS"] if not any(name in names for names in LINKS)]
    positive = [name for name in drive if not name.startswith("off")]
    parameters = module["PARAMETERS"]
    return consistent_links(estimate, covariance, module["base_from_physical"], parameters, LINKS, positive)


def smallest_eigenvalue(values: dict[str, float], names: tuple[str, ...]) -> float:
    xx, xy, xz, yy, yz, zz, *moment, mass = (values[name] for name in names)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    whole = np.zeros((4, 4))
    whole[:3, :3] = 0.5 * np.trace(tensor) * np.eye(3) - tensor
    whole[:3, 3] = whole[3, :3] = moment
    whole[3, 3] = mass
    return float(np.linalg.eigvalsh(whole)[0])


def test_what_bodies_can_have_is_kept() -> None:
    module, values, covariance = made()
    truth = module["base_from_physical"](values)
    found = consistent(module, truth, covariance)
    assert found.cost < 1e-3
    assert np.abs(found.base - truth).max() < 1e-2 * np.sqrt(np.diag(covariance)).max()
    np.testing.assert_allclose(
        module["base_from_physical"](found.parameters), found.base, rtol=1e-9, atol=1e-9
    )


def test_what_no_body_has_is_moved_onto_one_and_nearer_to_the_truth() -> None:
    module, values, covariance = made()
    truth, rng, before, after = module["base_from_physical"](values), np.random.default_rng(2), [], []
    covariance = 25.0 * covariance
    deviations = np.sqrt(np.diag(covariance))
    for _ in range(20):
        estimate = rng.multivariate_normal(truth, covariance)
        found = consistent(module, estimate, covariance)
        for names in LINKS:
            assert smallest_eigenvalue(dict(found.parameters), names) > -1e-6
        before.append(np.mean(((estimate - truth) / deviations) ** 2))
        after.append(np.mean(((found.base - truth) / deviations) ** 2))
        # the truth is consistent: the nearest estimate is no farther away by the covariance
        whitened = np.linalg.solve(np.linalg.cholesky(covariance), truth - estimate)
        assert found.cost <= whitened @ whitened + 1e-3
    assert np.mean(after) < 0.9 * np.mean(before)


def test_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    module, values, covariance = made()
    truth = module["base_from_physical"](values)
    with pytest.raises(DataError, match="is not positive definite"):
        consistent(module, truth, 0.0 * covariance)
    monkeypatch.setitem(__import__("sys").modules, "clarabel", None)
    with pytest.raises(DataError, match=r"modelgen\[arms\]"):
        consistent(module, truth, covariance)
