from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.diagnostics import periods
from modelgen.runtime.diagnostics.periods import period_advice, period_spread, periods_of, spread_beyond_noise
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.hac_covariance import hac_covariance, influence
from modelgen.runtime.records.record import Record
from tests.runtime.measured_records import bench, emps
from tests.runtime.rigid_motion import CHOICE, FS, RIGID, TRUTH, rigid_record, swings

# 2.5 s are one period of the first, three of the second and eight of the third
PERIODIC = swings((0.4, 0.4), (0.1, 1.2), (0.05, 3.2))
PERIOD_S = 2.5


def record_of(seed: int = 0, n: int = 50000, **options: float) -> Record:
    return rigid_record(PERIODIC, n=n, force_noise=2.0, seed=seed, **options)


def test_a_period_is_found_or_not() -> None:
    assert periods_of(RIGID, [record_of()], None) == {"run": pytest.approx(PERIOD_S)}
    chirp = np.sin(0.3 * np.arange(20000) / FS + 0.2 * (np.arange(20000) / FS) ** 2)
    assert periods_of(RIGID, [Record({"q_m": chirp, "F": chirp}, FS)], None) == {}
    noise = np.random.default_rng(0).standard_normal((2, 20000))
    assert periods_of(RIGID, [Record({"q_m": noise[0], "F": noise[1]}, FS)], None) == {}
    assert periods_of(RIGID, [Record({"q_m": chirp, "F": np.ones(20000)}, FS)], None) == {}
    # three of them are too few
    assert periods_of(RIGID, [record_of(n=7500)], None) == {}
    assert periods_of(RIGID, [record_of()], "none") == {}


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        (1.0, "it repeats every 2.5 s"),
        (-1.0, "longer than two samples"),
        (20.0, "fewer than 4 periods"),
        ({"walk": 2.5}, "has no record walk"),
        ("some", "none"),
        (float("nan"), "longer than two samples"),
    ],
)
def test_a_wrong_declaration_is_named(declared: float | dict[str, float] | str, said: str) -> None:
    with pytest.raises(DataError, match=said):
        periods_of(RIGID, [record_of()], declared)


def test_a_declared_period_is_taken() -> None:
    assert periods_of(RIGID, [record_of()], PERIOD_S) == {"run": PERIOD_S}
    assert periods_of(RIGID, [record_of()], {"run": 2.0 * PERIOD_S}) == {"run": 2.0 * PERIOD_S}


def test_the_spread_over_periods_is_that_over_records() -> None:
    values, spreads = [], []
    for seed in range(30):
        record = record_of(seed)
        fit = METHODS["wls"].run(Job(RIGID, (record,), CHOICE))[1]
        found = period_spread(fit, [record], CHOICE.decimation, {"run": PERIOD_S})
        assert found is not None
        assert 19 <= found.count <= 21
        values.append(fit.solution.x)
        spreads.append(np.diag(found.covariance))
    empirical, said = np.std(values, axis=0), np.sqrt(np.mean(spreads, axis=0))
    np.testing.assert_allclose(said, empirical, rtol=0.5)


def test_the_spread_is_that_of_the_sums_over_each_period() -> None:
    record = record_of(n=12500)
    fit = METHODS["wls"].run(Job(RIGID, (record,), CHOICE))[1]
    found = period_spread(fit, [record], CHOICE.decimation, {"run": PERIOD_S})
    assert found is not None
    (psi,) = influence(fit)
    at_s = (fit.blocks[0].start + CHOICE.decimation[0] * np.arange(len(psi))) / FS
    sums = np.array([psi[(at_s >= PERIOD_S * k) & (at_s < PERIOD_S * (k + 1))].sum(axis=0) for k in range(5)])
    assert found.count == 5
    np.testing.assert_allclose(found.covariance, 5.0 * np.cov(sums.T), rtol=1e-9)


