from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from modelgen.errors import DataError, ModelgenError
from modelgen.runtime.comparison.sensor_set_comparison import consistency
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.results.estimate_file import checked_estimate
from modelgen.runtime.results.saved_estimate import LATER
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.simulation.validate import parameters_of
from tests.fuzz.test_specs import ANYTHING, check_lines

SETS = ("emps300_qm_qc", "emps300_qm_ac", "emps_rigid_asymmetric_qm", "tree_mixed")
FIRST = "emps300_qm_qc"


def estimates(title: str) -> Iterator[Estimate]:
    """Estimates of a chain by every method, with every check that can be asked for."""
    from importlib import import_module

    from modelgen.runtime.identification.options import CheckOptions

    model = model_from_module(import_module(f"generated.{title}"))
    values = next(iter(model.parameter_sets.values()))
    noise = {sensor.key: 1e-6 for sensor in model.sensors}
    records = [
        simulate(model, values, kind, fs=2000.0, duration_s=1.0, noise=noise).record
        for kind in ("chirp", "trapezoid")
    ]
    for method in ("wls", "iv", "pham2002"):
        checks = CheckOptions(scan_cutoffs="auto", hold_out=0.3) if method == "wls" else None
        try:
            yield identify(model, records, method, checks=checks)
        except ModelgenError:
            continue  # what these short records do not answer by this method


@pytest.fixture(scope="session")
def saved() -> dict[str, Any]:
    """The document of an estimate with a scan and held-out parts."""
    return next(estimates(FIRST)).to_dict()


def public(estimate: Estimate) -> list[Any]:
    mappings = (
        estimate.params,
        estimate.bse,
        estimate.relative_std,
        estimate.physical,
        estimate.conf_int(),
        estimate.conf_int(0.01),
        estimate.delays,
        estimate.delay_std,
        estimate.not_identifiable,
        estimate.parameters.nuisance,
        estimate.model.composites,
    )
    return [
        *(repr(list(one.items())) for one in mappings),
        *(repr(estimate.cov_params(kind).tolist()) for kind in (None, "noise", "printed")),
        estimate.checks,
        estimate.parameters.physical,
        estimate.parameters.other_solutions,
        estimate.nobs,
        estimate.condition_number,
        estimate.summary(),
        estimate.to_latex(),
        estimate.to_markdown(),
        repr(estimate),
        estimate.to_json(),
    ]


@pytest.mark.slow
@pytest.mark.parametrize("title", SETS)
def test_all_public_values_come_back_to_the_bit(title: str) -> None:
    found = list(estimates(title))
    assert found
    for estimate in found:
        back = Estimate.from_json(estimate.to_json())
        for given_value, read_value in zip(public(estimate), public(back), strict=True):
            assert repr(given_value) == repr(read_value)  # NaN equals itself here, and 1 not 1.0
        with pytest.raises(DataError, match="resid: was not kept"):
            assert back.resid


def test_a_file(tmp_path: Path, saved: dict[str, Any]) -> None:
    estimate = Estimate.from_dict(saved)
    estimate.save(tmp_path / "e.json")
    with pytest.raises(ModelgenError, match="exists already"):
        estimate.save(tmp_path / "e.json")
    estimate.save(tmp_path / "e.json", overwrite=True)
    assert Estimate.load(str(tmp_path / "e.json")).to_json() == estimate.to_json()
    with pytest.raises(DataError, match="no_such"):
        Estimate.load(tmp_path / "no_such.json")


def test_what_takes_estimates_takes_one_from_a_file(saved: dict[str, Any]) -> None:
    estimate = Estimate.from_dict(saved)
    (one,) = consistency({"a": estimate, "b": estimate})
    assert one.consistent
    model = model_from_module(__import__(f"generated.{FIRST}", fromlist=["x"]))
    assert parameters_of(estimate, model) == dict(estimate.physical)


def test_documents_of_before_load(saved: dict[str, Any]) -> None:
    old = {key: value for key, value in saved.items() if key not in LATER}
    back = Estimate.from_dict(old)
    assert back.params == saved["params"]
    assert back.fit.method_title == back.fit.method
    assert np.isnan(back.cov_params("noise")).all()
    assert {key: value for key, value in back.to_dict().items() if key not in LATER} == old
    assert back.summary()


