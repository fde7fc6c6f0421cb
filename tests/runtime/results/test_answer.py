"""The short answer: about ten lines, 80 columns, whatever the names, numbers and reasons are."""

from __future__ import annotations

from dataclasses import replace

import pytest

from modelgen.runtime.modes.find_modes import modes_at
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.results.answer import answer_html, answer_text
from tests.runtime.results.test_verdict import sound
from tests.runtime.two_mass_records import SMALL, TRUTH

GOLDEN = """\
axis, sensors s, records chirp
  J  0.002000 +- 0.000039 kg m^2 (95 %)
  F  0.04000 +- 0.00078 N m s/rad (95 %)
  K  15150 +- 300 N m/rad (95 %)
  mode: free motion, time constant 0.5301 s
  mode: 123.6 Hz (776.5 rad/s), damping ratio 0.03998
  antiresonance of Gamma_m: 119.6 Hz
Verdict: trust - the residual is no more than noise, no interval is wider than
  20 % of the value either way.
"""


def test_everything_is_said_in_ten_lines() -> None:
    estimate = replace(sound(), modal=modes_at(SMALL, TRUTH))
    assert answer_text(estimate) == GOLDEN
    assert str(estimate) == estimate.answer() == GOLDEN
    assert "<strong>Trust:</strong>" in estimate._repr_html_()
    assert "<details>" in estimate._repr_html_()


@pytest.mark.parametrize("count", [1, 8, 9, 10, 40])
def test_no_line_is_longer_than_a_terminal(count: int) -> None:
    name = "x" * 200
    entries = tuple(
        Parameter(f"K_{i}" if count < 40 else f"{name}{i}", "N m/rad", 1.0 + i, 0.1, 0.0, 0.0, 0.0)
        for i in range(count)
    )
    reasons = {f"S_{i}": "no motion at constant speed " * 9 for i in range(count)}
    whole = sound()
    parameters = replace(whole.parameters, identified=entries, physical=entries, not_identifiable=reasons)
    text = answer_text(replace(whole, parameters=parameters, records=(name, "\x1b[2J", name)))
    assert max(map(len, text.splitlines())) <= 80
    assert text.count("No number for") == 1
    assert [text.count(f" K_{i} ") for i in range(count)] == [int(count < 40)] * count
    assert text.isascii()
    assert text.replace("\n", "").isprintable()
    if count == 9:
        assert "K_0 1.00 +- 0.20 N m/rad K_5 6.00 +- 0.20 N m/rad" in " ".join(text.split())


def test_composites_that_numbers_stand_for_share_a_line() -> None:
    whole = sound()
    ones = tuple(Parameter(f"C{i}", "N", 1.0, 0.1, 0.0, 0.0, 0.0) for i in (7, 8, 9))
    short = Parameter("F/K", "s", 1.0, 0.1, 0.0, 0.0, 0.0)
    formulas = {**{one.name: "F*K + F^2/K" for one in ones}, "F/K": "F/K"}
    physical = tuple(entry for entry in whole.parameters.physical if entry.name != "F")
    found = replace(
        whole.parameters,
        physical=physical,
        identified=(*physical, short, *ones),
        not_identifiable={"F": "too uncertain"},
    )
    open_friction = replace(whole, parameters=found, model=replace(whole.model, composites=formulas))
    text = answer_text(open_friction)
    assert "F/K 1.00 +- 0.20 s" in " ".join(text.split())
    assert "and 3 composites of long formulas (C7 to C9): --details" in text
    assert "composites of long formulas (C7 to C9)" in answer_html(open_friction)
    assert text.count("C8") == 0
    # where they are all that is known, they are told
    alone = replace(open_friction, parameters=replace(found, physical=(), identified=ones))
    assert answer_text(alone).count("1.00 +- 0.20 N") == 3


def test_reasons_of_one_kind_share_a_line() -> None:
    whole = sound()
    reasons = {
        "F_a": "no constant-velocity motion of a in record one: 3 % of its power",
        "F_b": "no constant-velocity motion of b in record one: 40 % of its power",
        "K_a": "its standard deviation is 46.8 % of its value",
        "S": "its standard deviation is 46.8 % of its value",
        "J_a": "its standard deviation is 2e+03 % of its value",
        "D": "cannot be distinguished from M (W is short of rank)",
    }
    text = answer_text(replace(whole, parameters=replace(whole.parameters, not_identifiable=reasons)))
    said = " ".join(text.split())
    assert text.count("No number for") == 3
    assert "No number for D: cannot be distinguished from M" in said
    assert "No number for F_a (F_b likewise): no constant-velocity motion of a in record one: 3 %" in said
    assert "No number for K_a, S (J_a likewise): its standard deviation is 46.8 % of its value" in said


def test_a_long_reason_ends_between_words() -> None:
    whole = sound()
    why = (
        "cannot be distinguished (condition index 37; known is " + "J - 0.0027 F = 0.000795 +- 0.000013, " * 9
    )
    text = answer_text(replace(whole, parameters=replace(whole.parameters, not_identifiable={"S": why})))
    said = " ".join(text.partition("No number")[2].partition("Verdict")[0].split())
    shown = said.removeprefix("for S: ").removesuffix(" ...")
    assert shown != said and why.startswith(f"{shown} ")


def test_no_text_is_markup() -> None:
    whole = sound()
    evil = {"<script>": "<b>because</b>"}
    told = answer_html(replace(whole, parameters=replace(whole.parameters, not_identifiable=evil)))
    assert "<script>" not in told
    assert "<b>because" not in told
