"""Payloads of an arm's file: what they become, and every mistake with its place."""

from __future__ import annotations

import pytest

from modelgen.errors import SpecError
from modelgen.spec.arms.load import parse_arm
from modelgen.spec.arms.parameters import arm_parameters

JOINTS = '[arm]\nname = "a"\n[[joints]]\nname = "1"\n[[joints]]\nname = "2"\nalpha = 90\n'


def test_a_payload_has_ten_parameters_and_the_mass_that_it_was_weighed_with() -> None:
    spec = parse_arm(f'{JOINTS}[payload.disc]\nmass = "9.2/2"\n[payload.tool]\njoint = "1"\n', "a.toml")
    assert [(one.name, one.joint) for one in spec.payloads] == [("disc", "2"), ("tool", "1")]
    assert spec.known == {"m_disc": 4.6}
    own = [one for one in arm_parameters(spec) if one.payload]
    assert len(own) == 20 and own[0].name == "Ixx_disc"
    assert {one.joint for one in own} == {"1", "2"}


MISTAKES = [
    ("[payload]\n", "payload", "is empty"),
    ('[payload."a b"]\n', 'payload."a b"', "no name of a payload"),
    ("[payload.2]\n", "payload.2", "name of a joint"),
    ('[payload.disc]\njoint = "7"\n', "payload.disc.joint", "is not a joint"),
    ("[payload.disc]\nmass = 0\n", "payload.disc.mass", "more than 0 kg"),
    ("[payload.disc]\nmass = -1\n", "payload.disc.mass", "more than 0 kg"),
    ("[payload.disc]\nmass = 1\n[known]\nm_disc = 1\n", "payload.disc.mass", "as well"),
    ('[payload.disc]\nmass = "heavy"\n', "payload.disc.mass", "heavy"),
    ("[payload.disc]\nweight = 1\n", "payload.disc.weight", ""),
    ("[payload.disc]\n[known]\nm_disk = 1\n", "known.m_disk", "m_disc"),
]


@pytest.mark.parametrize(("text", "place", "what"), MISTAKES)
def test_mistakes_are_told_by_their_place(text: str, place: str, what: str) -> None:
    with pytest.raises(SpecError) as raised:
        parse_arm(JOINTS + text, "a.toml")
    (problem,) = raised.value.problems
    assert problem.where.endswith(place)
    assert what in f"{problem.what} {problem.remedy}"
