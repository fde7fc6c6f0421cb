"""Generated modules, executed: regressor, columns and state space against each other along exact motions."""

from __future__ import annotations

import importlib
from types import ModuleType

import numpy as np
import pytest

from modelgen.spec.load import catalog_names, catalog_path, load_spec

MODULES = [(n, f"{n}_{s}") for n in catalog_names() for s in load_spec(catalog_path(n)).sensor_sets]


def load(name: str) -> ModuleType:
    return importlib.import_module(f"generated.{name}")


def parameters(module: ModuleType, seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    return {name: float(rng.uniform(0.5, 2.0)) for name in module.PARAMETERS}


@pytest.mark.parametrize(("chain", "name"), MODULES)
def test_shapes_types_and_names(chain: str, name: str) -> None:
    module = load(name)
    signals = random_signals(module, 7, 0)
    regressor, measurement = module.regressor(signals), module.measurement(signals)
    assert regressor.shape == (7, len(module.ROWS), len(module.BASE_PARAMETERS))
    assert measurement.shape == (7, len(module.ROWS))
    assert regressor.dtype == measurement.dtype == np.float64
    assert chain == module.CHAIN
    assert set(module.IDENTIFIABLE) <= set(module.PARAMETERS)


@pytest.mark.parametrize(("chain", "name"), MODULES)
def test_columns_say_what_regressor_and_measurement_compute(chain: str, name: str) -> None:
    module = load(name)
    signals = random_signals(module, 5, 1)
    values = {**signals, **module.features(signals), "1": np.ones(5)}
    columns = module.columns()
    regressor, measurement = (
        np.zeros_like(module.regressor(signals)),
        np.zeros_like(module.measurement(signals)),
    )
    for row, parts in enumerate(columns["measurement"]):
        for coefficient, key in parts:
            measurement[:, row] += coefficient * values[key]
    for row, table in enumerate(columns["regressor"]):
        for column, parts in table.items():
            for coefficient, key in parts:
                regressor[:, row, column] += coefficient * values[key]
    np.testing.assert_allclose(regressor, module.regressor(signals), rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(measurement, module.measurement(signals), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize(("chain", "name"), MODULES)
def test_rows_hold_along_exact_motions_of_the_state_space(chain: str, name: str) -> None:
    """y = D base for exact derivatives of a motion that solves the state space."""
    module = load(name)
    truth = parameters(module, 3)
    signals = smooth_motion(module, truth)
    left = module.measurement(signals)
    right = module.regressor(signals) @ module.base_from_physical(truth)
    scale = np.abs(module.regressor(signals) * module.base_from_physical(truth)).max(axis=(0, 2))
    assert np.all(np.abs(left - right).max(axis=0) <= 1e-9 * scale)


@pytest.mark.parametrize(("chain", "name"), MODULES)
def test_physical_parameters_come_back_from_the_base(chain: str, name: str) -> None:
    module = load(name)
    truth = parameters(module, 5)
    found = module.physical_from_base(module.base_from_physical(truth))
    assert found == pytest.approx({key: truth[key] for key in module.IDENTIFIABLE}, rel=1e-12)


def test_state_space_is_17_to_19_of_the_paper_corrected() -> None:
    module = load("emps300_qm_ac")
    p = parameters(module, 1)
    space = module.state_space(p)
    jm, jc, k, fv, fd = p["J_m"], p["J_c"], p["K"], p["F_vm"], p["F_vmc"]
    expected = [
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        [-k / jm, k / jm, -(fv + fd) / jm, fd / jm],
        [k / jc, -k / jc, fd / jc, -fd / jc],
    ]
    np.testing.assert_allclose(space.A, expected, rtol=1e-15)
    np.testing.assert_array_equal(space.B[:, 0], [0, 0, 1 / jm, 0])
    np.testing.assert_array_equal(space.E[:, 0], [0, 0, -1 / jm, 0])
    np.testing.assert_array_equal(space.C, [[1, 0, 0, 0], space.A[3]])


def random_signals(module: ModuleType, samples: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {signal["key"]: rng.standard_normal(samples) for signal in module.SIGNALS}


def smooth_motion(module: ModuleType, truth: dict[str, float]) -> dict[str, np.ndarray]:
    """Return every signal and derivative along a motion q = q0 + Q e^(rate t) with positive velocities.

    Q is what forces that grow at the same rate cause; q0 and a constant force hold friction and offsets.
    """
    space = module.state_space(truth)
    states, actuators = space.B.shape
    bodies, rate, time = states // 2, 0.7, np.linspace(0.0, 1.0, 9)
    growth = np.exp(rate * time)
    friction = np.array(
        [truth.get(f["coulomb_plus"] or "", 0.0) + truth.get(f["offset"] or "", 0.0) for f in module.FRICTION]
    )
    # growing part: (rate^2 - A21 - rate A22) Q = B force; resting part: 0 = A21 q0 + B force0 + E friction
    shape = rate**2 * np.eye(bodies) - space.A[bodies:, :bodies] - rate * space.A[bodies:, bodies:]
    force = np.arange(1.0, actuators + 1)
    moving = np.linalg.solve(shape, space.B[bodies:] @ force)
    steady = np.hstack([space.A[bodies:, :bodies], space.B[bodies:]])
    rest = np.linalg.lstsq(steady, -space.E[bodies:] @ friction, rcond=None)[0]
    assert np.allclose(steady @ rest, -space.E[bodies:] @ friction)
    assert np.all(moving > 0)

    def coordinate(order: int) -> np.ndarray:
        value = rate**order * growth[:, None] * moving
        return value + rest[:bodies] if order == 0 else value

    inertias = [role["bodies"][0] for role in module.ROLES.values() if role["role"] == "inertia"]
    place = {body: index for index, body in enumerate(inertias)}
    signals = {}
    order_of = {"position": 0, "velocity": 1, "acceleration": 2}
    for signal in module.SIGNALS:
        if signal["sensor"] is not None:
            row = next(i for i, s in enumerate(module.SENSORS) if s["key"] == signal["sensor"])
            sensor = module.SENSORS[row]
            order = order_of[sensor["measures"]] + signal["derivative"]
            if sensor["body"] is not None:
                signals[signal["key"]] = coordinate(order)[:, place[sensor["body"]]]
            else:
                signals[signal["key"]] = coordinate(order) @ space.C[row, :bodies]
        elif signal["actuator"] is not None:
            column = next(i for i, a in enumerate(module.ACTUATORS) if a["key"] == signal["actuator"])
            value = rate ** signal["derivative"] * growth * force[column]
            signals[signal["key"]] = value + (rest[bodies + column] if signal["derivative"] == 0 else 0.0)
        else:
            signals[signal["key"]] = np.ones_like(time)
    return signals
