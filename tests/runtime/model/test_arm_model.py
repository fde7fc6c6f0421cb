"""The module of an arm as a model of the road: sums, lines of the kernel, the contract."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.model.model import Model, model_from_module
from tests.runtime.made_arm_records import catalogued, model_of, written

NAMES = ("two_link", "scara", "puma560", "tx40")
ASYMMETRIC = """
[arm]
name = "slide"
gravity = [0, 0, -9.81]

[[joints]]
name = "z"
type = "prismatic"
friction = "asymmetric"

[[joints]]
name = "turn"
alpha = 90
friction = "asymmetric"

[known]
m_turn = 2.0
mx_turn = 0.1
Fs_turn_plus = 0.3
"""


def rebuilt(model: Model, signals: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return regressor and left side from terms, features and lines of the kernel alone."""
    count = len(next(iter(signals.values())))
    known = {"1": np.ones(count), **signals}
    for name, terms in model.derived.items():
        for order in ("", "d1_", "d2_"):
            known[order + name] = sum(weight * signals.get(order + key, 0.0) for weight, key in terms)
    for feature in model.features:
        if feature.function != "kernel":
            of = known[str(feature.of)]
            value = {"sign": np.sign(of), "forward": of > 0, "backward": of < 0}[feature.function]
            known[feature.key] = value * (1.0 if feature.times is None else known[feature.times])
    if model.kernel is not None:
        known |= model.kernel.lines(signals)
    D = np.zeros((count, len(model.rows), len(model.base_parameters)))
    y = np.zeros((count, len(model.rows)))
    for row, left in enumerate(model.measurement_columns):
        y[:, row] = sum((weight * known[key] for weight, key in left), np.zeros(count))
        for column, terms in model.regressor_columns[row].items():
            D[:, row, column] = sum((weight * known[key] for weight, key in terms), np.zeros(count))
    return D, y


def arms() -> list[Any]:
    plain = [pytest.param(lambda name=name: model_of(catalogued(name)), id=name) for name in NAMES]
    motors = pytest.param(lambda: model_of(catalogued("tx40"), "motor"), id="motors")
    base = pytest.param(lambda: model_of(catalogued("two_link"), base_rows=True), id="base")
    return [*plain, motors, base, pytest.param(lambda: model_of(written(ASYMMETRIC)), id="asymmetric")]


@pytest.mark.slow
@pytest.mark.parametrize("make", arms())
def test_terms_and_lines_are_the_regressor_of_the_module(make: Any) -> None:
    model, rng = make(), np.random.default_rng(5)
    keys = [s.key for s in model.signals if s.sensor not in model.derived]
    signals = {key: rng.uniform(-1.0, 1.0, 40) for key in keys}
    D, y = rebuilt(model, signals)
    np.testing.assert_allclose(D, model.regressor(signals), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(y, model.measurement(signals), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("make", arms())
def test_friction_and_rotors_are_no_lines_of_the_kernel(make: Any) -> None:
    model = make()
    drives = {name for name, role in model.roles.items() if role.role != "link"}
    for terms in model.regressor_columns:
        for column, entry in terms.items():
            if model.base_parameters[column] in drives:
                assert not any(key.startswith("entry") for _, key in entry)


def test_sums_go_by_short_names() -> None:
    model = model_of(catalogued("tx40"))
    assert model.groupings["Izz_4_R"] == "Izz_4 + Iyy_5"
    assert all(len(name) <= 20 for name in model.base_parameters)
    values = dict(zip(model.parameters, np.random.default_rng(1).uniform(1, 2, 100).tolist(), strict=False))
    base = model.base_from_physical(values)
    np.testing.assert_allclose(model.base_jacobian(values) @ [values[n] for n in model.parameters], base)
    physical = model.physical_from_base(base)
    assert list(physical) == list(model.identifiable)
    assert all(value == pytest.approx(values[name]) for name, value in physical.items())


MISTAKES = {
    "ENTRIES": ((0, 999),),
    "JOINTS": (),
    "TRANSMISSION": ((1.0,),),
    "SIGNALS": ("q_9",),
    "ROLES": {},
    "UNITS": None,
    "BASE_PARAMETERS": ("nothing",),
    "entries": None,
    "regressor": lambda signals: np.zeros((3, 2, 13)),
    "measurement": lambda signals: 1.0,
}


@pytest.mark.parametrize("name", MISTAKES)
def test_what_breaks_the_contract_is_told(name: str) -> None:
    module = model_of(catalogued("two_link")).module
    names = [one for one in vars(module._module) if not one.startswith("__")]
    broken = SimpleNamespace(**{one: getattr(module, one) for one in names})
    setattr(broken, name, MISTAKES[name])
    with pytest.raises(DataError, match=name):
        model_from_module(broken)
