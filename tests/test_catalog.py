"""The example chains load, and their values are what their comments say."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from jinja2 import Environment, StrictUndefined

from modelgen.errors import SpecError
from modelgen.spec.chain import ChainSpec
from modelgen.spec.load import catalog_names, catalog_path, load_spec, parse_spec

NAMES = ("emps300", "emps_rigid", "emps_rigid_asymmetric", "three_mass", "tree", "two_mass_bench")


def chain(name: str) -> ChainSpec:
    return load_spec(catalog_path(name))


def frequencies_hz(spec: ChainSpec, values: Mapping[str, float]) -> np.ndarray:
    """Return the undamped natural frequencies in Hz, shape (bodies,), ascending."""
    place = {body.name: index for index, body in enumerate(spec.bodies)}
    inertia = np.diag([values[body.inertia] for body in spec.bodies])
    stiffness = np.zeros_like(inertia)
    for link in spec.links:
        deflection = np.zeros(len(place))
        deflection[place[link.bodies[0]]] = 1 / link.ratio
        if link.bodies[1] != "ground":
            deflection[place[link.bodies[1]]] = -1
        stiffness += values[link.stiffness] * np.outer(deflection, deflection)
    squares = np.linalg.eigvals(np.linalg.solve(inertia, stiffness)).real
    return np.sort(np.sqrt(np.abs(squares))) / (2 * np.pi)


def test_names_of_the_catalogue() -> None:
    assert catalog_names() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_example_is_complete(name: str) -> None:
    spec = chain(name)
    assert spec.name == name
    assert spec.sensor_sets
    assert any(body.actuator for body in spec.bodies)
    for values in spec.parameter_sets.values():
        assert list(values) == [parameter.name for parameter in spec.parameters]


@pytest.mark.parametrize("name", NAMES)
def test_every_example_explains_itself(name: str) -> None:
    assert catalog_path(name).read_text(encoding="utf-8").startswith("# ")


def test_an_unknown_example_is_explained() -> None:
    with pytest.raises(SpecError, match=r'^"emps30": is not in the catalogue; did you mean "emps300"\?$'):
        catalog_path("emps30")
    with pytest.raises(SpecError, match="is not in the catalogue"):
        catalog_path(os.path.join("..", "catalog", "tree"))


@pytest.mark.parametrize(
    ("values", "frequency_hz", "damping_ratio"),
    [("table_1", 106.5, 2.61), ("table_2", 123.6, 0.50), ("light", 123.6, 0.04)],
)
def test_emps300_has_the_frequency_and_damping_of_the_paper(
    values: str, frequency_hz: float, damping_ratio: float
) -> None:
    p = chain("emps300").parameter_sets[values]
    compliance = 1 / p["J_m"] + 1 / p["J_c"]
    assert np.sqrt(p["K"] * compliance) / (2 * np.pi) == pytest.approx(frequency_hz, abs=0.05)
    assert p["F_vmc"] / 2 * np.sqrt(compliance / p["K"]) == pytest.approx(damping_ratio, abs=0.005)
    assert frequencies_hz(chain("emps300"), p)[-1] == pytest.approx(frequency_hz, abs=0.05)


def test_emps300_has_the_parameters_and_sensors_of_the_paper() -> None:
    spec = chain("emps300")
    assert [p.name for p in spec.parameters] == ["J_m", "F_vm", "F_sm", "J_c", "F_vmc", "K"]
    assert {name: [s.key for s in sensors] for name, sensors in spec.sensor_sets.items()} == {
        "qm_qc": ["q_m", "q_c"],
        "qm_ac": ["q_m", "a_c"],
    }


def test_rigid_axis_has_the_published_values() -> None:
    assert chain("emps_rigid").parameter_sets["published_2019"] == {
        "M": 95.1089,
        "Fv": 203.5034,
        "Fc": 20.3935,
        "offset": -3.1648,
    }
    assert chain("emps_rigid_asymmetric").parameter_sets["published_2019"] == {
        "M": 95.1540,
        "Fv_plus": 166.7061,
        "Fc_plus": 20.1440,
        "Fv_minus": 240.4236,
        "Fc_minus": 20.6277,
    }
    assert [p.unit for p in chain("emps_rigid").parameters] == ["kg", "N s/m", "N", "N"]


def test_three_masses_have_the_frequencies_of_their_comment() -> None:
    spec = chain("three_mass")
    assert frequencies_hz(spec, spec.parameter_sets["nominal"])[1:] == pytest.approx([31, 68], abs=0.5)
    measured = [[s.measures for s in sensors] for sensors in spec.sensor_sets.values()]
    assert measured == [["position"] * 3, ["position", "position", "acceleration"], ["velocity"] * 3]


def test_tree_has_every_kind_of_element() -> None:
    spec = chain("tree")
    assert sum(body.actuator is not None for body in spec.bodies) == 2
    assert sum(body.offset is not None for body in spec.bodies) == 1
    assert [link.bodies for link in spec.links if link.ratio != 1] == [("m", "g")]
    assert [link.bodies for link in spec.links if "ground" in link.bodies] == [("b", "ground")]
    assert max(sum(body.name in link.bodies for link in spec.links) for body in spec.bodies) == 3
    # the return spring holds the whole tree: no frequency is zero, and all are within reach of a servo drive
    found = frequencies_hz(spec, spec.parameter_sets["nominal"])
    assert 1 < found[0] < found[-1] < 200


def test_starter_is_a_good_file(repo_root: Path) -> None:
    template = (repo_root / "templates" / "starter.toml.j2").read_text(encoding="utf-8")
    text = (
        Environment(undefined=StrictUndefined, autoescape=False).from_string(template).render(name="my_axis")
    )
    spec = parse_spec(text, "my_axis.toml")
    assert spec.name == "my_axis"
    assert list(spec.parameter_sets["guess"]) == [p.name for p in spec.parameters]
    # its commented-out lines are right as well
    options = ("offset", "friction", "stiffness3", "[known]", "J_c", "[sensors.qm_twist]", "q_m", "twist")
    lines = [line.removeprefix("# ") if line.startswith(tuple(f"# {o}" for o in options)) else line
             for line in text.replace("F_vm = 5.0e-3\nF_sm = 0.05\n", "").splitlines()]  # fmt: skip
    full = parse_spec("\n".join(lines), "my_axis.toml")
    assert (full.bodies[0].friction, full.bodies[0].offset, full.links[0].stiffness3) == (
        "asymmetric",
        "O_m",
        "K3",
    )
    assert full.known == {"J_c": 1e-3}
    assert full.sensor_sets["qm_twist"][1].deflection == ("m", "c")
