"""What noise of the sensors does to least squares of elastic arms is taken off by default."""

from __future__ import annotations

import numpy as np

from modelgen import Record, identify
from modelgen.runtime.identification.methods import WLS, Auto
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.solution import Solution, fitted
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.model.model import Model
from tests.runtime.identification.elastic.test_channels_set_right import FS, made
from tests.runtime.identification.elastic.test_link_forces import model_of
from tests.symbolic.arms.elastic_arms import exact_record, readings, two_link, values_of, with_sensors
from tests.symbolic.arms.test_elastic_rows import both

QUICK = CheckOptions(drift_check=False)


def solution_of(model: Model, record: Record, method: Auto | WLS, cutoff_hz: float) -> Solution:
    return fitted(prepared(model, [record], method, Filters(cutoff_hz=cutoff_hz), QUICK))[1]


def test_bias_of_linear_rows_is_taken_off_by_default_and_stays_in_least_squares() -> None:
    model, channels, _ = made()
    record = Record(channels, FS, "arm")
    default, asked = (solution_of(model, record, one, 60.0) for one in (Auto(), WLS()))
    assert asked.bias is None
    assert default.bias is not None
    np.testing.assert_allclose(default.fit.solution.x + default.bias, asked.fit.solution.x, rtol=1e-9)


def test_a_row_whose_columns_are_a_quarter_noise_is_freed_of_what_that_does() -> None:
    spec = with_sensors(two_link(), *both("link"), *both("between", "torque"))
    values, model = values_of(spec, np.random.default_rng(3)), model_of(spec)
    motion, forces = exact_record(
        spec, values, np.arange(0.0, 8.0, 1.0 / FS), np.random.default_rng(3), tempo=2.0
    )
    signals, rng = readings(spec, motion, forces, "s"), np.random.default_rng(4)
    sizes = {"link": 5e-6, "between": 0.6, "tau": 0.05}
    noise = {
        key: sizes[key.split("_")[0]] * rng.standard_normal(motion["1", 0].size) for key in model.channels
    }
    record = Record({key: signals[key] + noise[key] for key in model.channels}, FS, "arm")
    found = identify(model, record, filters=Filters(cutoff_hz=60.0), checks=QUICK)
    truth = model.base_from_physical({name: values[name] for name in model.parameters})
    # least squares make rotors 1.3 and 10 % too light, 6 and 9 deviations, and springs 1 and 23 % too stiff
    error = {name: found.params[name] / value - 1.0 for name, value in zip(found.params, truth, strict=True)}
    assert abs(error["Ia1"]) < 0.004 and abs(error["Ia2"]) < 0.03 and abs(error["K1"]) < 0.003
    z = [error[name] * value / found.bse[name] for name, value in zip(found.params, truth, strict=True)]
    assert np.max(np.abs(z)) < 3.5
