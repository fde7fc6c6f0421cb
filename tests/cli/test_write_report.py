"""The report's and the figure's files: refused before any work, found next to the chain, written whole."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generated import emps_rigid_qm
from modelgen.cli.figure import write_figure
from modelgen.cli.output_files import FIGURES, REPORTS, OutputFiles, check_output
from modelgen.cli.sensor_sets.identified import Identified
from modelgen.cli.write_report import _spec_of, check_inputs, sensor_set_rows
from modelgen.errors import DataError, ModelgenError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import load_model, model_from_module
from modelgen.runtime.records.read_record import Reading
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.spec.load import catalog_path, load_spec, parse_spec

MODEL = model_from_module(emps_rigid_qm)


@pytest.fixture(scope="module")
def readings() -> list[Reading]:
    t = np.arange(6000) / 1000.0
    q = 0.05 * np.sin(2.0 * np.pi * 1.5 * t) + 0.01 * np.sin(2.0 * np.pi * 7.0 * t)
    v = np.gradient(q, t)
    record = Record({"q_m": q, "F": 2.0 * np.gradient(v, t) + 5.0 * v + 3.0 * np.sign(v)}, 1000.0, "run1")
    return [Reading(record, (), (), ())]


@pytest.fixture(scope="module")
def estimate(readings: list[Reading]) -> Estimate:
    return identify(MODEL, [reading.record for reading in readings], **values_of(drift_check=False))


def report(
    path: Path, readings: list[Reading], estimate: Estimate, overwrite: bool = False, **given: Any
) -> str:
    options = {"--method": "wls", "--mend": [], "data": ["run1.csv"]}
    module = Path(str(emps_rigid_qm.__file__))
    arguments: dict[str, Any] = {"spec": None, "controller": None, **given}
    found = Identified({MODEL.sensor_set: MODEL}, readings, estimate)
    OutputFiles(None, path, None, overwrite).write(found, module, options, **arguments)
    return path.read_text(encoding="utf-8")


def test_results_are_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "there.html").write_text("mine", encoding="utf-8")
    with pytest.raises(DataError, match=r"r\.txt: has the suffix '\.txt'; give it \.html or \.htm"):
        check_output(tmp_path / "r.txt", REPORTS, overwrite=True)
    with pytest.raises(DataError, match=r"there\.html: exists already; choose another name, or give --over"):
        check_output(tmp_path / "there.html", REPORTS, overwrite=False)
    check_output(tmp_path / "there.html", REPORTS, overwrite=True)
    check_output(tmp_path / "new.HTML", REPORTS, overwrite=False)
    check_output(tmp_path / "estimate.anything", (), overwrite=False)
    for suffix in FIGURES:
        check_output(tmp_path / f"f{suffix}", FIGURES, overwrite=False)


@pytest.mark.slow
def test_the_report_is_the_same_twice_and_lists_what_was_asked(
    tmp_path: Path, readings: list[Reading], estimate: Estimate
) -> None:
    first = report(tmp_path / "a.html", readings, estimate)
    assert first == report(tmp_path / "b.html", readings, estimate)
    assert "run1.csv" in first and "--method" in first
    assert "--mend" not in first  # an empty list was not asked for
    with pytest.raises(ModelgenError, match="exists already"):
        report(tmp_path / "a.html", readings, estimate)
    assert report(tmp_path / "a.html", readings, estimate, overwrite=True) == first


@pytest.mark.slow
def test_what_cannot_be_made_is_a_sentence_in_its_place(
    tmp_path: Path, readings: list[Reading], estimate: Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A loop cannot be simulated where friction was refused; the rest of the report is as it was."""
    (tmp_path / "loop.toml").write_text("[controller]\nkp = 500.0\nkv = 50.0\n", encoding="utf-8")
    t = np.arange(6000) / 1000.0
    record = readings[0].record
    followed = Record({**record.signals, "reference": 0.05 * np.sin(t)}, record.fs, "run1")
    whole = estimate.parameters
    refused = replace(
        estimate,
        parameters=replace(
            whole,
            identified=tuple(entry for entry in whole.identified if entry.name != "Fc"),
            physical=tuple(entry for entry in whole.physical if entry.name != "Fc"),
            not_identifiable={"Fc": "no constant-velocity motion of m"},
        ),
    )
    page = report(
        tmp_path / "a.html", [Reading(followed, (), (), ())], refused, controller=tmp_path / "loop.toml"
    )
    assert re.search(r"Not made: [^<]*parameters: Fc: is missing", page.replace("\n", " "))
    assert "no constant-velocity motion of m" in page

    def fails(*_: object) -> list[object]:
        raise np.linalg.LinAlgError("singular")

    for section in ("_residuals", "_frequency", "scan_plots", "correlation_plot", "singular_value_plot"):
        with monkeypatch.context() as broken:
            broken.setattr(f"modelgen.report.page.{section}", fails)
            assert "Not made: its numbers fail (singular)." in report(
                tmp_path / "b.html", readings, estimate, overwrite=True
            )


