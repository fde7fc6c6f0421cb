from __future__ import annotations

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.assemble_estimate import Solved, judge, row_diagnostics
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock

MODEL = model_from_module(emps300_qm_qc)
TRUTH = np.array([1.0, 2.0, 3.0, 0.5, 4.0, 5.0])
CHOICE = FilterChoice(4, 100.0, 80.0, (1,), 80.0, 50.0, (), (), ())


def observation(spread: float = 0.1, n: int = 2000) -> Observation:
    """A row with a force, a load row and a row that is masked whole; noise on the force only."""
    rng = np.random.default_rng(0)
    forced, load = rng.standard_normal((2, n, 6))
    load[:, :3] = 0.0
    load[:, 5] = -(load[:, 3] * TRUTH[3] + load[:, 4] * TRUTH[4]) / TRUTH[5]
    Y = forced @ TRUTH + spread * rng.standard_normal(n)
    parts = ((forced, Y, "m"), (load, np.zeros(n), "c"), (forced[:0], Y[:0], "m+c"))
    blocks = tuple(
        RowBlock(0, row, "run", name, "N m", np.arange(len(y)), n, y, W, n - len(y), bool(np.any(y)), 8.0, 0)
        for row, (W, y, name) in enumerate(parts)
    )
    return Observation(MODEL.base_parameters, blocks, ("run, row m+c: not used",))


def solved(drift: float = 0.0, refused: dict[str, str] | None = None) -> Solved:
    rows = observation()
    fit = fit_matched(rows)
    return Solved(Job(MODEL, (), CHOICE), WLS(), rows, fit, refused or {}, drift**2 * np.eye(6))


def test_every_row_is_reported_also_those_without_samples() -> None:
    rows = observation()
    motor, load, masked = row_diagnostics(rows, fit_matched(rows))
    assert (motor.used, motor.masked, load.used, masked.used, masked.masked) == (2000, 0, 2000, 0, 2000)
    assert motor.residual_rms == pytest.approx(0.1, rel=0.05)
    assert motor.relative_error == pytest.approx(0.1 / np.sqrt(np.sum(TRUTH**2)), rel=0.1)
    assert load.relative_error is not None
    assert load.relative_error < 0.01
    assert (masked.weight, masked.residual_rms, masked.relative_error) == (0.0, None, None)


def test_the_estimate_holds_the_truth_and_adds_the_drift() -> None:
    plain, drifting = judge(solved(), "r-c", CheckOptions()), judge(solved(drift=0.3), "r-c", CheckOptions())
    np.testing.assert_allclose(list(plain.params.values()), TRUTH, atol=0.02)
    for entry in drifting.parameters.identified:
        assert entry.drift_std == pytest.approx(0.3)
        assert entry.std == pytest.approx(np.hypot(entry.noise_std, 0.3))
    np.testing.assert_allclose(
        drifting.cov_params() - drifting.cov_params("noise"), 0.09 * np.eye(6), atol=1e-12
    )
    assert not any("other cut-offs" in note for note in plain.fit.notes)
    assert any("other cut-offs, weights, timings or zeros" in note for note in drifting.fit.notes)


def test_pruning_counts_the_drift_and_leaves_the_estimate_alone() -> None:
    estimate = judge(solved(drift=0.06), "r-c", CheckOptions())
    assert [step.removed for step in estimate.fit.pruning.steps] == ["J_c"]  # 0.06 of 0.5
    assert "J_c" in estimate.params
    assert [name for name, _, _ in estimate.fit.pruning.kept] == ["J_m", "F_vm", "F_sm", "F_vmc", "K"]


def test_what_is_refused_stays_in_the_fit_as_a_nuisance() -> None:
    whole, part = (
        judge(solved(), "r-c", CheckOptions()),
        judge(solved(refused={"F_sm": "no motion"}), "r-c", CheckOptions()),
    )
    assert part.params["K"] == whole.params["K"]
    assert dict(part.parameters.nuisance) == {"F_sm": whole.params["F_sm"]}
    assert dict(part.not_identifiable) == {"F_sm": "no motion"}
    assert "F_sm" not in part.params
    assert "F_sm" not in part.physical
    assert np.isnan(part.base[2])
    assert part.cov_params().shape == (5, 5)
    assert part.resid.shape == (4000,)
