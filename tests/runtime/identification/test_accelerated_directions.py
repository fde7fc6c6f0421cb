"""Friction of a body that only an accelerometer senses: its direction needs no source by default."""

from __future__ import annotations

from importlib.resources import files

from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec

NOISE = {"q_m": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}


def test_a_load_with_friction_and_an_accelerometer_is_identified_by_default() -> None:
    text = files("modelgen").joinpath("catalog", "emps300.toml").read_text(encoding="utf-8")
    text = text.replace('inertia = "J_c"', 'inertia = "J_c"\ncoulomb = "F_sc"')
    text = text.replace("[parameters.light]", "[parameters.light]\nF_sc = 1.5e-3")
    for name in ("table_1", "table_2"):
        text = text.replace(f"[parameters.{name}]", f"[parameters.{name}]\nF_sc = 1e-3")
    model = spec_model(parse_spec(text, "friction.toml"), "qm_ac")
    truth = model.parameter_sets["light"]
    records = []
    for kind in ("chirp", "trapezoid"):
        record = simulate(model, truth, kind, fs=2000.0, duration_s=3.0, noise=NOISE).record
        signals = {key: record.signals[key] for key in ("q_m", "a_c", "Gamma_m")}
        records.append(Record(signals, record.fs, kind))
    found = identify(model, records)
    assert any("direction of c is that of a_c, integrated" in one for one in found.fit.filtering.sentences)
    physical = {entry.name: entry for entry in found.parameters.physical}
    assert {"J_m", "F_vm", "J_c", "F_vmc", "K"} <= physical.keys()
    for name, entry in physical.items():
        assert abs(entry.value - truth[name]) < 3.0 * entry.std
    assert physical["K"].relative_std < 2.0
