"""One word by class: no kind of advice and no gap in what was tested leaves it at trust."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modelgen
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.residual_tests import ResidualTest
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.modes.modes import Modes
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.parameters.pruning import Pruning
from modelgen.runtime.results.checks import Checks
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.results.estimate_parts import EstimatedFit, EstimatedModel, EstimatedParameters
from modelgen.runtime.results.verdict import AGAIN, CHECK, DATA, KINDS, NEGLIGIBLE, TRUST, verdict

TESTED = ResidualTest("chirp", "m", 3.0, 9.0, None, None)


def sound(percent: float = 1.0) -> Estimate:
    """An estimate that nothing speaks against."""
    entries = tuple(
        Parameter(name, unit, value, 0.01 * percent * value, 0.0, 0.0, 0.0)
        for name, unit, value in (("J", "kg m^2", 2e-3), ("F", "N m s/rad", 0.04), ("K", "N m/rad", 15150.0))
    )
    fit = EstimatedFit(
        "iv", "instrumental variables", "hac", FilterChoice(4, 250.0, 172.5, (8,), 172.5, 29.0, (), (), ()),
        (), None, 3.0, 9.0, 0.05, 1.0, 1.0, "r-c", Pruning(10.0, 0.05, (), ()),
    )  # fmt: skip
    roles = {"J": "inertia", "F": "viscous", "K": "stiffness", "S": "coulomb"}
    return Estimate(
        EstimatedModel("axis", "s", "An axis", roles=roles),
        ("chirp",),
        fit,
        Covariances(*(np.eye(3),) * 4),
        EstimatedParameters(entries, entries, np.ones(3), {}, {}),
        Checks(residuals=(TESTED,)),
        Modes(),
    )


def advised(*kinds: str) -> Estimate:
    return replace(
        sound(), checks=Checks(tuple(Advice(k, "J", "is odd", f"mend {k}") for k in kinds), (TESTED,))
    )


def kinds_in_the_source() -> set[str]:
    found = set()
    for path in Path(str(modelgen.__path__[0])).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Advice":
                first = node.args[0]
                found |= {first.value} if isinstance(first, ast.Constant) else set()
    return found


@pytest.mark.slow
def test_every_kind_of_advice_has_its_place() -> None:
    found = kinds_in_the_source()
    assert len(found) > 15
    assert found <= {*KINDS, NEGLIGIBLE}


def test_trust_is_said_where_nothing_speaks_against_it() -> None:
    said = verdict(sound())
    assert (said.word, said.action) == (TRUST, "")
    assert len(said.reasons) == 1


@pytest.mark.parametrize("kind", [*KINDS, "a kind of tomorrow"])
def test_no_kind_of_advice_leaves_it_at_trust(kind: str) -> None:
    said = verdict(advised(kind))
    assert said.word == KINDS.get(kind, CHECK) != TRUST
    assert said.action == f"mend {kind}"
    assert said.reasons == (f"{kind}: J is odd",)


def test_friction_that_is_none_speaks_against_nothing() -> None:
    whole = sound()
    none = tuple(replace(p, value=0.0, std=1e-6) if p.name == "F" else p for p in whole.parameters.physical)
    found = replace(whole, parameters=replace(whole.parameters, identified=none, physical=none))
    assert verdict(found).word == CHECK
    told = Checks(
        (Advice(NEGLIGIBLE, "F", "is zero, to 0.02 % of what row m holds", "leave it out"),), (TESTED,)
    )
    said = verdict(replace(found, checks=told))
    assert (said.word, said.action) == (TRUST, "")
    assert said.reasons[0].endswith("but for what is negligible (F)")


@pytest.mark.parametrize("cause", DATA)
def test_causes_come_before_what_follows_from_them(cause: str) -> None:
    others = [kind for kind in KINDS if kind not in DATA]
    said = verdict(advised(*others, cause))
    assert said.action == f"mend {cause}"
    assert len(said.reasons) == len(others) + 1


def test_what_has_no_number_asks_for_another_measurement() -> None:
    whole = sound()

    def without(why: str, unseen: tuple[str, ...] = ()) -> Estimate:
        return replace(
            whole,
            model=replace(whole.model, unseen=unseen),
            parameters=replace(whole.parameters, not_identifiable={"S": why}),
        )

    said = verdict(without("no constant-velocity motion of m in record chirp"))
    assert (said.word, said.action) == (AGAIN, "add slow motion in both directions")
    assert verdict(without("cannot be distinguished from F in these records")).action.startswith(
        "give one of them"
    )
    assert "set the encoders to zero" in verdict(without("... the encoders' zeros are unrelated")).action
    # what these sensors cannot see is known before any record
    assert verdict(without("drops out of every row", ("S",))).word == TRUST


@pytest.mark.parametrize(
    "untested",
    [
        lambda one: replace(one, checks=Checks()),
        lambda one: replace(one, checks=Checks(residuals=(ResidualTest("c", "m", None, None, None, None),))),
        lambda one: replace(one, fit=replace(one.fit, covariance_kind="printed")),
        lambda one: replace(one, fit=replace(one.fit, notes=("model error: other cut-offs move it",))),
        lambda one: replace(one, parameters=replace(one.parameters, other_solutions=({"J": 1.0},))),
        lambda _: sound(percent=11.0),
    ],
)
def test_what_nothing_has_tested_is_not_trusted(untested: object) -> None:
    said = verdict(untested(sound()))  # type: ignore[operator]
    assert said.word == CHECK
    assert said.action


def test_the_widest_interval_is_named_with_what_narrows_it() -> None:
    whole = sound()
    wide = tuple(replace(p, std=0.3 * p.value if p.name == "F" else p.std) for p in whole.parameters.physical)
    said = verdict(replace(whole, parameters=replace(whole.parameters, identified=wide, physical=wide)))
    assert said.reasons == ("F is known to +-59 % only",)
    assert said.action == "add stretches of different constant speeds"
