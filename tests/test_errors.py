from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modelgen.errors import listed
from modelgen.runtime.records.record import missing_name
from tests.broken_sentences import hole

NAMES = st.lists(
    st.from_regex(r"[a-z]\w{0,5}", fullmatch=True).filter(lambda name: hole(name) is None), max_size=30
)


@pytest.mark.slow
@given(NAMES)
def test_a_list_of_names_fits_into_a_sentence_whatever_its_length(names: list[str]) -> None:
    assert hole(f"choose from {listed(names)}, or leave it out") is None
    assert hole(str(missing_name("option", "channel", "q_m", names))) is None


@pytest.mark.parametrize(
    "sentence",
    [
        "depends on , which the records cannot answer",
        "Bounds (never negative: ): none is active",
        "leaves to be identified: ",
        "cannot be distinguished from ",
        ", row m: not used",
        "the sensors () of it",
    ],
)
def test_a_hole_is_found(sentence: str) -> None:
    assert hole(sentence) is not None


@pytest.mark.parametrize(
    "sentence",
    ["J_c: 0.5 % of it, at most; more (as given) is no help: stay below 3.", "error (a, b) of 0.5"],
)
def test_a_whole_sentence_is_left_alone(sentence: str) -> None:
    assert hole(sentence) is None
