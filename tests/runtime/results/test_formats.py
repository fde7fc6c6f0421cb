"""An estimate as LaTeX, Markdown, HTML and DataFrame; records from frames; control and the estimator."""

from __future__ import annotations

import shutil
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.render.writer import generate
from modelgen.runtime.identification.sklearn_estimator import ChainEstimator
from modelgen.runtime.model.control_export import control_system
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.dataframe import record_from_frame
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, load_spec

TRUE = load_spec(catalog_path("emps300")).parameter_sets["light"]


@pytest.fixture(scope="module")
def model() -> Model:
    return model_from_text(generate(load_spec(catalog_path("emps300")), "qm_ac"), "emps300_qm_ac")


@pytest.fixture(scope="module")
def records(model: Model) -> list[Record]:
    noise = {"q_m": 2e-6, "a_c": 0.5, "Gamma_m": 1e-4}
    return [
        simulate(model, TRUE, kind, fs=5000.0, duration_s=3.0, noise=noise, seed=seed).record
        for seed, kind in enumerate(("chirp", "chirp", "trapezoid"))
    ]


@pytest.fixture(scope="module")
def fitted(model: Model, records: list[Record]) -> ChainEstimator:
    return ChainEstimator(model).fit([records[0], records[2]])


@pytest.fixture(scope="module")
def estimate(fitted: ChainEstimator) -> Estimate:
    return fitted.estimate_


@pytest.mark.slow
def test_latex(estimate: Estimate) -> None:
    text = estimate.to_latex()
    assert text.count(r"\\") == 1 + len(estimate.parameters.identified)
    assert r"$J_{\mathrm{m}}$ & kg m$^{2}$ & $9.9" in text
    assert r"\cdot 10^{-6}$" in text
    # underscores of names stand in indices only, and none is bare
    assert "F_vm" not in text


def test_latex_compiles_where_latex_is(estimate: Estimate, tmp_path: Any) -> None:
    import subprocess

    latex = shutil.which("pdflatex")
    if latex is None:
        pytest.skip("pdflatex is not installed")
    body = r"\documentclass{article}\usepackage{booktabs}\begin{document}" + estimate.to_latex()
    (tmp_path / "a.tex").write_text(body + r"\end{document}", encoding="utf-8")
    subprocess.run([latex, "-interaction=nonstopmode", "a.tex"], cwd=tmp_path, check=True, timeout=60)


def test_markdown(estimate: Estimate) -> None:
    lines = estimate.to_markdown().splitlines()
    assert len(lines) == 2 + len(estimate.parameters.identified)
    assert {line.count("|") for line in lines} == {8}
    assert lines[2].startswith(r"| J\_m | kg m^2 | 9.9")


def test_html_for_notebooks_is_a_table_and_escapes(estimate: Estimate) -> None:
    from dataclasses import replace

    model = replace(estimate.model, chain="<script>")
    parameters = replace(estimate.parameters, not_identifiable={"<b>": "<i>"})
    text = replace(estimate, model=model, parameters=parameters)._repr_html_()
    tags: list[str] = []

    class Tags(HTMLParser):
        def handle_starttag(self, tag: str, attributes: Any) -> None:
            tags.append(tag)

    Tags().feed(text)
    assert tags.count("tr") == 1 + len(estimate.parameters.identified)
    assert not {"script", "b", "i"} & set(tags)


def test_data_frame(estimate: Estimate) -> None:
    pytest.importorskip("pandas")
    frame = estimate.to_dataframe()
    assert list(frame.index) == list(estimate.params)
    assert frame.loc["K", "value"] == estimate.params["K"]
    assert frame.loc["K", "unit"] == "N m/rad"
    assert tuple(frame.loc["K", ["conf_low", "conf_high"]]) == estimate.conf_int()["K"]


@pytest.mark.parametrize("timing", ["column", "index", "stamps", "fs"])
def test_record_from_a_frame(timing: str) -> None:
    pandas = pytest.importorskip("pandas")
    n = 50
    t = np.arange(n) / 1000.0
    frame = pandas.DataFrame({"theta [deg]": np.sin(t), "F": np.cos(t)})
    if timing == "column":
        frame["t [ms]"] = 1e3 * t
    elif timing == "index":
        frame.index = pandas.Index(t, name="time")
    elif timing == "stamps":
        frame.index = pandas.to_datetime(1_700_000_000_000_000_000 + (t * 1e9).round().astype("int64"))
    record = record_from_frame(
        frame, {"q": "theta", "Gamma": "-F"}, fs=1000.0 if timing == "fs" else None, name="a", tag="b"
    )
    assert (record.fs, record.name, record.tag) == (1000.0, "a", "b")
    np.testing.assert_allclose(record.signals["q"], np.radians(np.sin(t)))
    np.testing.assert_array_equal(record.signals["Gamma"], -np.cos(t))


def test_state_space_for_control(model: Model) -> None:
    pytest.importorskip("control")
    system = control_system(model, TRUE)
    assert (system.input_labels, system.output_labels) == (["Gamma_m"], ["q_m", "a_c"])
    assert system.state_labels == ["q_m", "q_c", "v_m", "v_c"]
    space = model.state_space(TRUE)
    np.testing.assert_array_equal(system.A, space.A)
    with_friction = control_system(model, TRUE, friction_inputs=True)
    assert with_friction.input_labels == ["Gamma_m", "friction_m"]
    np.testing.assert_array_equal(with_friction.B, np.hstack((space.B, space.E)))
    with pytest.raises(DataError, match="lack J_m, F_vm, J_c, F_vmc, K"):
        control_system(model, {})


def test_estimator_keeps_its_parameters(model: Model) -> None:
    estimator = ChainEstimator(model, cutoff_hz=200.0)
    copy = ChainEstimator(**estimator.get_params())
    assert copy.get_params() == estimator.get_params()
    assert copy.set_params(method="pham2002").get_params()["method"] == "pham2002"
    with pytest.raises(DataError, match=r"has no parameter cutof_hz; did you mean cutoff_hz\?"):
        copy.set_params(cutof_hz=1.0)
    with pytest.raises(DataError, match="is not fitted; call fit"):
        copy.predict(Record({"q_m": [0.0, 1.0]}, 1.0))


def test_estimator_predicts_what_it_has_not_seen(fitted: ChainEstimator, records: list[Record]) -> None:
    assert fitted.coef_[-1] == pytest.approx(TRUE["K"], rel=0.01)
    assert fitted.score(records[1]) > 0.999
    assert fitted.predict(records[1]).size == sum(Y.size for Y, _ in fitted._rows(records[1]))


def test_scikit_learn_clones_it_where_it_is(model: Model) -> None:
    base = pytest.importorskip("sklearn.base")
    assert base.clone(ChainEstimator(model, decimation=3)).decimation == 3
