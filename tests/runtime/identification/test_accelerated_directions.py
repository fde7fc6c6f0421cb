"""Friction of a body that only an accelerometer senses: its direction needs no source by default."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from modelgen.cli.candidates import spec_model
from modelgen.cli.main import app
from modelgen.runtime.curves.rebuilt import rebuild
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec

NOISE = {"q_m": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}


@cache
def text() -> str:
    spec = files("modelgen").joinpath("catalog", "emps300.toml").read_text(encoding="utf-8")
    spec = spec.replace('inertia = "J_c"', 'inertia = "J_c"\ncoulomb = "F_sc"')
    for name, value in (("light", 1.5e-3), ("table_1", 1e-3), ("table_2", 1e-3)):
        spec = spec.replace(f"[parameters.{name}]", f"[parameters.{name}]\nF_sc = {value}")
    return spec


@cache
def model() -> Model:
    return spec_model(parse_spec(text(), "friction.toml"), "qm_ac")


@cache
def records() -> tuple[Record, ...]:
    found = []
    for kind in ("chirp", "trapezoid"):
        truth = model().parameter_sets["light"]
        record = simulate(model(), truth, kind, fs=2000.0, duration_s=3.0, noise=NOISE).record
        signals = {key: record.signals[key] for key in NOISE}  # no direction among them
        found.append(Record(signals, record.fs, kind))
    return tuple(found)


def test_a_load_with_friction_and_an_accelerometer_is_identified_by_default() -> None:
    found, truth = identify(model(), records()), model().parameter_sets["light"]
    assert any("direction of c is that of a_c, integrated" in one for one in found.fit.filtering.sentences)
    physical = {entry.name: entry for entry in found.parameters.physical}
    assert {"J_m", "F_vm", "J_c", "F_vmc", "K"} <= physical.keys()
    for name, entry in physical.items():
        assert abs(entry.value - truth[name]) < 3.0 * entry.std
    assert physical["K"].relative_std < 2.0
    # what draws an estimate makes the same directions
    rows, _ = rebuild(model(), records(), found)
    assert {row.record for row in rows} == {"chirp", "trapezoid"}
    assert all(np.isfinite(row.residual).any() for row in rows)


@pytest.mark.parametrize("source", [(), pytest.param(("--direction", "sign_c=a_c"), marks=pytest.mark.slow)])
def test_files_need_no_column_for_a_direction_and_the_report_is_written(
    source: tuple[str, ...], tmp_path: Path
) -> None:
    paths = []
    for record in records():
        paths.append(str(tmp_path / f"{record.name}.npz"))
        write_record(Path(paths[-1]), record)
    spec, report = tmp_path / "friction.toml", tmp_path / "report.html"
    spec.write_text(text(), encoding="utf-8")
    options = ("--spec", str(spec), "--sensors", "qm_ac", "--report", str(report), *source)
    result = CliRunner().invoke(app, ["identify", *paths, *options])
    assert result.exit_code in (0, 1), result.output
    assert report.stat().st_size > 10_000
