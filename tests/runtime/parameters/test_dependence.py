from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from generated import emps300_qm_qc
from modelgen.runtime.identification.refusals import dependent_columns
from modelgen.runtime.least_squares.fit import Fit
from modelgen.runtime.least_squares.hac_covariance import hac_covariance
from modelgen.runtime.least_squares.projected_least_squares import two_stage
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.parameters.dependence import dependences
from modelgen.runtime.parameters.thresholds import HIGHEST_INDEX
from modelgen.runtime.rows.observation import Observation
from modelgen.runtime.rows.row_block import RowBlock

COLUMNS = model_from_module(emps300_qm_qc).base_parameters
TRUTH = np.array([1.0, 2.0, 3.0, 0.5, 4.0, 5.0])


def fit_of(W: np.ndarray, spread: float = 0.1) -> Fit:
    n = len(W)
    Y = W @ TRUTH + spread * np.random.default_rng(1).standard_normal(n)
    block = RowBlock(0, 0, "run", "m", "N m", np.arange(n), n, Y, W, 0, True, 8.0, 0)
    return fit_matched(Observation(COLUMNS, (block,)))


def columns(n: int = 3000) -> np.ndarray:
    return np.random.default_rng(0).standard_normal((n, 6))


def test_columns_that_stand_apart_are_left_alone() -> None:
    W = columns() * 10.0 ** np.arange(-6, 6, 2)  # scales of columns are no dependence
    fit = fit_of(W)
    assert dependences(fit, hac_covariance(fit)) == []


def test_two_columns_that_move_together_are_seen_as_their_sum() -> None:
    W = columns()
    # 0.3 times the column of J_c, but for a thousandth
    W[:, 4] = 0.3 * W[:, 3] + 3e-4 * W[:, 4]
    fit = fit_of(W)
    (found,) = dependences(fit, hac_covariance(fit))
    assert found.columns == ("J_c", "F_vmc")
    assert found.condition_index == pytest.approx(2.0 / 1e-3, rel=0.5)
    (seen,) = found.combinations
    coefficients = {name: coefficient for coefficient, name in seen.terms}
    assert coefficients["F_vmc"] / coefficients["J_c"] == pytest.approx(0.3, rel=1e-3)
    scale = coefficients["J_c"]
    # the sum is known as well as a single column would be, each of the two is not
    assert seen.value / scale == pytest.approx(0.5 + 0.3 * 4.0, abs=5.0 * seen.std / scale)
    assert seen.std / scale < 0.01
    spread = np.sqrt(np.diag(hac_covariance(fit)))
    assert spread[3] > 1.0
    assert "J_c and F_vmc move together: only" in found.text
    assert found.text.endswith("is seen")


@pytest.mark.parametrize("noise", [0.1, 1e-4])
def test_value_and_deviation_are_those_of_the_sum_as_printed(noise: float) -> None:
    W = columns()
    # a factor that two digits take for one
    W[:, 4] = 1.018 * W[:, 3] + 3e-4 * W[:, 4]
    fit = fit_of(W, noise)
    covariance = hac_covariance(fit)
    (found,) = dependences(fit, covariance)
    (seen,) = found.combinations
    first, second = seen.text.split(" + ")
    printed = np.zeros(6)
    for term in (first, second):
        factor, name = term.rsplit(" ", 1) if " " in term else ("1", term)
        printed[COLUMNS.index(name)] = float(factor)
    assert seen.value == pytest.approx(printed @ fit.solution.x, rel=1e-12)
    assert seen.std == pytest.approx(np.sqrt(printed @ covariance @ printed), rel=1e-9)
    spread = np.sqrt(np.diag(covariance))
    assert seen.std < 0.01 * spread[3]


