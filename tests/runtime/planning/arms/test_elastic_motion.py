"""Motion of elastic arms from that of their links: rows hold exactly, predictions hold in experiments."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from benchmarks.elastic_motion import (
    ElasticMotion,
    elastic_motion,
    record_along,
)
from modelgen import CheckOptions, identify
from modelgen.errors import DataError
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.planning.arms.predicted_sets import USUAL_NOISE
from modelgen.spec.arms.arm import ArmSpec
from tests.runtime.made_arm_records import catalogued
from tests.symbolic.arms.elastic_arms import SPATIAL, elastic, geared, values_of, with_sensors
from tests.symbolic.arms.made_arms import serial
from tests.symbolic.arms.test_elastic_rows import both

QUIET = dict.fromkeys(USUAL_NOISE, 0.0)
QUICK = CheckOptions(tests=False)
FS = 1000.0


def model_of(spec: ArmSpec, sensor_set: str) -> Model:
    ((name, text),) = arm_files(spec, sensor_set).items()
    return model_from_text(text, name)


def moved(spec: ArmSpec, values: dict[str, float], hz: float, seconds: float = 12.0) -> ElasticMotion:
    times, rng = np.arange(0.0, seconds, 1.0 / FS), np.random.default_rng(3)
    links = {
        j.name: sum(0.4 / k * np.sin(2 * np.pi * hz * k / 3.0 * times + rng.uniform(0, 6)) for k in (1, 2, 3))
        for j in spec.moving
    }
    return elastic_motion(model_of(spec, "encoders"), values, links, FS)


def base_of(model: Model, values: dict[str, float]) -> dict[str, float]:
    base = model.base_from_physical({name: values[name] for name in model.parameters})
    return dict(zip(model.base_parameters, base.tolist(), strict=True))


@lru_cache(maxsize=1)
def damped() -> tuple[ArmSpec, dict[str, float]]:
    """Two links with damped springs, their sensors on both sides or at the motors alone."""
    spec = catalogued("elastic_two_link")
    motors = with_sensors(spec, *both()).sensor_sets["s"]
    spec = replace(spec, sensor_sets={"encoders": spec.sensor_sets["encoders"], "motors": motors})
    return spec, dict(spec.parameter_sets["nominal"])


def test_gears_couplings_and_rigid_joints_are_found_along_it() -> None:
    spec = geared(elastic(serial(SPATIAL, True), ("2", "3"), damping=True))
    values = values_of(spec, np.random.default_rng(1))
    model = model_of(spec, "encoders")
    found = identify(model, record_along(model, moved(spec, values, 1.5), QUIET), "wls", checks=QUICK).params
    truth = base_of(model, values)
    assert list(found) == list(truth)
    assert max(abs(found[name] / value - 1.0) for name, value in truth.items()) < 1e-3


@pytest.mark.slow
def test_motors_alone_find_damped_springs() -> None:
    spec, values = damped()
    model = model_of(spec, "motors")
    record = record_along(model, moved(spec, values, 3.0), QUIET)
    found, truth = identify(model, record, "wls", checks=QUICK).params, base_of(model, values)
    # an offset of zero has no size of its own: that of the friction beside it
    off = {n: abs(found[n] - v) / (abs(v) or values[f"Fs_{n[-1]}"]) for n, v in truth.items() if n in found}
    damping = [off.pop(name) for name in ("D_1", "D_2")]
    assert {"K_1", "K_2"} <= {*off} and max(off.values()) < 1e-3
    assert max(damping) < 5e-3  # a deflection that is late by D / K, to second order


@pytest.mark.slow
def test_links_alone_find_damped_springs_near_the_modes_without_any_values() -> None:
    spec, values = damped()
    motion = moved(spec, values, 6.0, 8.0)
    links = replace(with_sensors(spec, *both("link")), parameter_sets={})
    model = model_of(links, "s")
    found = identify(model, record_along(model, motion), "wls", checks=QUICK)
    for name in ("K_1", "K_2", "D_1", "D_2", "Ia_1"):
        assert abs(found.params[name] - values[name]) < 3.5 * found.bse[name]
        assert found.bse[name] < 0.05 * values[name]


def test_mistakes_are_told() -> None:
    spec, values = damped()
    model, still = model_of(spec, "encoders"), np.zeros(500)
    with pytest.raises(DataError, match="lack a motion of 2"):
        elastic_motion(model, values, {"1": still}, FS)
    with pytest.raises(DataError, match="both sides of every spring"):
        elastic_motion(model_of(spec, "motors"), values, {"1": still, "2": still}, FS)
