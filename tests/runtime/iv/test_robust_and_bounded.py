"""Robust weights and bounds where instrumental variables fit physical parameters to composites."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.physical.test_composite_iv import NOISE, clean, model_of, motor_only

# fixed filters: what a test says does not hang on how they are chosen
AXIS: dict[str, Any] = {"cutoff_hz": 263.0, "direction_cutoff_hz": 206.0}
LOAD: dict[str, Any] = {"cutoff_hz": 122.0, "direction_cutoff_hz": 95.0}
SLICK = """
chain = { name = "slick", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "torque" },
    { name = "c", inertia = "J_c", viscous = "F_vc" },
]
links = [{ bodies = ["m", "c"], stiffness = "K"%s }]

[parameters.truth]
J_m = 1.0e-5
F_vm = 2.0e-5
F_sm = 5.0e-3
J_c = 5.0e-6
F_vc = %r
K = 0.4
%s

[sensors.qm]
q_m = { body = "m", measures = "position" }
"""


@cache
def slick(damped: bool = False) -> Model:
    """A load that only its motor's encoder sees, without viscous friction, or without damping of its link."""
    parts = (', damping = "D"', 3e-5, "D = 0.0") if damped else ("", 0.0, "")
    return model_of(SLICK % parts, "qm")


@cache
def silent(damped: bool = False) -> tuple[Record, ...]:
    model, kinds = slick(damped), (("chirp", 32), ("trapezoid", 8))
    truth = model.parameter_sets["truth"]
    return tuple(
        simulate(model, truth, kind, fs=5000.0, duration_s=2.0, oversample=n).record for kind, n in kinds
    )


def noisy(records: tuple[Record, ...], seed: int, spikes: float = 0.0) -> list[Record]:
    """Records with the noise of their sensors, and leaps of so many rad in 0.5 % of the samples of q_m."""
    rng = np.random.default_rng(seed)
    found = []
    for record in records:
        signals = {
            key: samples + NOISE.get(key, 1e-4) * rng.standard_normal(samples.size)
            for key, samples in record.signals.items()
        }
        hit = rng.random(record.n) < 0.005
        signals["q_m"] = signals["q_m"] + np.where(hit, spikes * rng.choice([-1.0, 1.0], record.n), 0.0)
        found.append(Record(signals, record.fs, record.name))
    return found


def of_slick(seed: int, damped: bool = False, **options: object) -> Estimate:
    options = {"drift_check": False, **LOAD, **options}
    return identify(slick(damped), noisy(silent(damped), seed), **values_of("iv", **options))  # type: ignore[arg-type]


@pytest.mark.slow
def test_spikes_of_an_encoder_weigh_less() -> None:
    model = motor_only("emps300")
    truth, names = model.parameter_sets["light"], ("J_m", "J_c", "F_vmc", "K")
    errors: dict[str | None, list[list[float]]] = {None: [], "huber": []}
    spreads: dict[str | None, list[float]] = {None: [], "huber": []}
    for seed in range(6):
        records = noisy(clean("light"), seed, spikes=3e-3)
        for robust in errors:
            estimate = identify(model, records, **values_of("iv", robust=robust, drift_check=False, **AXIS))
            errors[robust].append([estimate.physical[name] / truth[name] - 1.0 for name in names])
            spreads[robust] += [
                e.std / truth[e.name] for e in estimate.parameters.physical if e.name in names
            ]
            assert any(note.startswith("robust (Huber") for note in estimate.fit.notes) == bool(robust)
    plain, weighed = (np.sqrt(np.mean(np.square(found), axis=0)) for found in errors.values())
    # J_m gains least: without weights it is off by a tenth of what the others are
    assert np.all(weighed < np.array([0.85, 0.6, 0.6, 0.6]) * plain)
    assert np.mean(weighed / plain) < 0.65
    assert np.mean(spreads["huber"]) < 0.7 * np.mean(spreads[None])


@pytest.mark.slow
def test_normal_noise_is_weighed_as_it_should_be() -> None:
    plain, robust = of_slick(0), of_slick(0, robust="huber")
    (note,) = [note for note in robust.fit.notes if note.startswith("robust")]
    share = float(note.split("(")[2].split(" %")[0])
    assert share == pytest.approx(18.0, abs=4.0)
    for name in plain.params:
        assert robust.params[name] != plain.params[name]
        assert abs(robust.params[name] - plain.params[name]) < plain.bse[name]
        assert robust.bse[name] == pytest.approx(plain.bse[name], rel=0.25)