def test_exact_dependence_of_three_columns_leaves_two_combinations() -> None:
    W = columns()
    W[:, 5] = W[:, 0] - 2.0 * W[:, 1]
    fit = fit_of(W)
    assert fit.solution.undetermined.tolist() == [True, True, False, False, False, True]
    (found,) = dependences(fit, hac_covariance(fit), HIGHEST_INDEX)
    assert found.columns == ("J_m", "F_vm", "K")
    assert len(found.combinations) == 2
    # every combination is one of J_m + K and F_vm - 2 K
    for one in found.combinations:
        weight = dict.fromkeys(found.columns, 0.0) | {name: c for c, name in one.terms}
        assert weight["K"] == pytest.approx(weight["J_m"] - 2.0 * weight["F_vm"], abs=1e-6)
        truth = weight["J_m"] * 1.0 + weight["F_vm"] * 2.0 + weight["K"] * 5.0
        assert one.value == pytest.approx(truth, abs=0.02)


def test_combinations_are_those_that_no_unseen_change_touches() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        W = rng.standard_normal((500, 6)) * 10.0 ** rng.uniform(-3.0, 3.0, 6)
        # two directions that the columns do not show, over four of them
        hidden = np.zeros((2, 6))
        hidden[:, :4] = rng.standard_normal((2, 4)) / np.linalg.norm(W[:, :4], axis=0)
        orthogonal = np.linalg.qr(hidden.T)[0]
        W -= W @ orthogonal @ orthogonal.T
        fit = fit_of(W)
        (found,) = dependences(fit, hac_covariance(fit), HIGHEST_INDEX)
        assert found.columns == COLUMNS[:4]
        assert len(found.combinations) == 2
        for one in found.combinations:
            weight = np.zeros(6)
            for coefficient, name in one.terms:
                weight[COLUMNS.index(name)] = coefficient
            # in columns of unit length; below five percent a column is left unsaid
            length = np.linalg.norm(W, axis=0)
            seen, unseen = weight / length, hidden * length
            size = np.linalg.norm(seen) * np.linalg.norm(unseen, axis=1)
            assert np.all(np.abs(unseen @ seen) < 0.1 * size)
            assert one.terms[0][0] == 1.0


def test_two_separate_pairs_are_two_groups() -> None:
    W = columns()
    W[:, 1] = W[:, 0] + 1e-3 * W[:, 1]
    W[:, 5] = -W[:, 4] + 1e-3 * W[:, 5]
    fit = fit_of(W)
    groups = dependences(fit, hac_covariance(fit))
    assert [group.columns for group in groups] == [("J_m", "F_vm"), ("F_vmc", "K")]
    assert [group.combinations[0].text for group in groups] == ["J_m + F_vm", "F_vmc - K"]
    assert (
        groups[0].inseparable("why").startswith("J_m, F_vm cannot be distinguished in these records (why; ")
    )
    model = SimpleNamespace(composites={"F_vm": "F_vm*J_c/K"}, parameters=("J_m", "J_c", "K"))
    # what is known of a composite is nothing that the spec names
    told = groups[0].inseparable("why", model)  # type: ignore[arg-type]
    assert told == "J_m, J_c, K cannot be distinguished in these records (why)"


def test_columns_that_a_simulation_moves_as_one_are_known_as_a_sum() -> None:
    Z = columns()
    # all but rounding of the filters is one: J_c with F_vmc
    Z[:, 4] = Z[:, 3] + 1e-8 * Z[:, 4]
    noise = 1e-3 * np.random.default_rng(2).standard_normal(Z.shape)
    noise[:, 4] = noise[:, 3]
    W = Z + noise
    reasons = dependent_columns(two_stage(fit_of(W), (Z,)))
    assert list(reasons) == [COLUMNS[3], COLUMNS[4]]
    for name in reasons:
        assert f"W is short of rank; known is {COLUMNS[3]} + {COLUMNS[4]} = 4.4999 +- " in reasons[name]


def test_the_sum_is_known_whatever_rounding_leaves_of_the_index() -> None:
    W = columns()
    W[:, 4] = W[:, 3] + 1e-6 * W[:, 4]  # an index of 2e6, below that of equal columns
    fit = fit_of(W)
    lost = np.array([name in COLUMNS[3:5] for name in COLUMNS])  # as a fit in physical parameters says
    reasons = dependent_columns(replace(fit, solution=replace(fit.solution, undetermined=lost)))
    assert list(reasons) == [COLUMNS[3], COLUMNS[4]]
    for why in reasons.values():
        assert f"known is {COLUMNS[3]} + {COLUMNS[4]} = 4.4999 +- 0.0037" in why
