"""Methods, filters and checks as values: the same as by name, each mistake named."""

from __future__ import annotations

import inspect
import pickle
from dataclasses import fields
from typing import Any

import pytest

import modelgen
from generated import emps300_qm_qc
from modelgen import IV, TLS, WLS, CheckOptions, Filters, Pham2002, Record
from modelgen.errors import DataError
from modelgen.runtime.identification.methods import METHODS, Method
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.simulation.simulate import simulate

Case = tuple[Model, list[Record]]
QUICK = CheckOptions(drift_check=False)


@pytest.fixture(scope="module")
def case() -> Case:
    model = model_from_module(emps300_qm_qc)
    truth = model.parameter_sets["table_2"]
    return model, [
        simulate(model, truth, kind, duration_s=2.0, noise={"Gamma_m": 1e-4}, oversample=4, seed=1).record
        for kind in ("chirp", "trapezoid")
    ]


@pytest.mark.parametrize("method", [WLS(), IV(), TLS(), Pham2002()], ids=lambda method: str(method.name))
def test_a_method_by_name_is_the_value_without_options(case: Case, method: Method) -> None:
    model, records = case
    by_value = modelgen.identify(model, records, method, Filters(cutoff_hz=300.0), QUICK)
    by_name = modelgen.identify(model, records, method.name, checks=QUICK, cutoff_hz=300.0)
    assert by_value.to_json() == by_name.to_json()
    assert by_value.fit.method == method.name
    assert METHODS[method.name] is type(method)


def test_options_go_where_they_belong() -> None:
    flat: dict[str, Any] = {
        "cutoff_hz": 300.0, "drop": 5, "keep": ["K"], "robust": "huber", "delays": "none", "progress": print
    }  # fmt: skip
    found = values_of("iv", **flat)
    assert found == {
        "method": IV(delays="none", robust="huber"),
        "filters": Filters(cutoff_hz=300.0, drop=5),
        "checks": CheckOptions(keep=["K"]),
        "progress": print,
    }
    # an option has one home: none of a method's, a filter's and a check's share a name
    names = [one.name for value in (IV, Filters, CheckOptions) for one in fields(value)]
    assert len(names) == len(set(names))
    assert pickle.loads(pickle.dumps(found["method"])) == found["method"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "ols"}, "method: is 'ols'; choose one of auto, wls, iv, tls, pham2002"),
        ({"method": WLS}, "method: is <class"),
        ({"method": None}, "method: is None"),
        ({"cutoff_hz": 300.0, "filters": Filters(cutoff_hz=200.0)}, "cutoff_hz: is given in filters as well"),
        ({"decimation": 4, "filters": Filters(decimation=5)}, "decimation: is given in filters as well"),
        ({"method": TLS(robust="huber")}, "robust: does not go with method tls"),
        ({"method": Pham2002(bounds="physical")}, "bounds: does not go with method pham2002"),
        ({"method": WLS(robust="tukey")}, "robust: is 'tukey'"),
        ({"method": WLS(residual_dof="n")}, "residual_dof: is 'n'"),
        ({"method": WLS(rows_for_tag="paper")}, "rows_for_tag: is 'paper'"),
        ({"filters": Filters(drop=-1)}, "drop: is -1"),
        ({"checks": CheckOptions(prune_percent=0.0)}, "prune_percent: is 0.0"),
        ({"filters": {"cutoff_hz": 9.0}}, "filters: is of the type dict; give a modelgen.Filters"),
        ({"checks": {"tests": False}}, "checks: is of the type dict; give a modelgen.CheckOptions"),
        ({"cutoff_hz": "300"}, "cutoff_hz: is '300'; give a frequency"),
    ],
    ids=str,
)
def test_every_mistake_is_named(case: Case, options: dict[str, Any], message: str) -> None:
    model, records = case
    with pytest.raises(DataError) as caught:
        modelgen.identify(model, records, **options)
    assert str(caught.value).startswith(message)


def test_mistakes_of_several_options_are_said_together(case: Case) -> None:
    model, records = case
    with pytest.raises(DataError) as caught:
        modelgen.identify(
            model, records, WLS(residual_dof="n"), Filters(drop=-1), CheckOptions(prune_percent=-1.0)
        )
    assert len(caught.value.problems) == 3


def test_identify_is_a_page() -> None:
    source = inspect.getsource(modelgen.identify)
    body = source.split('"""')[2].strip().splitlines()
    assert len(body) <= 40
    assert len(inspect.signature(modelgen.identify).parameters) <= 8
