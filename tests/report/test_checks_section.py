from __future__ import annotations

import re

from modelgen.report.page import report_page
from modelgen.report.scan_plot import scan_plots
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from tests.runtime.rigid_motion import ONE_WAY, RIGID, SETTINGS, TRUTH, rigid_record


def section(page: str, name: str = "checks") -> str:
    found = re.search(rf'<section id="{name}">(.*?)</section>', page, re.DOTALL)
    assert found is not None
    return found.group(1)


def test_warnings_tests_and_the_scan_are_in_the_report() -> None:
    record = rigid_record()
    estimate = identify(
        RIGID, record, **values_of("wls", scan_cutoffs=[20.0, 60.0], bounds="physical", **SETTINGS)
    )
    page = report_page(RIGID, [record], estimate)
    assert "No warning" in section(page, "answer")
    # what the verdict says is no contradiction of it
    assert ("no more than noise" in section(page, "answer")) == (estimate.verdict.word == "trust")
    found = section(page)
    for title in ("Residual tests", "Physical bounds", "Scan of the filter"):
        assert f"<h3>{title}</h3>" in found
    # a curve for every parameter, over three cut-offs with their intervals
    assert found.count("<svg") == len(TRUTH)
    for plot in scan_plots(estimate.checks.scan):
        values, bars = re.findall(r'class="line (?:measured|residual)" d="([^"]+)"', plot)[::-1]
        assert len(re.findall(r"[ML]", values)) == 3
        assert bars.count("M") == 3


def test_a_warning_is_printed_with_its_remedy() -> None:
    record = rigid_record(ONE_WAY[1.0])
    estimate = identify(RIGID, record, **values_of(**SETTINGS))
    found = section(report_page(RIGID, [record], estimate), "answer")
    assert '<p class="verdict measure-again"><strong>Measure again:</strong>' in found
    assert "<strong>dependent columns</strong>: Fc and offset move together" in found.replace(
        "offset and Fc move", "Fc and offset move"
    )
    assert "Give one of them as known" in found
    assert scan_plots(None) == []


def test_without_a_scan_or_with_one_point_there_is_no_plot() -> None:
    estimate = identify(RIGID, rigid_record(n=3000), **values_of(scan_cutoffs=[2.0], **SETTINGS))
    assert scan_plots(estimate.checks.scan) == []


def test_records_held_out_are_told_of_but_not_drawn() -> None:
    records = [rigid_record(name="two", seed=1), rigid_record(name="one")]
    estimate = identify(RIGID, records, **values_of(hold_out="two", **SETTINGS))
    page = report_page(RIGID, records, estimate)
    assert "<h3>Held-out records</h3>" in section(page)
    assert "one, row m" in page
    assert "two, row m" not in page
