from __future__ import annotations

from modelgen.runtime.parameters.grouped_reasons import grouped_reasons

REASONS = {
    "J": "J and K cannot be told apart in these records (condition index 90)",
    "F_a": "no motion of a in record one: 3 %",
    "K": "J and K cannot be told apart in these records (condition index 90)",
    "F_b": "no motion of b in record one: 40 %",
}


def test_each_reason_is_said_once() -> None:
    found = grouped_reasons(REASONS)

    assert [one.who for one in found] == ["J, K", "F_a (F_b likewise)"]
    assert [one.why for one in found] == [REASONS["J"], REASONS["F_a"]]
