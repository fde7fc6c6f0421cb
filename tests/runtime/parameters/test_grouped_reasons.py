from __future__ import annotations

from modelgen.runtime.parameters.grouped_reasons import grouped_reasons, reasons_of_parameters

REASONS = {
    "J": "J and K cannot be distinguished in these records (condition index 90)",
    "F_a": "no motion of a in record one: 3 %",
    "K": "J and K cannot be distinguished in these records (condition index 90)",
    "F_b": "no motion of b in record one: 40 %",
}


def test_each_reason_is_said_once() -> None:
    found = grouped_reasons(REASONS)

    assert [one.who for one in found] == ["J, K", "F_a (F_b likewise)"]
    assert [one.why for one in found] == [REASONS["J"], REASONS["F_a"]]


def test_composites_are_told_by_the_parameters_of_the_spec() -> None:
    apart, late = (
        "J_a, J_b cannot be distinguished in these records",
        "cannot be distinguished from the delay of T",
    )
    reasons = {
        "J_a": apart,
        "C1": late,
        "F_b/K": late,
        "J_b": "depends on J_a, C1, which the records cannot answer",
        "K": "its standard deviation is 90 % of its value",
        "O_a + O_b": "never seen",
    }
    found = reasons_of_parameters(reasons, {"C1": "J_a*J_b/K"}, ("J_a", "F_a", "J_b", "F_b", "K"), {"F_a"})
    assert found == {
        "O_a + O_b": "never seen",
        "J_a": apart,
        "J_b": late,
        "F_b": late,
        "K": "its standard deviation is 90 % of its value",
    }
    assert "K" not in reasons_of_parameters(reasons, {}, ("K",), {"K"})
    assert reasons_of_parameters({"J + M": "why"}, {}, ()) == {"J + M": "why"}