def test_a_drifting_friction_shows_over_periods_and_widens_the_interval() -> None:
    still = record_of()
    drift = 2.0 * np.sin(np.arange(50000) / FS)  # N, changes from period to period
    moved = Record({"q_m": still.signals["q_m"], "F": still.signals["F"] + drift}, FS, "run")
    for record, drifts in ((still, False), (moved, True)):
        fit = METHODS["wls"].run(Job(RIGID, (record,), CHOICE))[1]
        # noise of the fit without its slow part: as if only what a period shows were known
        noise = hac_covariance(METHODS["wls"].run(Job(RIGID, (still,), CHOICE))[1])
        found = period_spread(fit, [record], CHOICE.decimation, {"run": PERIOD_S})
        assert found is not None
        assert bool(np.any(spread_beyond_noise(found, noise))) is drifts
        assert bool(period_advice(found, noise, fit.columns)) is drifts


@pytest.mark.parametrize("steps", [1, 2])
def test_noise_of_differentiated_readings_does_not_differ_between_periods(
    monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    """Sums over periods hold the ends of such noise, up to hundreds of times what the sum over all does."""
    record = record_of(n=12500)
    fit = METHODS["wls"].run(Job(RIGID, (record,), CHOICE))[1]
    (psi,) = influence(fit)
    rng, alarms = np.random.default_rng(5), 0
    for _ in range(60):
        white = rng.standard_normal((len(psi) + steps, len(fit.columns)))
        # what is left of differentiated noise in the mean is a hundredth of it
        noise = np.diff(white, steps, axis=0) + 0.01 * rng.standard_normal(psi.shape)
        monkeypatch.setattr(periods, "influence_parts", lambda fit, noise=noise: [lambda: iter([noise])])
        found = period_spread(fit, [record], CHOICE.decimation, {"run": PERIOD_S})
        assert found is not None
        expected = np.eye(len(fit.columns)) * (len(psi) * 0.01**2 + 2.0 * (2.0 if steps == 2 else 1.0))
        assert np.all(np.diag(found.covariance) > 0.0)
        alarms += bool(np.any(spread_beyond_noise(found, expected)))
    assert alarms <= 3


def test_sums_over_triangles_have_the_variance_of_white_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    record = record_of(n=12500)
    fit = METHODS["wls"].run(Job(RIGID, (record,), CHOICE))[1]
    (psi,) = influence(fit)
    rng, ratios, alarms = np.random.default_rng(6), [], 0
    for _ in range(200):
        white = rng.standard_normal(psi.shape)
        monkeypatch.setattr(periods, "influence_parts", lambda fit, white=white: [lambda: iter([white])])
        found = period_spread(fit, [record], CHOICE.decimation, {"run": PERIOD_S})
        assert found is not None
        assert found.degrees == 2
        ratios.append(found.smooth / len(psi))
        alarms += bool(np.any(spread_beyond_noise(found, len(psi) * np.eye(len(fit.columns)))))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
    assert alarms <= 8


def test_records_without_a_period_have_no_spread() -> None:
    record = record_of()
    fit = METHODS["wls"].run(Job(RIGID, (record,), CHOICE))[1]
    assert period_spread(fit, [record], CHOICE.decimation, {}) is None
    assert period_spread(fit, [record], CHOICE.decimation, {"run": 40.0}) is None


@pytest.mark.slow
def test_the_estimate_carries_the_third_covariance() -> None:
    estimate = identify(RIGID, record_of(), **values_of(cutoff_hz=40.0, direction_cutoff_hz=10.0))
    periods = estimate.checks.periods
    assert periods is not None
    assert periods.period_s == (("run", pytest.approx(PERIOD_S)),)
    np.testing.assert_allclose(np.sqrt(np.diag(estimate.cov_params("periods"))), periods.std)
    for entry, spread in zip(estimate.parameters.identified, periods.std, strict=True):
        assert 0.2 < spread / entry.noise_std < 5.0
        assert entry.value == pytest.approx(TRUTH[entry.name], abs=6.0 * entry.std)
    assert re.search(r"eq\. \(11\) +periods$", estimate.summary(), re.MULTILINE)
    assert estimate.to_dict()["checks"]["periods"]["count"] == periods.count
    assert identify(RIGID, record_of(), **values_of(period_s="none")).checks.periods is None


def test_the_bench_has_twenty_periods_of_a_second(shared_data: Path) -> None:
    model, record = bench(shared_data)
    assert periods_of(model, [record], None) == {"bench": 1.0}


def test_the_emps_record_holds_too_few_periods(shared_data: Path) -> None:
    model, record = emps(shared_data)
    assert periods_of(model, [record], None) == {}
