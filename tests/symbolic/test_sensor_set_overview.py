"""Sensor sets side by side."""

from __future__ import annotations

from dataclasses import replace

import pytest

from modelgen.errors import ModelError
from modelgen.spec.chain import Sensor
from modelgen.spec.load import catalog_path, load_spec
from modelgen.symbolic.sensor_set_overview import every_subset, overview

EMPS300 = load_spec(catalog_path("emps300"))


def test_every_subset_of_position_and_acceleration_sensors() -> None:
    spec = every_subset(EMPS300)
    assert len(spec.sensor_sets) == 2 ** (2 * len(spec.bodies)) - 1
    assert list(spec.sensor_sets)[:4] == ["q_m", "a_m", "q_c", "a_c"]
    assert list(spec.sensor_sets)[-1] == "q_m a_m q_c a_c"


def test_what_each_set_loses() -> None:
    lost = {s.name: s.lost for s in overview(every_subset(EMPS300), every_subset(EMPS300).sensor_sets)}
    # Only sets without any position or velocity lose the Coulomb friction, and nothing loses more than that.
    assert {name for name, names in lost.items() if names} == {"a_m", "a_c", "a_m a_c"}
    assert lost["a_m a_c"] == ("F_sm",)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["emps300", "three_mass"])
def test_adding_a_sensor_loses_nothing(name: str) -> None:
    spec = every_subset(load_spec(catalog_path(name)))
    found = {s.name: set(s.lost) for s in overview(spec, spec.sensor_sets)}
    for small, lost in found.items():
        for large in found:
            if set(small.split()) < set(large.split()):
                assert found[large] <= lost, (small, large)


def test_a_set_that_cannot_be_built_is_a_line_with_its_reason() -> None:
    cubic = replace(EMPS300, links=(replace(EMPS300.links[0], stiffness3="K3"),))
    one = replace(cubic, sensor_sets={"q_m": (Sensor("q_m", "m", None, "position"),)})
    (summary,) = overview(one, ["q_m"])
    assert summary.model is None
    assert "cubic stiffness" in summary.reason
    assert "K3" in summary.lost


def test_too_many_subsets_are_refused() -> None:
    bodies = tuple(replace(EMPS300.bodies[1], name=f"b{i}", inertia=f"J{i}") for i in range(5))
    with pytest.raises(ModelError, match="5 bodies have 1023 subsets"):
        every_subset(replace(EMPS300, bodies=bodies))
