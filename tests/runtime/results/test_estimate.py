from __future__ import annotations

import json
import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.filter_choice.filter_choice import Band, FilterChoice
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.parameters.pruning import Pruning, PruningStep
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.results.estimate_parts import (
    EstimatedFit,
    EstimatedModel,
    EstimatedParameters,
    RowDiagnostics,
)
from modelgen.runtime.results.summary import summary_text


@pytest.fixture
def estimate() -> Estimate:
    """A made-up estimate that uses every part of the type."""
    parameters = (
        Parameter("J_m", "kg m^2", 9.87e-6, 1e-8, 8e-9, 6e-9, 4e-9),
        Parameter("F_vm", "N m s/rad", -2e-5, 4e-6, 4e-6, 0.0, 1e-6),
    )
    choice = FilterChoice(
        filter_order=4,
        cutoff_hz=250.0,
        direction_cutoff_hz=172.5,
        decimation=(8, 4),
        dynamics_hz=172.5,
        sampling_ratio=29.0,
        bands=(Band("chirp", 178.0, 172.5, "c"), Band("rest", 2500.0, None, None)),
        sentences=("Cut-off 250 Hz.", "chirp: every 8th sample of 5000 Hz."),
        notes=("sampled slowly",),
    )
    fit = EstimatedFit(
        method="wls",
        method_title="weighted least squares",
        covariance_kind="hac",
        filtering=choice,
        rows=(
            RowDiagnostics("chirp", "m", "N m", 1200, 30, 250.0, 0.004, 0.02),
            RowDiagnostics("rest", "m", "N m", 0, 1230, 0.0, None, None),
        ),
        residuals=((1.0, np.array([0.5, -0.25, 1.0])),),
        condition_number=12.5,
        condition_number_raw=float("inf"),
        relative_error=0.0312,
        error_norm=1.1456439,
        sigma=0.9,
        residual_dof="r-c",
        pruning=Pruning(10.0, 0.0312, (PruningStep("F_vm", 20.0, 0.035),), (("J_m", 9.9e-6, 0.11),)),
        delays={"Gamma_m": 1.05e-4},
        notes=("rest, row m: not used",),
    )
    return Estimate(
        EstimatedModel("emps300", "qm_qc", "An axis <& more>"),
        ("chirp", "rest"),
        fit,
        Covariances(
            total=np.diag([1e-16, 1.6e-11]),
            noise=np.diag([6.4e-17, 1.6e-11]),
            drift=np.diag([3.6e-17, 0.0]),
            printed=np.diag([1.6e-17, 1e-12]),
        ),
        EstimatedParameters(
            parameters,
            (Parameter("J_total", "kg m^2", 1.1e-5, 2e-8, 1e-8, 1e-8, 1e-8),),
            np.array([9.87e-6, -2e-5, np.nan]),
            {"O_m": 0.25},
            {"O_m": "the encoders' zeros are unrelated"},
        ),
    )


def test_numbers_go_by_name(estimate: Estimate) -> None:
    assert dict(estimate.params) == {"J_m": 9.87e-6, "F_vm": -2e-5}
    assert dict(estimate.bse) == {"J_m": 1e-8, "F_vm": 4e-6}
    assert estimate.relative_std["F_vm"] == pytest.approx(20.0)
    assert dict(estimate.physical) == {"J_total": 1.1e-5}
    assert estimate.nobs == 1200
    assert Parameter("x", "N", 0.0, 1.0, 1.0, 0.0, 1.0).relative_std == float("inf")


def test_intervals_are_normal(estimate: Estimate) -> None:
    low, high = estimate.conf_int()["F_vm"]
    assert low == pytest.approx(-2e-5 - 1.959964 * 4e-6)
    assert high == pytest.approx(-2e-5 + 1.959964 * 4e-6)
    for alpha in (95, 0.0, float("nan"), "0.05", True):
        with pytest.raises(DataError, match=r"alpha: is .*; intervals of 95 % have 0\.05"):
            estimate.conf_int(alpha)  # type: ignore[arg-type]
    narrow = estimate.conf_int(alpha=0.5)["F_vm"]
    assert low < narrow[0] < narrow[1] < high
    assert estimate.conf_int(physical=True)["J_total"] == pytest.approx(
        (1.1e-5 - 3.919928e-8, 1.1e-5 + 3.919928e-8)
    )
    assert [entry.name for entry in estimate.parameters.told] == ["J_m", "F_vm", "J_total"]


def test_three_covariances(estimate: Estimate) -> None:
    assert estimate.cov_params()[0, 0] == 1e-16
    assert estimate.cov_params("noise")[0, 0] == 6.4e-17
    assert estimate.cov_params("printed")[0, 0] == 1.6e-17
    with pytest.raises(KeyError):
        estimate.cov_params("wrong")


def test_nothing_can_be_changed(estimate: Estimate) -> None:
    with pytest.raises(FrozenInstanceError):
        estimate.fit.sigma = 1.0  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        estimate.resid[0] = 0.0
    for mapping in (
        estimate.params,
        estimate.parameters.nuisance,
        estimate.not_identifiable,
        estimate.delays,
    ):
        with pytest.raises(TypeError):
            mapping["J_m"] = 1.0  # type: ignore[index]


def test_it_does_not_change_with_what_it_was_made_from(estimate: Estimate) -> None:
    residual = np.ones(3)
    other = replace(estimate, fit=replace(estimate.fit, residuals=((2.0, residual),)))
    residual[0] = 7.0
    assert other.resid[0] == 2.0


def test_json_is_deterministic_and_knows_no_nan(estimate: Estimate) -> None:
    text = estimate.to_json()
    assert text == estimate.to_json()
    read = json.loads(text)
    assert read["base"] == [9.87e-6, -2e-5, None]
    assert read["condition_number_raw"] is None
    assert read["params"] == {"J_m": 9.87e-6, "F_vm": -2e-5}
    assert read["conf_int_95"]["J_m"][0] < 9.87e-6 < read["conf_int_95"]["J_m"][1]
    assert read["rows"][1]["residual_rms"] is None
    assert read["filtering"]["bands"][1]["body"] is None
    assert read["pruning"]["steps"] == [{"removed": "F_vm", "relative_std": 20.0, "relative_error": 0.035}]
    assert (read["format"], read["version"]) == ("modelgen estimate", 1)
    assert "resid" not in read


def test_it_travels_between_processes(estimate: Estimate) -> None:
    back = pickle.loads(pickle.dumps(estimate))
    assert back.to_json() == estimate.to_json()
    np.testing.assert_array_equal(back.resid, estimate.resid)


def test_html_is_escaped(estimate: Estimate) -> None:
    hostile = replace(estimate, records=("<script>alert(1)</script>",))
    page = hostile._repr_html_()
    assert page.startswith("<p>") and "<pre>" in page
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_repr_is_one_line(estimate: Estimate) -> None:
    assert repr(estimate) == "Estimate(emps300, qm_qc, wls: J_m=9.87e-06, F_vm=-2e-05)"


def test_the_summary_is_the_text_of_the_estimate(estimate: Estimate) -> None:
    assert estimate.summary() == summary_text(estimate)
