from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.array_types import FloatArray
from modelgen.cli.candidates import spec_model
from modelgen.runtime.diagnostics import changing_inertia as changing_inertia_module
from modelgen.runtime.diagnostics.changing_inertia import (
    ChangingInertia,
    changing_inertia,
    changing_inertia_advice,
)
from modelgen.runtime.diagnostics.row_noise import exceeding_noise
from modelgen.runtime.diagnostics.thresholds import LARGEST_NOISE
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.spec.load import parse_spec
from tests.runtime.measured_records import AXIS

MODEL = spec_model(parse_spec(AXIS, "axis.toml"), "q")
FS, N = 500.0, 5000
T = np.arange(N) / FS
RNG = np.random.default_rng(8)


def moved(inertia: FloatArray, seed: int = 0) -> Record:
    """A motor whose inertia changes, pushed as its exact motion asks; force with noise, some of it slow."""
    rng = np.random.default_rng(seed)
    q, v, a = np.zeros(N), np.zeros(N), np.zeros(N)
    for f_hz, size in ((0.3, 1.2), (0.9, 0.4), (2.1, 0.2), (4.3, 0.1)):
        w, phase = 2.0 * np.pi * f_hz, float(rng.uniform(0.0, 2.0 * np.pi))
        q += size * np.sin(w * T + phase)
        v += size * w * np.cos(w * T + phase)
        a -= size * w**2 * np.sin(w * T + phase)
    force = inertia * a + 0.5 * v + 0.3 * np.sign(v) + 0.3 * rng.standard_normal(N)
    force += np.convolve(rng.standard_normal(N), np.ones(50) / 10.0, "same")
    return Record({"q_a": q + 1e-6 * rng.standard_normal(N), "T": force}, FS, "axis")


def angle(seed: int) -> FloatArray:
    return np.asarray(moved(np.ones(N), seed).signals["q_a"])


def found(record: Record) -> ChangingInertia | None:
    choice = FilterChoice(4, 20.0, 20.0, (5,), 20.0, None, (), (), ())
    job = Job(MODEL, (record,), choice)
    fit = fit_matched(job.observed(job.records))
    assert exceeding_noise(MODEL, job.records, choice, fit, LARGEST_NOISE)
    return changing_inertia(fit, MODEL, job.records, choice)


@pytest.mark.parametrize("seed", range(6))
def test_an_inertia_that_is_one_number_is_told_to_be_none_else(seed: int) -> None:
    assert found(moved(np.full(N, 1.0), seed)) is None


def test_an_inertia_that_changes_with_what_no_sensor_shows() -> None:
    one = found(moved(1.0 + 0.3 * np.cos(2.0 * np.pi * 0.13 * T)))
    assert one is not None
    assert (one.name, one.along) == ("J", "over the records")
    assert one.share == pytest.approx(0.21, rel=0.2)
    assert one.explained > 0.5


def test_an_inertia_that_changes_with_the_angle() -> None:
    one = found(moved(1.0 + 0.3 * np.cos(angle(0))))
    assert one is not None
    assert one.along == "with the angle of a"
    assert changing_inertia_advice(one)[0].where == "J"
    assert changing_inertia_advice(None) == ()


@pytest.mark.parametrize("place", [np.arange(40, 80), np.array([40, 43, 79])], ids=["all", "masked"])
def test_rows_of_a_stretch_share_the_angles(place: np.ndarray) -> None:
    model, q = model_from_module(emps300_qm_qc), RNG.uniform(-9.0, 9.0, 1000)
    asked: list[tuple[str, int, int]] = []

    def read(key: str, start: int, stop: int) -> FloatArray:
        asked.append((key, start, stop))
        return q[start:stop]

    record = SimpleNamespace(n=1000, dt=1e-3, read=read)
    blocks = [SimpleNamespace(record=0, grid=90)] * 2
    fit = SimpleNamespace(blocks=blocks, columns=("J_m", "K"), by_record={0: [0, 1]})
    choice = FilterChoice(4, 20.0, 20.0, (10,), 20.0, None, (), (), ())
    _, turning = changing_inertia_module._ways(fit, model, [record], choice)
    both = [turning.factors(index, place) for index in range(2)]
    at = 54 + 10 * place  # the filter's reach is left out at both ends alike
    assert np.array_equal(both[0], np.array([np.cos(q[at]), np.sin(q[at])]))
    assert np.array_equal(*both)
    assert asked == [("q_m", 454, 845)]
    assert list(changing_inertia_module._pieces(fit)) == [(0, 0), (1, 0)]


def test_the_interval_holds_the_mean_and_says_so() -> None:
    estimate = identify(MODEL, moved(1.0 + 0.3 * np.cos(2.0 * np.pi * 0.13 * T)))
    told = [one for one in estimate.checks.advice if one.where == "J"]
    assert "mean over the postures" in told[0].what
    assert abs(estimate.physical["J"] - 1.0) < 1.96 * estimate.bse["J"]
