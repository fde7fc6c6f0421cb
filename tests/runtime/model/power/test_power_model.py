"""Rows of power: the same parameters as rows of forces give, without accelerations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from generated import emps300_qm_qc, emps_rigid_asymmetric_qm, three_mass_va_vb_vc, tree_positions
from modelgen import CheckOptions, identify
from modelgen.errors import DataError
from modelgen.runtime.identification.methods import IV, WLS, Auto
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.model.power.power_model import power_model
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.made_arm_records import catalogued, model_of, motion, record_of, values_of, written

QUICK = CheckOptions(tests=False)
COUPLED = """
[arm]
name = "wrist"
friction = "asymmetric"
[[joints]]
name = "1"
[[joints]]
name = "2"
alpha = 90
d = 0.3
[[joints]]
name = "3"
type = "prismatic"
alpha = -90
[[couplings]]
motor = "3"
joint = "2"
ratio = 0.5
[payload.disc]
[known]
m_2 = 3.0
mx_2 = 0.4
Fv_1_plus = 0.7
Fs_1_minus = 0.3
"""
SENSED = """
[arm]
name = "sensed"
gravity = [0, -9.81, 0]
[[joints]]
name = "1"
gear = 50
[[joints]]
name = "2"
d = 0.4
gear = 30
[sensors.both]
q_1 = { joint = "1", side = "motor", measures = "position" }
w_1 = { joint = "1", side = "link", measures = "velocity" }
q_2 = { joint = "2", side = "link", measures = "position" }
"""


def balance(model: Model, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return the power of the rows of forces along a motion, and that which the lines of power give.

    Energies are differentiated in time by a difference of eighth order. Shapes (n,); the ends left out.
    """
    fs, values = 1000.0, values_of(model, seed)
    signals = motion(model, 4.0, seed, fs)
    rng, n = np.random.default_rng(seed), 4000
    signals |= {one.key: rng.standard_normal(4)[0] + np.zeros(n) for one in model.actuators}
    signals |= dict.fromkeys(model.loads, np.ones(n))
    x = model.base_from_physical(values)
    power = power_model(model)
    assert power.kernel is not None
    lines = power.kernel.lines({key: signals[key] for key in power.kernel.inputs})

    def made(terms: tuple[tuple[float, str], ...]) -> np.ndarray:
        total = np.zeros(n)
        for weight, key in terms:
            rate = np.gradient(lines[key], 1.0 / fs, edge_order=2)
            total += weight * (rate if power.kernel.orders[key] else lines[key])
        return total

    y = made(power.measurement_columns[0])
    columns = power.regressor_columns[0]
    left = y - sum((x[column] * made(terms) for column, terms in columns.items()), np.zeros(n))
    force = model.measurement(signals) - model.regressor(signals) @ x
    speeds = np.array([signals[f"d1_q_{row.name}"] for row in model.rows]).T
    return (force * speeds).sum(axis=1)[5:-5], left[5:-5]


@pytest.mark.parametrize("name", ["two_link", "scara", "puma560", "coupled"])
def test_power_is_force_times_speed(name: str) -> None:
    model = model_of(written(COUPLED) if name == "coupled" else catalogued(name))
    forces, power = balance(model)
    # the second-order difference errs by that much
    assert np.abs(forces - power).max() < 2e-4 * np.abs(forces).max()


def test_an_arm_without_noise() -> None:
    model = model_of(catalogued("two_link"))
    values = values_of(model)
    estimate = identify(model, record_of(model, values), Auto(rows="power"), checks=QUICK)
    assert_close(estimate.params, model, values, 1e-4)
    assert [row.row for row in estimate.fit.rows] == ["power"]
    assert estimate.fit.rows[0].masked == 0


def assert_close(found: Mapping[str, float], model: Model, values: Mapping[str, float], most: float) -> None:
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    assert list(found) == list(exact)
    assert all(abs(value - exact[name]) < most * abs(exact[name]) for name, value in found.items())


def test_speeds_that_are_measured_take_the_place_of_derivatives() -> None:
    plain = model_of(written(SENSED.partition("[sensors")[0]))
    sensed = model_of(written(SENSED), sensor_set="both")
    values = values_of(plain)
    record = record_of(plain, values)
    read = dict(record.signals)
    read["q_1"] = 50.0 * read["q_1"]
    read["w_1"] = motion(plain, 20.0, 1)["d1_q_1"]
    for rows, most in (("force", 1e-5), ("power", 1e-4)):
        estimate = identify(sensed, type(record)(read, record.fs), WLS(rows=rows), checks=QUICK)
        assert_close(estimate.params, sensed, values, most)


@pytest.mark.parametrize(
    ("module", "chosen"),
    [
        pytest.param(emps300_qm_qc, "table_2", marks=pytest.mark.slow),
        (emps_rigid_asymmetric_qm, "published_2019"),
        (tree_positions, None),
    ],
)
def test_a_chain_without_noise(module: object, chosen: str | None) -> None:
    model = model_from_module(module)
    values = model.parameter_sets[chosen or next(iter(model.parameter_sets))]
    records = [simulate(model, values, kind, duration_s=1.0).record for kind in ("chirp", "trapezoid")]
    estimate = identify(model, records, WLS(rows="power"), checks=QUICK)
    exact = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    off = {name: abs(value / exact[name] - 1.0) for name, value in estimate.params.items()}
    assert len(off) > 0.7 * len(exact) and max(off.values()) < 0.01


def test_what_has_no_balance_of_power_is_refused() -> None:
    with pytest.raises(DataError, match="balance of one body"):
        power_model(model_from_module(three_mass_va_vb_vc))
    with pytest.raises(DataError, match="take rigid ones"):
        power_model(model_of(catalogued("elastic_two_link"), sensor_set="encoders"))
    gained = written(SENSED.partition("[sensors")[0].replace("gear = 50", "gain = true"))
    with pytest.raises(DataError, match="gains are to be found"):
        power_model(model_of(gained))
    model = model_from_module(emps300_qm_qc)
    record = simulate(model, model.parameter_sets["table_2"], "chirp", duration_s=0.5).record
    for method, message in ((IV(rows="power"), "rows"), (WLS(rows="both"), "choose one of force, power")):
        with pytest.raises(DataError, match=message):
            identify(model, record, method)
