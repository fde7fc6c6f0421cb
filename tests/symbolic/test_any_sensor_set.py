"""Any sensor set on any graph: rows hold, columns are independent, and what is called identifiable is."""

from __future__ import annotations

import random
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.errors import ModelError
from modelgen.render.view import model_view
from modelgen.render.writer import render
from modelgen.spec.load import parse_spec
from modelgen.symbolic.pipeline import build
from tests.symbolic.exact_rank import rank_along_motions
from tests.symbolic.random_chains import ExactMotion, random_spec


@pytest.mark.slow
@settings(max_examples=100)
@given(st.integers(0, 10**9))
def test_rows_hold_on_random_graphs(seed: int) -> None:
    text = random_spec(random.Random(seed))
    spec = parse_spec(text, "chain.toml")
    try:
        model = build(spec, "set")
    except ModelError as error:  # the only refusal that is allowed here
        assert "at most 4 can be eliminated" in str(error) or "no parameter is left" in str(error), text
        return
    module = ModuleType("chain_set")
    exec(compile(render(model_view(model)), "chain_set.py", "exec"), module.__dict__)
    rng = np.random.default_rng(seed)
    truth = {name: float(rng.uniform(0.5, 2.0)) for name in module.PARAMETERS}
    signals = ExactMotion(module, truth, seed).signals(module)
    base = module.base_from_physical(truth)
    terms = module.regressor(signals) * base
    error = np.abs(module.measurement(signals) - terms.sum(axis=2)).max(axis=0)
    largest = np.maximum(np.abs(terms).max(axis=(0, 2)), np.abs(module.measurement(signals)).max(axis=0))
    assert np.all(error <= 1e-9 * largest), text
    assert rank_along_motions(model, seed) == len(model.base), text
    check_identifiable(module, truth, text)
    check_not_identifiable(module, truth, text)


def check_identifiable(module: ModuleType, truth: dict[str, float], text: str) -> None:
    """The identifiable parameters are locally determined: from nearby, they come back to 1e-6."""
    target = module.base_from_physical(truth)
    rng = np.random.default_rng(1)
    point = {name: value * float(rng.uniform(0.995, 1.005)) for name, value in truth.items()}
    for _ in range(60):
        slope = module.base_jacobian(point) / np.abs(target)[:, None]
        step = np.linalg.lstsq(
            slope, (target - module.base_from_physical(point)) / np.abs(target), rcond=1e-9
        )[0]
        point = {name: point[name] + float(s) for name, s in zip(module.PARAMETERS, step, strict=True)}
        if np.abs(step).max() < 1e-10:  # the next one is its square
            break
    assert np.abs(module.base_from_physical(point) / target - 1).max() < 1e-9, text
    for name in module.IDENTIFIABLE:
        assert point[name] == pytest.approx(truth[name], rel=1e-6), (name, text)


def check_not_identifiable(module: ModuleType, truth: dict[str, float], text: str) -> None:
    """For every other parameter there is a second parameter vector with another value and the same base."""
    names = list(module.PARAMETERS)
    for name in names:
        if name not in module.IDENTIFIABLE:
            second = walk(module, truth, name, text)
            assert abs(second[name] / truth[name] - 1) > 1e-4, (name, text)
            np.testing.assert_allclose(
                module.base_from_physical(second), module.base_from_physical(truth), rtol=1e-9, err_msg=text
            )


def walk(module: ModuleType, truth: dict[str, float], name: str, text: str) -> dict[str, float]:
    """Walk along the set of equal base parameters, in small steps, until a parameter has changed by 0.1 %."""
    names = list(module.PARAMETERS)
    column = names.index(name)
    target = module.base_from_physical(truth)
    point = np.array([truth[n] for n in names])

    def slope_at(point: np.ndarray) -> np.ndarray:
        return module.base_jacobian(dict(zip(names, point.tolist(), strict=True))) / np.abs(target)[:, None]

    def back(point: np.ndarray, times: int) -> np.ndarray:
        for _ in range(times):
            base = module.base_from_physical(dict(zip(names, point.tolist(), strict=True)))
            missed = (target - base) / np.abs(target)
            if np.abs(missed).max() < 1e-13:
                break
            point = point + np.linalg.lstsq(slope_at(point), missed, rcond=1e-9)[0]
        return point

    start = point
    for sign in (1.0, -1.0):  # the parameter may be at its largest, or smallest, already
        point = start
        for _ in range(400):
            slope = slope_at(point)
            basis = np.linalg.svd(slope)[2][np.linalg.matrix_rank(slope, tol=1e-9) :]
            tangent = basis.T @ basis[:, column]  # the parameter's unit vector within the tangent space
            if np.linalg.norm(tangent) < 1e-7:
                break
            point = back(point + sign * 0.005 / np.abs(tangent).max() * tangent, 3)
            if abs(point[column] / truth[name] - 1) > 1e-3:
                return dict(zip(names, back(point, 20).tolist(), strict=True))
    raise AssertionError((name, text))


@pytest.mark.slow
@settings(max_examples=150)
@given(st.integers(0, 10**9))
def test_cubic_springs_are_read_or_refused_in_words(seed: int) -> None:
    rng = random.Random(seed)
    lines = []
    for line in random_spec(rng, most_bodies=4).splitlines():
        lines.append(line)
        if line.startswith("stiffness"):
            lines += [f'stiffness3 = "C{len(lines)}"'] if rng.random() < 0.4 else []
    try:
        model = build(parse_spec("\n".join(lines), "chain.toml"), "set")
    except ModelError as error:
        assert error.problems[0].where == "chain.toml: sensors.set"
        return
    # what is cubed is read as it is, in rows that are not differentiated
    cubes = {feature.key for feature in model.rows.features if feature.function == "cube"}
    for row in model.rows.rows:
        assert not row.differentiated or not cubes & {term.key for term in row.terms}
