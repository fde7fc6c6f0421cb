"""The report of an arm: drawn, its sums spelled out, nothing of what only chains have."""

from __future__ import annotations

from functools import cache

import modelgen
from modelgen.report.arm_drawing import arm_section
from modelgen.report.page import report_page
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm
from tests.runtime.made_arm_records import catalogued, model_of


@cache
def page(drawn: bool) -> str:
    spec = catalogued("two_link")
    model = model_of(spec)
    values = model.parameter_sets["nominal"]
    record = simulate_arm(model, values, noise={"tau_1": 0.05}, duration_s=4.0, fs=250.0).record
    estimate = modelgen.identify(model, record, "wls", checks=modelgen.CheckOptions(tests=False))
    picture = arm_section(spec) if drawn else None
    return report_page(model, [record], estimate, picture=picture)


def test_an_arm_is_drawn_and_its_sums_are_spelled_out() -> None:
    found = page(True)
    assert "<h2>The arm</h2>" in found and '<svg class="chain"' in found
    assert "Izz_1 + Ia_1 + L1**2*m_2" in found
    assert "w<sub>k</sub>(q)" in found


def test_what_only_chains_have_is_left_out() -> None:
    found = page(True)
    for heading in ("Modes", "Frequency response", "Sensor sets side by side"):
        assert f"<h2>{heading}</h2>" not in found
    for anchor in ("#frequency", "#sensors"):
        assert f'href="{anchor}"' not in found


def test_without_the_file_a_sentence_stands_for_the_picture() -> None:
    assert "give it with --spec" in page(False)
