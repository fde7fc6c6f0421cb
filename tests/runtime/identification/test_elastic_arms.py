"""Arms with springs in their joints go the way of rigid ones: the truth without noise, honest with it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from modelgen import CheckOptions, Filters, identify
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.elastic_arms import exact_record, readings, two_link, values_of, with_sensors
from tests.symbolic.arms.test_elastic_rows import SETS, both

QUICK = CheckOptions(tests=False)
FS = 1000.0
NOISE = {"rad": 5e-6, "rad/s": 5e-5, "N m": 0.1}
CASES = {
    **SETS,
    # rows that are differentiated do not hold where a motor reverses
    "speeds of links": (with_sensors(two_link(), *both(), *both("link", "velocity")), "s", 6),
}
# a wide filter, for its reach around every reversal
FILTERS = {"speeds of links": Filters(cutoff_hz=60.0)}


@lru_cache(maxsize=16)
def made(case: str, seconds: float = 12.0) -> tuple[Model, Record, dict[str, float]]:
    """Return a model, a record without noise, and the base parameters that it was made with."""
    spec, sensor_set, _ = CASES[case]
    rng = np.random.default_rng(1)
    model = model_from_text(arm_module(arm_base_model(arm_rows(spec, sensor_set=sensor_set))), "elastic")
    values = values_of(spec, rng)
    motion, forces = exact_record(spec, values, np.arange(0.0, seconds, 1.0 / FS), rng)
    signals = readings(spec, motion, forces, sensor_set)
    base = model.base_from_physical({name: values[name] for name in model.parameters})
    truth = dict(zip(model.base_parameters, base.tolist(), strict=True))
    return model, Record({key: signals[key] for key in model.channels}, FS, "arm"), truth


def noisy(model: Model, record: Record, seed: int) -> Record:
    rng = np.random.default_rng(seed)
    units = {one.key: one.unit for one in (*model.sensors, *model.actuators)}
    return record.edited(
        {key: record.signals[key] + NOISE[units[key]] * rng.standard_normal(record.n) for key in record.keys}
    )


@pytest.mark.parametrize(
    "case", [pytest.param(c, marks=pytest.mark.slow) if c == "six joints" else c for c in CASES]
)
def test_linear_sensor_sets_without_noise_give_the_truth(case: str) -> None:
    model, record, truth = made(case)
    found = identify(model, record, "wls", FILTERS.get(case), QUICK).params
    assert list(found) == list(truth)
    worst = max(abs(found[name] / value - 1.0) for name, value in truth.items())
    assert worst < 1e-3


def test_chunks_memory_and_stretches_change_nothing() -> None:
    model, record, _ = made("gears and a coupling")
    record = noisy(model, record, 3)
    assert model.derived  # encoders in front of gears
    whole = identify(model, record, "wls", checks=QUICK)
    remade = identify(model, record, "wls", Filters(memory_limit_mb=0.02), QUICK)
    read = identify(model, Record.over(record), "wls", checks=QUICK)
    for name, value in whole.params.items():
        for other in (remade, read):
            assert abs(other.params[name] - value) < 1e-6 * whole.bse[name]


@pytest.mark.slow
@pytest.mark.parametrize("case", ["two encoders", "torques"])
def test_intervals_with_noise_are_honest(case: str) -> None:
    model, record, truth = made(case)
    estimates = [identify(model, noisy(model, record, seed), "wls", checks=QUICK) for seed in range(30)]
    errors = np.array([[e.params[n] - v for n, v in truth.items()] for e in estimates])
    stated = np.array([[e.bse[n] for n in truth] for e in estimates])
    inside = np.mean(np.abs(errors) < 1.96 * stated)
    ratio = np.sqrt(np.mean(stated**2, axis=0)) / np.std(errors, axis=0)
    bias = np.abs(errors.mean(axis=0)) / np.std(errors, axis=0)
    assert 0.88 < inside <= 1.0
    assert 0.75 < np.median(ratio) < 1.4
    # K multiplies the deflection, which is small, but large against its noise
    springs = [k for k, name in enumerate(truth) if name.startswith("K")]
    assert max(np.std(errors, axis=0)[k] / truth[f"K{n}"] for n, k in enumerate(springs, start=1)) < 1e-4
    assert np.all(bias < 4.0 / np.sqrt(len(errors)))


def test_a_spring_that_is_known_leaves_the_rest() -> None:
    spec, sensor_set, _ = CASES["two encoders"]
    _, record, truth = made("two encoders")
    held = replace(spec, known={"K1": truth["K1"]})
    held_model = model_from_text(arm_module(arm_base_model(arm_rows(held, sensor_set=sensor_set))), "held")
    found = identify(held_model, record, "wls", checks=QUICK).params
    assert "K1" not in found
    assert all(found[name] == pytest.approx(truth[name], rel=1e-3) for name in found)
