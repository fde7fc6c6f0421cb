"""Further tables of a spec, one value or key of them replaced by anything: taken, or explained."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from generated import emps300_qm_qc
from modelgen.cli.candidates import MOST_SETS, candidate_models, load_candidates
from modelgen.errors import DataError, ModelgenError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.mapping_file import load_mapping
from modelgen.runtime.results.estimate_file import load_estimate
from modelgen.runtime.simulation.controller_file import load_controller
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.simulation.validate import parameters_of
from modelgen.spec.load import catalog_path, load_spec, parse_spec
from tests.fuzz.test_specs import ANYTHING, check_lines, toml

CHAIN = load_spec(catalog_path("emps300"))
MODEL = model_from_module(emps300_qm_qc)
TRUTH = MODEL.parameter_sets["light"]
HELD = Excitation(*([[0.0, 1e-3, 0.0]] * 3), rate_hz=1000.0)  # type: ignore[arg-type]
EXTREMES = st.sampled_from([1e30, 1e-30, -1e30, 1e400, 2**63 - 1, 0, 0.0, -0.0, "", "\x1b[2J", "x" * 5000])
NAMES = st.sampled_from(["class", "type", "sign_c", "d1_q_m", "J_m", "Gamma_m", "ground", "__import__", "é"])
VALUES = ANYTHING | EXTREMES | NAMES | st.sampled_from([["m", "c"], ["m", "m"], ["m", "ground"], "m"])


def candidates(path: Path) -> None:
    # what is taken has a model, or no model for a reason of the chain
    candidate_models(CHAIN, load_candidates(path, CHAIN), 1)


def controller(path: Path) -> None:
    loop, drive = load_controller(path)
    simulate(MODEL, TRUTH, HELD, fs=1000.0, controller=loop, drive=drive)


def estimate(path: Path) -> None:
    parameters_of(load_estimate(path), MODEL)


KINDS: dict[str, tuple[Callable[[Path], object], dict[str, Any]]] = {
    "candidates": (
        candidates,
        {
            "sensors": {
                "s": {"body": "m", "measures": "position", "noise": 1e-5, "resolution": 1e-3, "price": 2.0},
                "r": {"deflection": ["m", "c"], "measures": "position"},
            },
            "actuators": {"Gamma_m": {"noise": 1e-4}},
        },
    ),
    "loop": (
        controller,
        {
            "controller": {"kp": 0.19, "kv": 1.7e-3, "rate_gain": 0.5},
            "drive": {
                "rate_hz": 1000.0,
                "delay_s": 0.001,
                "bandwidth_hz": 300.0,
                "limit": 2.0,
                "encoder_step": 1e-4,
                "velocity": "central",
            },
        },
    ),
    "cascade": (
        controller,
        {"controller": {"position_gain": 110.0, "velocity_gain": 1.7e-3, "force_gain": 1.0}},
    ),
    "mapping": (
        load_mapping,
        {
            "mend": ["duplicates"],
            "time": {"column": "t", "unit": "ms", "period_s": 0.5, "fs_hz": 1000.0},
            "channels": {"q_m": {"column": "theta", "factor": 2.0, "negate": False, "unit": "rad"}},
        },
    ),
    "estimate": (
        estimate,
        {
            "format": "modelgen estimate",
            "version": 1,
            "chain": "emps300",
            "method": "wls",
            "records": ["chirp"],
            "params": {"J_m": 1e-5, "K": 0.4},
            "bse": {"J_m": 1e-7, "K": 1e-3},
            "cov_params": [[1.0, 0.0], [0.0, 1.0]],
            "physical": dict(TRUTH),
            "other_solutions": [{"K": 1.0}],
            "not_identifiable": {"F_sm": "why"},
        },
    ),
}


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path of everything in a document."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, item in inner for found in [(*path, key), *places(item, (*path, key))]]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=150, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_anything_in_a_table_is_taken_or_explained(kind: str, processes: Path, data: st.DataObject) -> None:
    read, good = KINDS[kind]
    document = copy.deepcopy(good)
    *above, key = data.draw(st.sampled_from(places(document)))
    table = document
    for step in above:
        table = table[step]
    if isinstance(table, dict) and data.draw(st.integers(0, 3)) == 0:
        table[data.draw(NAMES | st.text(max_size=5))] = table.pop(key)
    else:
        table[key] = data.draw(VALUES)
    path = processes / kind  # numba keeps what it compiled in pickles of its own
    if kind == "estimate":
        text = json.dumps(document)
    else:
        text = "\n".join(f"{toml(name)} = {toml(value)}" for name, value in document.items())
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    try:
        read(path)
    except ModelgenError as error:
        check_lines(error)


@pytest.mark.parametrize("kind", KINDS)
def test_the_tables_themselves_are_good(kind: str, processes: Path) -> None:
    read, good = KINDS[kind]
    path = processes / kind  # numba keeps what it compiled in pickles of its own
    text = "\n".join(f"{toml(name)} = {toml(value)}" for name, value in good.items())
    path.write_text(json.dumps(good) if kind == "estimate" else text)
    read(path)


def test_more_sets_than_anyone_waits_for_are_refused_with_their_number(trap: Path) -> None:
    sensor = '[sensors.s{}]\nbody = "m"\nmeasures = "position"\n'
    path = trap / "many.toml"
    path.write_text("".join(sensor.format(i) for i in range(MOST_SETS + 1)))
    many = load_candidates(path, CHAIN)
    for most, count in ((1, 1001), (2, 501501)):
        with pytest.raises(DataError, match=f"1001 sensors make {count} sets of at most {most}; give fewer"):
            candidate_models(CHAIN, many, most)


def test_candidates_of_which_no_set_has_a_model_are_refused_with_the_reasons(trap: Path) -> None:
    path = trap / "few.toml"
    path.write_text('[sensors.s]\nbody = "m"\nmeasures = "position"\n')
    text = (
        catalog_path("emps300").read_text().replace('stiffness = "K"', 'stiffness = "K"\nstiffness3 = "K3"')
    )
    cubic = parse_spec(text, "cubic.toml")
    with pytest.raises(DataError, match=r"--candidates: s: .*cubic stiffness.*; add candidates"):
        candidate_models(cubic, load_candidates(path, cubic), 1)