@pytest.mark.slow
def test_friction_below_zero_is_zero_and_its_cost_is_told() -> None:
    truth = slick().parameter_sets["truth"]
    active = []
    for seed in range(4):
        plain, bounded = of_slick(seed), of_slick(seed, bounds="physical")
        cost = bounded.checks.bounds
        assert cost is not None
        assert cost.bounded == slick().parameters
        if plain.params["F_vc/K"] >= 0.0:
            # bit by bit
            assert (cost.active, cost.residual_increase) == ((), 0.0)
            assert bounded.params == plain.params
            assert bounded.bse == plain.bse
            assert bounded.physical == plain.physical
            assert "none is active" in bounded.summary()
            continue
        active.append(seed)
        ((name, value),) = cost.active
        assert name == "F_vc"
        assert value == pytest.approx(plain.params["F_vc/K"] * bounded.physical["K"], rel=0.05)
        assert cost.deviations == pytest.approx(100.0 / plain.relative_std["F_vc/K"], rel=0.1)
        assert cost.residual_increase > 0.0
        # values of columns; of a physical parameter at its bound the reason tells
        assert bounded.parameters.nuisance["F_vc/K"] == 0.0
        assert "F_vc" not in bounded.parameters.nuisance
        assert bounded.not_identifiable["F_vc"].startswith("lies at its bound, 0")
        assert bounded.not_identifiable["F_vc/K"] == "is zero with F_vc at the bound"
        assert "F_vc/K" not in bounded.params
        for entry in bounded.parameters.physical:
            assert abs(entry.value - truth[entry.name]) < 3.5 * entry.std
        assert {entry.name for entry in bounded.parameters.physical} == {*truth} - {"F_vc"}
        # what is known of the load makes the rest no less certain, but for the window of each covariance
        assert bounded.bse["F_sm"] < 1.01 * plain.bse["F_sm"]
        assert "at its bound" in bounded.summary()
    assert 0 < len(active) < 4


@pytest.mark.slow
def test_friction_a_little_below_zero_takes_nothing_else_away() -> None:
    model, truth = slick(), slick().parameter_sets["truth"]
    seed = next(seed for seed in range(4) if of_slick(seed).params["F_vc/K"] < 0.0)
    estimate = of_slick(seed)
    assert set(estimate.physical) == {*truth} - {"F_vc"}
    for entry in estimate.parameters.physical:
        assert abs(entry.value - truth[entry.name]) < 3.5 * entry.std
    assert "standard deviation" in estimate.not_identifiable["F_vc"]
    # nor the comparison with other cut-offs
    records = tuple(noisy(silent(), seed))
    job = Job(model, records, choose_filter(model, records, **LOAD))
    _, fit = METHODS["iv"].run(job)
    higher = replace(job.choice, cutoff_hz=1.4 * job.choice.cutoff_hz)
    _, other = METHODS["iv"].run(replace(job, choice=higher, start=fit))
    spread = np.sqrt(np.diag(hac_covariance(fit)))
    assert np.all(np.abs(other.solution.x - fit.solution.x) < 3.0 * spread)


@pytest.mark.slow
def test_a_bound_lets_damping_go_to_zero() -> None:
    found = of_slick(1, damped=True, bounds="physical")
    truth = slick(damped=True).parameter_sets["truth"]
    for entry in found.parameters.physical:
        assert abs(entry.value - truth[entry.name]) < 3.5 * entry.std
    assert {"J_m", "J_c", "F_vc", "K"} <= set(found.physical)
    assert "D" in found.not_identifiable


@pytest.mark.slow
def test_bounds_and_weights_hold_at_other_settings() -> None:
    seed = 1
    found = of_slick(seed, bounds="physical", robust="huber", drift_check=True, scan_cutoffs=[200.0])
    cost = found.checks.bounds
    assert cost is not None
    assert [name for name, _ in cost.active] == ["F_vc"]
    assert any(note.startswith("robust") for note in found.fit.notes)
    scan = found.checks.scan
    assert scan is not None
    assert "F_vc/K" not in scan.names
    for point in scan.points:
        assert point.failed is None
        for name, value, std in zip(scan.names, point.values, point.stds, strict=True):
            assert abs(value - found.params[name]) < 4.0 * std


def test_what_is_held_at_zero_stays_there_whatever_the_records_say() -> None:
    model, records = slick(), tuple(noisy(silent(), 0))
    job = Job(model, records, choose_filter(model, records, **LOAD), at_zero=("F_vc",))
    _, fit = METHODS["iv"].run(job)
    held = model.base_parameters.index("F_vc/K")
    assert fit.columns == model.base_parameters
    assert fit.solution.x[held] == 0.0
    spread = np.sqrt(np.diag(hac_covariance(fit)))
    # rounding of the slopes remains, a millionth of what a free F_vc has
    assert spread[held] < 1e-6 * spread[model.base_parameters.index("F_vm + F_vc")]
    assert np.all(np.delete(spread, held) > 0.0)
    # without bounds it would not be zero
    assert fit.carried is not None
    assert fit.carried.linear.solution.x[model.parameters.index("F_vc")] > 0.0
