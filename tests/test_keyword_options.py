"""Functions with a table of keyword options: every option counts, and an unknown one is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypedDict

import pytest

from modelgen.keyword_options import with_defaults
from modelgen.runtime.planning.optimal_excitation import optimise
from modelgen.runtime.records.read_record import read, read_record
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.excitation import chirp
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.simulation.validate import validate


class Table(TypedDict, total=False):
    a: int
    b: int | None


def test_options_replace_defaults_and_only_them() -> None:
    defaults = Table(a=1)
    assert with_defaults("f", Table(b=2), Table, defaults) == {"a": 1, "b": 2}
    assert with_defaults("f", Table(), Table, defaults) == {"a": 1, "b": None}
    assert defaults == {"a": 1}


@pytest.mark.parametrize(
    ("function", "count"),
    [
        (read_record, 1),
        (read, 1),
        (simulate, 2),
        (default_excitation, 3),
        (chirp, 4),
        (validate, 4),
        (optimise, 3),
    ],
)
def test_an_unknown_option_is_refused_as_python_does(function: Callable[..., Any], count: int) -> None:
    message = rf"{function.__name__}\(\) got an unexpected keyword argument 'misspelt'"
    with pytest.raises(TypeError, match=message):
        function(*[None] * count, misspelt=1)
