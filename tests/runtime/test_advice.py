"""Advice: what is said as a note, and what as a warning."""

from __future__ import annotations

from modelgen.runtime.advice import ROWS_OWN, Advice, noted


def test_what_may_be_the_rows_own_is_a_note() -> None:
    own = Advice(ROWS_OWN, "the residual", "shows that the direction of m changes late", "reverse less often")
    other = Advice("unit", "q_m", "is in degrees", "convert it")
    warnings, notes = noted((own, other))
    assert warnings == (other,)
    assert notes == (
        f"{ROWS_OWN}, where directions are those of a low-passed velocity, {own.where} {own.what}",
    )
    assert noted(()) == ((), ())
