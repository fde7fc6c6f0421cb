"""Generated modules become models; whatever violates the contract is named."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from generated import emps300_qm_ac
from modelgen.errors import DataError
from modelgen.generated_module.module_check import seal
from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.model.model import Model, load_model, model_from_module, model_from_text
from tests.runtime.made_arm_records import catalogued, model_of


@pytest.fixture
def text(repo_root: Path) -> str:
    return (repo_root / "generated" / "emps300_qm_ac.py").read_text(encoding="utf-8")


def changed(**names: Any) -> SimpleNamespace:
    """Return the example module with some of its names replaced."""
    return SimpleNamespace(**{**vars(emps300_qm_ac), **names})


def with_entry(table: str, index: int, /, **values: Any) -> SimpleNamespace:
    """Return the example module with one entry of a table changed."""
    entries = list(getattr(emps300_qm_ac, table))
    entries[index] = {**entries[index], **values}
    return changed(**{table: tuple(entries)})


def complaint(module: Any) -> str:
    with pytest.raises(DataError) as caught:
        model_from_module(module)
    assert len(caught.value.problems) == 1, str(caught.value)
    return str(caught.value)


def test_model_shows_the_module() -> None:
    model = model_from_module(emps300_qm_ac)
    assert (model.chain, model.sensor_set) == ("emps300", "qm_ac")
    assert [sensor.measures for sensor in model.sensors] == ["position", "acceleration"]
    assert model.actuators[0].key == "Gamma_m"
    assert model.base_parameters == ("J_m", "F_vm", "F_sm", "J_c", "F_vmc", "K")
    assert model.roles["F_vmc"].bodies == ("m", "c")
    assert [row.differentiated for row in model.rows] == [2, 2, 0]
    assert model.friction[0].coulomb_plus == "F_sm"
    assert model.channels == ("q_m", "a_c", "Gamma_m")
    assert model.direction_keys == ("d1_q_m",)
    assert model.measurement_columns == (((1.0, "d2_Gamma_m"),), (), ((1.0, "Gamma_m"),))
    assert model.column_terms(0, 5) == ((1.0, "d2_q_m"), (-1.0, "a_c"))
    assert model.column_terms(1, 0) == ()


def test_model_passes_calls_to_the_module() -> None:
    model = model_from_module(emps300_qm_ac)
    rng = np.random.default_rng(1)
    signals = {signal.key: rng.normal(size=7) for signal in model.signals}
    np.testing.assert_array_equal(model.measurement(signals), emps300_qm_ac.measurement(signals))
    np.testing.assert_array_equal(model.regressor(signals), emps300_qm_ac.regressor(signals))
    physical = {name: float(place) for place, name in enumerate(model.parameters, start=1)}
    base = model.base_from_physical(physical)
    assert model.physical_from_base(list(base)) == physical
    np.testing.assert_array_equal(model.state_space(physical).A, emps300_qm_ac.state_space(physical).A)


def test_mappings_of_a_model_are_read_only() -> None:
    model = model_from_module(emps300_qm_ac)
    with pytest.raises(TypeError):
        model.units["J_m"] = "g"  # type: ignore[index]
    with pytest.raises(TypeError):
        model.regressor_columns[0][3] = ()  # type: ignore[index]


def test_every_generated_module_keeps_the_contract(repo_root: Path) -> None:
    names = sorted(path.stem for path in (repo_root / "generated").glob("[!_]*.py"))
    assert "emps300_qm_ac" in names
    for name in names:
        model = model_from_module(importlib.import_module(f"generated.{name}"))
        assert f"{model.chain}_{model.sensor_set}" == name


@pytest.mark.parametrize(
    ("module", "words"),
    [
        (changed(CONTRACT_VERSION=2), "CONTRACT_VERSION: is 2"),
        (changed(CONTRACT_VERSION=None), "CONTRACT_VERSION: is absent"),
        (changed(CHAIN=None), "CHAIN: is absent"),
        (changed(BASE_PARAMETERS=()), "BASE_PARAMETERS: is not a non-empty tuple"),
        (changed(KNOWN={"g": float("nan")}), "KNOWN: is not a mapping of names to numbers"),
        (changed(ROWS=None), "ROWS: is absent"),
        (changed(SIGNALS=list(emps300_qm_ac.SIGNALS)), "SIGNALS: is not a tuple"),
        (changed(regressor=None), "regressor(): is absent"),
        (with_entry("SENSORS", 1, measures="jerk"), "SENSORS[1]['measures']: is 'jerk', not one of position"),
        (with_entry("SENSORS", 0, colour="red"), "SENSORS[0]['colour']: is unknown"),
        (with_entry("SENSORS", 0, body=None), "SENSORS[0]: needs either a body or a deflection"),
        (with_entry("ROWS", 1, name="m"), "ROWS: use 'm' twice"),
        (with_entry("SIGNALS", 0, derivative=-1), "SIGNALS[0]['derivative']: is -1"),
        (with_entry("SIGNALS", 0, sensor="q_x"), "SIGNALS[0]['sensor']: names 'q_x', which is no sensor"),
        (with_entry("FEATURES", 0, of="d1_q_x"), "FEATURES[0]['of']: names 'd1_q_x', which is no signal"),
        (with_entry("FEATURES", 0, function="forward"), "differs from its entry in FEATURES"),
        (with_entry("ROWS", 0, reversals=("v_m",)), "ROWS[0]['reversals']: names 'v_m'"),
        (with_entry("FRICTION", 0, offset="O_m"), "FRICTION[0]: names 'O_m', which is no parameter"),
        (changed(IDENTIFIABLE=("J_m", "g")), "IDENTIFIABLE: names 'g'"),
        (changed(UNITS={**emps300_qm_ac.UNITS, "K": ""}), "UNITS: is not a mapping of names to strings"),
        (changed(PARAMETER_SETS={"mine": {"J_x": 1.0}}), "PARAMETER_SETS['mine']: names 'J_x'"),
        (changed(IDENTIFIABLE=("J_m",)), "does not return exactly the parameters of IDENTIFIABLE"),
        (changed(features=lambda signals: {}), "features(): does not return exactly the keys of FEATURES"),
        (changed(regressor=lambda signals: signals["q_x"]), "functions: raise KeyError ('q_x')"),
        (changed(base_from_physical=lambda parameters: np.ones(5)), "raise IndexError"),
        (changed(measurement=lambda signals: np.zeros((3, 2))), "measurement(): returns float64 (3, 2)"),
        (changed(columns=lambda: {"regressor": ()}), "columns(): is not a dict of measurement and regressor"),
    ],
    ids=lambda value: value.split(":")[0] if isinstance(value, str) else "",
)
def test_a_violation_is_named(module: SimpleNamespace, words: str) -> None:
    assert words in complaint(module)


def test_the_path_of_a_module_is_no_module() -> None:
    for given in ("axis.py", Path("axis.py")):
        said = complaint(given)
        assert "'axis.py', not a generated module" in said and "modelgen.load_model(path)" in said


def test_columns_that_disagree_with_the_functions_are_named() -> None:
    told = emps300_qm_ac.columns()
    rows = list(told["regressor"])
    rows[2] = {**rows[2], 3: ((-1.0, "a_c"),)}
    module = changed(columns=lambda: {**told, "regressor": tuple(rows)})
    assert "regressor(), row 2, column 3: differs from columns()" in complaint(module)
    rows[2] = {**rows[2], 3: ((1.0, "a_x"),)}
    assert "columns()['regressor'][2][3]: names 'a_x'" in complaint(module)


def test_every_violation_is_reported_at_once() -> None:
    with pytest.raises(DataError) as caught:
        model_from_module(changed(CHAIN="", PARAMETERS=["J_m"], columns=None))
    assert [problem.where.split(": ")[-1] for problem in caught.value.problems] == [
        "CHAIN",
        "PARAMETERS",
        "columns()",
    ]


def test_load_model_from_a_file(tmp_path: Path, text: str) -> None:
    path = tmp_path / "axis.py"
    path.write_text(text, encoding="utf-8")
    search_path = list(sys.path)
    model = load_model(path)
    assert model.base_parameters == emps300_qm_ac.BASE_PARAMETERS
    assert sys.path == search_path
    assert sys.modules[model.module.__name__] is model.module
    assert [entry.name for entry in tmp_path.iterdir()] == ["axis.py"]


def titled(text: str, title: str) -> str:
    line = next(line for line in text.splitlines() if line.startswith("TITLE = "))
    return seal(text.replace(line, f"TITLE = {title!r}"))


def test_files_of_one_name_are_different_modules(tmp_path: Path, text: str) -> None:
    models = []
    for title in ("first", "second"):
        (tmp_path / title).mkdir()
        path = tmp_path / title / "axis.py"
        path.write_text(titled(text, title), encoding="utf-8")
        models.append(load_model(path))
    assert [model.title for model in models] == ["first", "second"]
    assert models[0].module.__name__ != models[1].module.__name__


def test_a_file_that_changed_is_loaded_anew(tmp_path: Path, text: str) -> None:
    path = tmp_path / "axis.py"
    for title in ("one", "two"):  # same size, same second: what a bytecode cache would confuse
        path.write_text(titled(text, title), encoding="utf-8")
        assert load_model(path).title == title


def test_a_model_from_text_in_memory(text: str) -> None:
    assert model_from_text(text, "axis").chain == "emps300"


def test_a_foreign_script_is_not_executed(tmp_path: Path, text: str) -> None:
    trace = tmp_path / "trace"
    path = tmp_path / "script.py"
    path.write_text(f"open({str(trace)!r}, 'w').close()\n", encoding="utf-8")
    with pytest.raises(DataError, match="trust=True"):
        load_model(path)
    assert not trace.exists()
    path.write_text(text.replace("# Generated by modelgen from", "#"), encoding="utf-8")
    with pytest.raises(DataError, match="does not say that modelgen generated"):
        load_model(path)
    assert load_model(path, trust=True).chain == "emps300"


def write(path: Path, content: str) -> Path:
    path.write_text("# some script\n" + content, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda folder: folder / "absent.py", "cannot be read"),
        (lambda folder: write(folder / "model.txt", ""), "is no .py file"),
        (lambda folder: write(folder / "model.py", "x = (\n"), r"line 2: is no valid Python"),
        (lambda folder: write(folder / "model.py", "1 / 0\n"), "raised ZeroDivisionError when imported"),
        (lambda folder: write(folder / "model.py", "raise SystemExit(3)\n"), "raised SystemExit"),
        (lambda folder: write(folder / "model.py", "x = 1\n"), "CONTRACT_VERSION: is absent"),
    ],
    ids=["absent", "suffix", "syntax", "exception", "exit", "other module"],
)
def test_a_bad_file_is_explained(tmp_path: Path, make: Callable[[Path], Path], words: str) -> None:
    path = make(tmp_path)
    before = set(sys.modules)
    with pytest.raises(DataError, match=words) as caught:
        load_model(path, trust=True)
    assert path.name in str(caught.value)
    if "CONTRACT" not in words:
        assert set(sys.modules) == before


def test_a_failed_reload_keeps_the_module_before(tmp_path: Path, text: str) -> None:
    path = tmp_path / "axis.py"
    path.write_text(text, encoding="utf-8")
    model = load_model(path)
    write(path, "1 / 0\n")
    with pytest.raises(DataError):
        load_model(path, trust=True)
    assert sys.modules[model.module.__name__] is model.module


def _first_of(model: Model) -> tuple[str, float]:
    """Return what another process sees of a model."""
    base = model.base_from_physical(dict.fromkeys(model.parameters, 2.0))
    return repr(model), float(base[0])


def test_a_model_goes_to_another_process(repo_root: Path) -> None:
    """From a file, with values that are known, of an arm, and imported as a module."""
    loaded, arm = load_model(repo_root / "generated" / "emps300_qm_ac.py"), model_of(catalogued("two_link"))
    models = [loaded, with_known(loaded, {"K": 15150.0}), arm, model_from_module(emps300_qm_ac)]
    with get_context("spawn").Pool(1) as pool:
        assert pool.map(_first_of, models) == [_first_of(model) for model in models]
