"""No mutant of a module that is accepted without trust does more than arithmetic, whatever was put into it.

A run tries some hundreds, the same ones each time; with MODELGEN_FUZZ=nightly until 20,000 are accepted.
"""

from __future__ import annotations

import ast
import sys
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from modelgen.errors import DataError
from modelgen.generated_module.module_check import module_problems
from modelgen.runtime.model.model import Model, model_from_text
from tests.fuzz.test_specs import NIGHTLY
from tests.security.module_mutants import PAYLOADS, TEXTS, mutants, payload_tree

TRIED, ACCEPTED = (70_000, 20_000) if NIGHTLY else (400, 130)
MOST_S = 5.0
DEPRECATED = {"Num", "Str", "Bytes", "NameConstant", "Ellipsis", "Index", "ExtSlice", "Suite", "AugLoad"}
#: stands in no text of Python that is parsed as a module
NO_SOURCE = {"AugStore", "Param", "Interactive", "Expression", "FunctionType", "TypeIgnore"}


def test_payloads_hold_every_node_of_the_grammar() -> None:
    held = {type(node) for payload in PAYLOADS for node in ast.walk(payload_tree(payload))}
    grammar = {
        kind
        for kind in vars(ast).values()
        if isinstance(kind, type) and issubclass(kind, ast.AST) and kind.__module__ in ("ast", "_ast")
    }
    concrete = {
        kind
        for kind in grammar
        if not any(kind is not other and issubclass(other, kind) for other in grammar)
    }
    assert {kind.__name__ for kind in concrete - held} <= DEPRECATED | NO_SOURCE


@pytest.mark.parametrize("text", TEXTS)
def test_the_modules_that_are_changed_are_good(text: str) -> None:
    use(model_from_text(text))


@pytest.mark.slow
def test_no_accepted_mutant_does_harm() -> None:
    accepted: set[str] = set()

    @settings(
        max_examples=TRIED,
        suppress_health_check=list(HealthCheck),
    )
    @given(mutants())
    def one(text: str) -> None:
        start = time.process_time()
        problems = module_problems(text)
        assert time.process_time() - start < MOST_S
        assert all(p.where.startswith(("line ", "header")) and p.what and p.remedy for p in problems)
        assert str(problems).isprintable()
        if problems:
            return
        accepted.add(text)
        before = set(sys.modules)
        try:
            use(model_from_text(text))
        except DataError as error:
            assert str(error)
        for name in set(sys.modules) - before:
            del sys.modules[name]

    one()
    print(f"{len(accepted)} accepted modules, all of them harmless")
    assert len(accepted) >= ACCEPTED


def use(model: Model) -> None:
    """Call every function of a model."""
    signals = {signal.key: np.linspace(-1.0, 1.0, 5) for signal in model.signals}
    values = {**model.known, **dict.fromkeys(model.parameters, 0.5)}
    with np.errstate(all="ignore"):
        assert model.regressor(signals).shape == (5, len(model.rows), len(model.base_parameters))
        assert model.measurement(signals).shape == (5, len(model.rows))
        for directions in (None, {friction.body: -1 for friction in model.friction}):
            try:
                base = model.base_from_physical(values)
                assert model.base_jacobian(values).shape == (len(base), len(model.parameters))
                model.state_space(values, directions)
                model.physical_from_base(base)
            except ArithmeticError:
                pass  # such as a denominator that the change has made zero
