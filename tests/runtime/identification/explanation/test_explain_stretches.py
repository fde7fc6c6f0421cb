"""What stretches of long records show is estimated on the whole of them."""

from __future__ import annotations

import pytest

from modelgen.runtime.identification import default_method
from modelgen.runtime.identification.explanation import explain_stretches
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.model_errors import zero_effect
from tests.runtime.two_mass_records import SMALL, TRUTH, assert_truth_inside, two_mass_records


@pytest.fixture(autouse=True)
def stretches(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (default_method, explain_stretches):
        monkeypatch.setattr(module, "SEARCHED", 8192)
    monkeypatch.setattr(explain_stretches, "STRETCHES", 2)


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "word"), [(0.25, "late"), (-0.5, "early")])
def test_an_encoder_out_of_step_is_found_in_stretches(samples: float, word: str) -> None:
    estimate = identify(SMALL, two_mass_records(late={"q_c": samples}))
    said = " ".join(one.sentence for one in estimate.checks.advice)
    assert f"q_c is {word} by" in said
    assert_truth_inside(estimate, TRUTH)


@pytest.mark.slow
def test_a_zero_of_a_stretch_is_its_records() -> None:
    zeros = [zero_effect("q_c", index, 4) for index in (2, 3)]
    (found,) = explain_stretches._of_records(tuple(zeros), [0, 0, 1, 1], 2)
    assert found.name == zero_effect("q_c", 1, 2).name
    estimate = identify(SMALL, two_mass_records(zeros={"q_c": 1e-3}))
    assert "record 3" not in " ".join(one.sentence for one in estimate.checks.advice)
    assert_truth_inside(estimate, TRUTH)


@pytest.mark.slow
def test_of_a_right_model_nothing_is_said() -> None:
    estimate = identify(SMALL, two_mass_records())
    assert not estimate.checks.advice
    assert_truth_inside(estimate, TRUTH)
