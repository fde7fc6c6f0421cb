"""What is told where instruments lead nowhere: of every kind of record that is not what the model means."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from generated import emps300_qm_ac, emps300_qm_qc
from modelgen import generate
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.divergence import diverged, refuse_runaway, simulation_failed
from modelgen.runtime.iv.thresholds import LEFT_OF_FORCE
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import Model, model_from_module, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, parse_spec

FURTHER = """
[sensors.vm_qc]
v_m = { body = "m", measures = "velocity" }
q_c = { body = "c", measures = "position" }

[sensors.qm_d]
q_m = { body = "m", measures = "position" }
d = { deflection = ["m", "c"], measures = "position" }

[sensors.qc]
q_c = { body = "c", measures = "position" }
"""
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}
SETS = ("qm_qc", "qm_ac", "vm_qc", "qm_d", "qc")
Change = Callable[[Record, str, int], Record]


@cache
def recorded(name: str) -> tuple[Model, tuple[Record, ...]]:
    spec = parse_spec(catalog_path("emps300").read_text(encoding="utf-8") + FURTHER, "emps300.toml")
    known = {"qm_qc": emps300_qm_qc, "qm_ac": emps300_qm_ac}
    model = model_from_module(known[name]) if name in known else model_from_text(generate(spec, name), name)
    truth = model.parameter_sets["table_2"]
    noise = {key: std for key, std in NOISE.items() if key in model.channels}
    return model, tuple(
        simulate(model, truth, kind, duration_s=1.0, noise=noise, oversample=8, seed=seed).record
        for seed, kind in enumerate(("chirp", "trapezoid"))
    )


def changed(record: Record, key: str, samples: np.ndarray) -> Record:
    return Record({**record.signals, key: samples}, record.fs, record.name)


def zeros(record: Record, key: str, index: int) -> Record:
    return changed(record, key, record.signals[key] + (0.01, 0.05)[index])


def turned(record: Record, key: str, index: int) -> Record:
    return changed(record, key, -record.signals[key])


def late(record: Record, key: str, index: int) -> Record:
    samples = record.signals[key]
    return changed(record, key, np.r_[np.full(150, samples[0]), samples[:-150]])


@pytest.mark.slow
@pytest.mark.parametrize("change", [zeros, turned, late])
@pytest.mark.parametrize("name", SETS)
def test_instruments_end_in_an_estimate_or_in_what_the_record_lacks(name: str, change: Change) -> None:
    model, records = recorded(name)
    failed = 0
    for sensor in model.sensors:
        wrong = [change(record, sensor.key, index) for index, record in enumerate(records)]
        try:
            identify(model, wrong, "iv", cutoff_hz=300.0)
        except IdentifiabilityError as error:
            failed += 1
            for problem in error.problems:
                assert "wls" not in problem.remedy
            first = error.problems[0]
            if "does not converge" in first.what:
                assert "every channel is what the model means" in first.remedy
    if (name, change) == ("qm_d", turned):
        assert failed


def test_what_the_last_fit_shows_is_told() -> None:
    model, records = recorded("qm_qc")

    choice = choose_filter(model, records, cutoff_hz=300.0)
    good = fit_matched(observe(model, records, choice))
    assert "leaves" not in str(diverged("it stops", good, model))
    wrong = [turned(late(record, "q_m", 0), "q_m", 0) for record in records]
    fit = fit_matched(observe(model, wrong, choice))
    assert max(fit.unexplained(index) or 0.0 for index in range(2)) > LEFT_OF_FORCE
    (problem,) = diverged("it stops", fit, model).problems
    assert problem.what.startswith("does not converge: it stops; row m leaves ")
    negative = [name for name, value in zip(fit.columns, fit.solution.x, strict=True) if value < 0.0]
    assert negative
    assert all(f"{name} = -" in problem.what for name in negative)


@pytest.mark.parametrize("value", [1e-80, -1e-40, 1e40, np.inf, np.nan])
def test_an_estimate_that_cannot_be_calculated_with_is_refused(value: float) -> None:
    model, records = recorded("qm_qc")

    fit = fit_matched(observe(model, records, choose_filter(model, records, cutoff_hz=300.0)))
    refuse_runaway(fit.columns, fit.solution.x, fit, model)
    far = np.array([*fit.solution.x[:-1], value])
    with pytest.raises(IdentifiabilityError, match="not finite" if not np.isfinite(value) else "K runs away"):
        refuse_runaway(fit.columns, far, fit, model)


def test_a_simulation_that_fails_on_impossible_values_is_told_by_these() -> None:
    model, records = recorded("qm_qc")
    fit = fit_matched(observe(model, list(records), choose_filter(model, records)))
    fast = DataError.at("simulation", "has a motion too fast (4e-23 s) for steps of 0.001 s", "raise fs")
    assert "its simulation fails (has a motion too fast" in str(simulation_failed(fast, fit, model))
    x = np.where(np.isin(fit.columns, ("K",)), -1.0, 1.0) * fit.solution.x
    told = str(simulation_failed(fast, replace(fit, solution=replace(fit.solution, x=x)), model))
    assert "no chain that can be simulated belongs to its estimate; K = -" in told
    assert "too fast" not in told
