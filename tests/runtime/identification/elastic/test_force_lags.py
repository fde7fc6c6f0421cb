"""Lags of current loops of elastic arms: told from delays, or in the intervals; noise of forces is none."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.identification.elastic.channel_errors import (
    channel_errors,
    resolved,
    runs_away,
    set_right,
    tried_size,
)
from modelgen.runtime.identification.elastic.effect_rows import EffectRows
from modelgen.runtime.identification.elastic.force_lags import (
    force_lags,
    lag_of_delay,
    noise_along_lag,
)
from modelgen.runtime.identification.elastic.joint_effects import JointEffects
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.identification.options import CheckOptions, Filters
from modelgen.runtime.identification.task import prepared
from modelgen.runtime.iv.model_errors import delay_effect
from modelgen.runtime.records.record import Record
from tests.runtime.identification.elastic.test_channels_set_right import (
    FS,
    errors,
    estimated,
    exact,
    made,
    noisy,
    told,
)

LAG_S = 2e-3


def behind_lags(channels: dict[str, np.ndarray], lag_s: float) -> dict[str, np.ndarray]:
    """Return channels with the commands of forces that act behind a lag of that time constant."""
    model, record = exact()[0], Record(channels, FS, "acting")
    every = {effect.name: effect for effect in channel_errors(model)}
    known = {every[f"delay of {key}"]: lag_s for key in ("tau_1", "tau_2")}
    known |= {every[f"lag of {key}"]: 0.5 * lag_s**2 for key in ("tau_1", "tau_2")}
    signals = set_right(model, record, 0, known).signals
    return {key: signals[key] for key in channels}


def test_a_delay_is_that_of_the_lag_of_the_same_force() -> None:
    (lag,) = force_lags(["tau_1"])
    early = delay_effect("tau_1")
    assert lag_of_delay(early, -LAG_S, [lag]) == (lag, pytest.approx(-0.5 * LAG_S**2))
    # what was taken as held is the lag's as well, but for the average that a hold is
    found = lag_of_delay(early, -LAG_S, [lag], 1e-3)
    assert found == (lag, pytest.approx(-0.5 * (LAG_S + 0.5e-3) ** 2 + 1e-6 / 24.0))
    assert lag_of_delay(early, LAG_S, [lag]) is None
    assert lag_of_delay(delay_effect("tau_2"), -LAG_S, [lag]) is None
    assert lag_of_delay(lag, -LAG_S, [lag]) is None


def test_a_lag_has_a_time_constant_in_samples() -> None:
    (lag,) = force_lags(["tau_1"])
    record = Record({"tau_1": np.zeros(8)}, FS, "rest")
    assert resolved(lag, -0.5 * LAG_S**2, [record])
    assert not resolved(lag, -0.5 * (1e-5) ** 2, [record])
    assert runs_away(lag, -0.5 * 0.06**2, [record])
    assert not runs_away(lag, -0.5 * LAG_S**2, [record])
    assert 0.0 < tried_size(lag, record) < 1e-3 * LAG_S**2


def test_noise_of_a_force_is_no_lag() -> None:
    """Noise in the column of a lag and in the force made a lag of 4 ms where there was none."""
    model, channels, _ = exact()
    sizes = []
    quiet = noisy(channels)
    lag = next(iter(force_lags(["tau_2"])))
    for sign in (1.0, -1.0):  # what is odd in the noise cancels
        noise = sign * 0.5 * np.random.default_rng(9).standard_normal(len(quiet["tau_2"]))
        record = Record(quiet | {"tau_2": channels["tau_2"] + noise}, FS, "loud")
        job = prepared(model, [record], WLS(), Filters(cutoff_hz=60.0), CheckOptions()).job
        rows = EffectRows(job, (lag,))
        joint = JointEffects(rows.solved([lag]), (lag,), rows)
        raw = float(joint.fit.solution.x[joint.fit.columns.index(lag.name)])
        sizes.append((raw, *joint.step(lag)))
        assert noise_along_lag(model, job.records, job.choice, rows.solved([]), lag) < 0.0
    raw, size, std = np.mean(sizes, axis=0)
    assert raw < -2.0 * std
    assert abs(size) < 0.4 * abs(raw)


@pytest.mark.slow
def test_a_lag_is_named_and_its_force_set_right() -> None:
    model, channels, truth = exact()
    found = estimated(model, noisy(behind_lags(channels, LAG_S)))
    for key in ("tau_1", "tau_2"):
        assert any(f"{key} acts behind a lag" in said and "2e+03 us" in said for said in told(found))
    assert np.max(np.abs(errors(found, truth))) < 3.5


@pytest.mark.slow
def test_a_right_record_with_loud_forces_has_no_lag() -> None:
    model, read, truth = made()
    rng = np.random.default_rng(6)
    loud = {key: read[key] + 0.2 * rng.standard_normal(len(read[key])) for key in ("tau_1", "tau_2")}
    found = estimated(model, read | loud)
    assert not any("lag" in said for said in told(found))
    assert np.max(np.abs(errors(found, truth))) < 3.5