@pytest.mark.parametrize(
    ("key", "place"),
    [
        ("params", ("params", 0)),
        ("bse", ("bse", 0)),
        ("relative_std", ("relative_std", 0)),
        ("conf_int_95", ("conf_int_95", 0)),
        ("cov_params", ("cov_params", 0)),
        ("nobs", ("nobs",)),
        ("units", ("units", 0)),
    ],
)
def test_a_number_changed_by_hand_is_found(saved: dict[str, Any], key: str, place: tuple[Any, ...]) -> None:
    document = copy.deepcopy(saved)
    if key == "nobs":
        document["nobs"] += 1
    elif key == "units":
        del document["units"]["J_m"]
    elif key == "cov_params":
        document[key][0][0] *= 1.01
    elif key == "conf_int_95":
        document[key]["J_m"][1] *= 1.01
    else:
        document[key]["J_m"] *= 1.01
    with pytest.raises(DataError, match=r"e\.json: .*does not agree with the other numbers"):
        Estimate.from_dict(document, "e.json")


def test_a_key_that_stands_twice_is_refused() -> None:
    with pytest.raises(DataError, match=r"e\.json: holds the key version twice"):
        Estimate.from_json('{"format": "modelgen estimate", "version": 1, "version": 2}', "e.json")


@pytest.mark.parametrize("key", ["bse", "noise_std", "physical_bse", "sigma", "relative_error"])
def test_what_measures_a_size_is_not_negative(saved: dict[str, Any], key: str) -> None:
    document = copy.deepcopy(saved)
    table = isinstance(document[key], dict)
    if table:
        document[key]["J_m"] = -1.0
    else:
        document[key] = -1.0
    place = f"e.json: {key}{'.J_m' if table else ''}: is -1, and cannot be negative"
    with pytest.raises(DataError, match=place):
        checked_estimate(document, "e.json")


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", "null", "[" * 500, '{"format": "modelgen estimate"}', "NaN"]
)
def test_what_is_no_estimate_is_refused(text: str) -> None:
    with pytest.raises(DataError) as caught:
        Estimate.from_json(text, "e.json")
    check_lines(caught.value)


def test_every_missing_key_is_named(saved: dict[str, Any]) -> None:
    for key in saved:
        if key not in LATER:
            with pytest.raises(DataError, match=rf"^e\.json: {key}: is missing"):
                Estimate.from_dict({k: v for k, v in saved.items() if k != key}, "e.json")


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, item in inner for found in [(*path, key), *places(item, (*path, key))]]


@pytest.mark.slow
@settings(max_examples=100, phases=(Phase.generate,))
@given(data=st.data())
def test_anything_anywhere_is_an_estimate_or_explained(saved: dict[str, Any], data: st.DataObject) -> None:
    document = copy.deepcopy(saved)
    *above, key = data.draw(st.sampled_from(places(document)))
    table = document
    for step in above:
        table = table[step]
    table[key] = data.draw(ANYTHING | st.none() | st.floats(-1e3, 1e3))
    text = json.dumps(document)
    try:
        estimate = Estimate.from_json(text, "e.json")
    except DataError as error:
        check_lines(error)
        return
    # the verdict is that of what is there
    assert {**json.loads(estimate.to_json()), "verdict": None} == {**json.loads(text), "verdict": None}
    assert estimate.summary()
    assert estimate.answer()


@pytest.mark.parametrize("key", ["covariance_kind", "residual_dof"])
def test_a_word_of_the_format_that_is_another_one_is_refused(saved: dict[str, Any], key: str) -> None:
    with pytest.raises(DataError, match=key):
        Estimate.from_dict({**saved, key: "r"})


def test_a_correlation_beyond_all_numbers_is_printed(saved: dict[str, Any]) -> None:
    document = copy.deepcopy(saved)
    tested = next(one for one in document["checks"]["residuals"] if one["correlation"])
    tested["correlation"]["value"] = 1e300
    assert "Residual tests" in Estimate.from_dict(document).summary()


def test_infinite_ratios_come_back(saved: dict[str, Any]) -> None:
    estimate = Estimate.from_dict(saved)
    zero = replace(estimate.parameters.identified[0], value=0.0)
    parameters = replace(estimate.parameters, identified=(zero, *estimate.parameters.identified[1:]))
    singular = replace(estimate, parameters=parameters, fit=replace(estimate.fit, condition_number=math.inf))
    back = Estimate.from_json(singular.to_json())
    assert back.relative_std[zero.name] == back.condition_number == math.inf
