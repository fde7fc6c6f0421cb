"""Functions with a table of keyword options: every option counts, and an unknown one is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypedDict

import pytest

from generated import emps300_qm_qc
from modelgen.errors import DataError
from modelgen.keyword_options import with_defaults
from modelgen.runtime.exports.export import export
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.planning.optimal_excitation import optimise
from modelgen.runtime.records.read_record import ReadOptions, read, read_record
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.excitation import chirp
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.simulation.validate import validate

MODEL = model_from_module(emps300_qm_qc)
VALUES = next(iter(MODEL.parameter_sets.values()))


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


def test_a_text_alone_is_one_and_not_its_letters() -> None:
    alone: Any = {"mend": "fill", "needed": "q_m"}
    given = with_defaults("f", alone, ReadOptions, ReadOptions())
    assert (given["mend"], given["needed"], given["time_unit"]) == (("fill",), ("q_m",), None)
    assert with_defaults("f", ReadOptions(time_unit="ms"), ReadOptions, ReadOptions())["time_unit"] == "ms"
    assert (WLS(held="Gamma_m").held, CheckOptions(keep="K").keep) == (("Gamma_m",), ("K",))


def test_what_is_no_mapping_or_no_seed_is_refused_with_its_type() -> None:
    calls: dict[Callable[..., Any], tuple[str, ...]] = {
        simulate: ("chirp",),
        export: ("fmu",),
        with_known: (),
    }
    for call, others in calls.items():
        for wrong in (["K"], None):
            with pytest.raises(DataError, match=r"is of the type (list|NoneType); give a mapping"):
                call(MODEL, wrong, *others)
    seeds: tuple[Any, ...] = (-1, 1.5, "1", True, None)
    for seed in seeds:
        with pytest.raises(DataError, match=r"seed: is .*; give a whole number"):
            simulate(MODEL, VALUES, "chirp", duration_s=1.0, seed=seed)