def test_what_a_report_is_made_with_is_read_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "loop.toml").write_text("[controller]\nkp = 1.0\n", encoding="utf-8")
    with pytest.raises(DataError, match="kv"):
        check_inputs(None, tmp_path / "loop.toml", arm=False)
    (tmp_path / "arm.toml").write_text("[controller]\nkp_x = 1.0\n", encoding="utf-8")
    with pytest.raises(DataError, match="kp_x"):
        check_inputs(None, tmp_path / "arm.toml", arm=True)
    with pytest.raises(ModelgenError, match="absent"):
        check_inputs("absent.toml", None, arm=False)


def test_suspicions_stand_in_the_report(tmp_path: Path, readings: list[Reading]) -> None:
    record = readings[0].record
    held = record.signals["q_m"].copy()
    held[2000:2100] = held[2000]
    doubtful = Record({**record.signals, "q_m": held}, record.fs, "run1")
    found = identify(MODEL, doubtful, **values_of(drift_check=False))
    page = report(tmp_path / "a.html", [Reading(doubtful, (), (), ())], found)
    assert "run1, channel q_m, samples 2000 to 2099" in page


def test_the_chain_is_found_by_its_hash_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    module = tmp_path / "generated" / "emps_rigid_qm.py"
    module.parent.mkdir()
    module.write_bytes(Path(str(emps_rigid_qm.__file__)).read_bytes())
    model = load_model(module)
    found = _spec_of(model, module)
    assert found is not None
    assert found.sha256 == model.spec_sha256
    # a changed chain next to it is not taken for it; an unreadable one is passed over
    (tmp_path / "emps_rigid.toml").write_bytes(catalog_path("emps_rigid").read_bytes() + b"# changed\n")
    (tmp_path / "generated" / "emps_rigid.toml").write_text("[chain", encoding="utf-8")
    again = _spec_of(model, module)
    assert again is not None and again.source == "emps_rigid.toml"
    monkeypatch.setattr("modelgen.cli.write_report.catalog_path", lambda name: tmp_path / "none.toml")
    assert _spec_of(model, module) is None


def test_sensor_sets_are_laid_side_by_side() -> None:
    rows = sensor_set_rows(load_spec(catalog_path("emps300")))
    table = {row["name"]: row for row in rows}
    assert table["qm_qc"]["rows"] == "m, c"
    assert table["qm_ac"]["rows"] == "m'', c'', m+c"
    assert table["qm_qc"]["order"] == "2" and table["qm_ac"]["order"] == "4"
    assert table["qm_qc"]["identifiable"] == "J_m, F_vm, F_sm, J_c, F_vmc, K"
    assert {row["lost"] for row in rows} == {"–"}


def test_a_set_that_cannot_be_derived_gives_its_reason() -> None:
    text = catalog_path("emps300").read_text(encoding="utf-8")
    cubic = text.replace('stiffness = "K"', 'stiffness = "K"\nstiffness3 = "K3"')
    assert cubic != text
    (row,) = [row for row in sensor_set_rows(parse_spec(cubic, "e.toml")) if row["name"] == "qm_ac"]
    assert row["rows"] == "none"
    assert "the cubic stiffness K3 needs its link's deflection undifferentiated" in row["identifiable"]


@pytest.mark.parametrize("suffix", FIGURES)
def test_figures_are_written_in_every_format(
    tmp_path: Path, readings: list[Reading], estimate: Estimate, suffix: str
) -> None:
    path = tmp_path / f"f{suffix}"
    found = Identified({MODEL.sensor_set: MODEL}, readings, estimate)
    write_figure(path, found, overwrite=False)
    assert path.stat().st_size > 1000
    with pytest.raises(ModelgenError, match="exists already"):
        write_figure(path, found, overwrite=False)
    with pytest.raises(DataError, match="exists already"):
        OutputFiles(None, None, path, overwrite=False).check()


def test_without_matplotlib_a_figure_says_what_to_install(
    tmp_path: Path, readings: list[Reading], estimate: Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    found = Identified({MODEL.sensor_set: MODEL}, readings, estimate)
    with pytest.raises(DataError, match=r"needs matplotlib.*pip install 'modelgen\[plot\]'"):
        write_figure(tmp_path / "f.png", found, overwrite=False)
    assert list(tmp_path.iterdir()) == []
