"""Records of different sensors for one chain: what two sets see is one answer, what none sees is refused."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.cli.candidates import spec_model
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.exports.export import export
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.joining.identify_jointly import identify_jointly, join
from modelgen.runtime.model.known_parameters import with_known
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec

# a building of three floors, shaken at the lowest: a run sees two floors
TOWER = """
[chain]
name = "tower"
motion = "translation"
[[bodies]]
name = "f1"
inertia = "M_1"
viscous = "B_1"
actuator = "F"
[[bodies]]
name = "f2"
inertia = "M_2"
[[bodies]]
name = "f3"
inertia = "M_3"
[[links]]
bodies = ["f1", "ground"]
stiffness = "K_0"
[[links]]
bodies = ["f1", "f2"]
stiffness = "K_1"
damping = "D_1"
[[links]]
bodies = ["f2", "f3"]
stiffness = "K_2"
damping = "D_2"
[parameters.nominal]
M_1 = 4.0
M_2 = 3.0
M_3 = 2.0
B_1 = 5.0
K_0 = 2e4
K_1 = 3e4
D_1 = 8.0
K_2 = 1.5e4
D_2 = 5.0
[sensors.all]
q_1 = { body = "f1", measures = "position" }
q_2 = { body = "f2", measures = "position" }
q_3 = { body = "f3", measures = "position" }
[sensors.low]
q_1 = { body = "f1", measures = "position" }
q_2 = { body = "f2", measures = "position" }
[sensors.ends]
q_1 = { body = "f1", measures = "position" }
q_3 = { body = "f3", measures = "position" }
[sensors.first]
a_1 = { body = "f1", measures = "acceleration" }
"""


@cache
def models() -> dict[str, Model]:
    spec = parse_spec(TOWER, "tower.toml")
    return {name: spec_model(spec, name) for name in ("all", "low", "ends")}


def record(model: Model, seed: int, **changed: float) -> Record:
    values = {**model.parameter_sets["nominal"], **changed}
    noise = dict.fromkeys((sensor.key for sensor in model.sensors), 1e-8)
    found = simulate(
        model, values, "chirp", fs=1000.0, duration_s=4.0, noise={**noise, "F": 1e-4}, seed=seed
    ).record
    return Record(found.signals, found.fs, f"run{seed}", found.tag)


@pytest.fixture(scope="module")
def joint():
    return identify_jointly(
        [(models()["low"], [record(models()["low"], 1)]), (models()["ends"], [record(models()["ends"], 2)])],
        "wls",
    )


@pytest.mark.slow
def test_two_runs_give_one_answer_within_its_intervals(joint) -> None:
    true = models()["all"].parameter_sets["nominal"]
    one = joint.estimate
    assert one.records == ("run1", "run2") and one.model.joined == ("low", "ends")
    told = {entry.name: entry for entry in one.parameters.physical}
    assert told
    for name, entry in told.items():
        assert abs(entry.value - true[name]) < 4.5 * entry.std + 1e-4 * true[name], name
        # never less known than by a set alone
        for part in joint.parts.values():
            alone = next((p.std for p in part.parameters.physical if p.name == name), np.inf)
            assert entry.std <= 1.001 * alone * joint.agreement.factor
    np.testing.assert_allclose(np.sqrt(np.diag(one.cov_params())), list(one.bse.values()), rtol=1e-9)
    assert {*told} | {*one.not_identifiable} >= {*models()["all"].parameters}
    assert joint.agreement.p_value > 1e-3 and joint.agreement.factor == 1.0
    assert "sensors low + ends" in str(joint)


def test_linear_sets_are_combined_as_by_hand() -> None:
    """Of two estimates of the same linear model: the precision-weighted mean of vectors."""
    model = models()["all"]
    twin = spec_model(parse_spec(TOWER.replace("[sensors.all]", "[sensors.twin]"), "tower.toml"), "twin")
    pair = [identify(model, [record(model, 3)], "wls"), identify(twin, [record(twin, 4)], "wls")]
    joined = join({"all": model, "twin": twin}, {"all": pair[0], "twin": pair[1]})
    weights = [np.linalg.inv(one.cov_params()) for one in pair]
    C = np.linalg.inv(weights[0] + weights[1])
    x = C @ sum(
        (w @ np.array(list(one.params.values())) for w, one in zip(weights, pair, strict=True)),
        np.zeros(len(C)),
    )
    names = list(pair[0].params)
    found = np.array([joined.estimate.params[name] for name in names])
    spread = np.sqrt(np.diag(C))
    np.testing.assert_allclose((found - x) / spread, 0.0, atol=1e-5)
    widths = np.array([joined.estimate.bse[name] for name in names]) / joined.agreement.factor
    np.testing.assert_allclose(widths, spread, rtol=1e-5)


@pytest.mark.slow
def test_a_chain_that_changed_between_the_records_is_told() -> None:
    changed = identify_jointly(
        [
            (models()["low"], [record(models()["low"], 1)]),
            (models()["ends"], [record(models()["ends"], 2, K_0=2.4e4)]),
        ],
        "wls",
    )
    assert changed.agreement.p_value < 1e-3 and changed.agreement.factor > 1.0
    assert "sensor sets disagree" in {advice.kind for advice in changed.estimate.checks.advice}
    assert changed.estimate.verdict.word != "trust"


def test_the_answer_is_saved_exported_and_has_modes(joint, tmp_path) -> None:
    one = joint.estimate
    one.save(tmp_path / "joint.json")
    again = Estimate.load(tmp_path / "joint.json")
    assert again.to_json() == one.to_json()
    if set(one.physical) == {*models()["low"].parameters}:
        made = export(models()["low"], again, "state-space", samples=3)
        assert made.values.nominal["K_1"] == one.physical["K_1"]
        modes = one.modes()
        assert len(modes.modes) == 3
    for text in (one.summary(), one.answer(), joint.summary()):
        assert text.endswith("\n")


@pytest.mark.slow
def test_what_no_set_sees_is_refused() -> None:
    spec = parse_spec(
        TOWER.replace(
            "[sensors.first]",
            "[sensors.f2]\na_2 = { body = 'f2', measures = 'acceleration' }\n[sensors.first]",
        ),
        "t.toml",
    )
    first, second = spec_model(spec, "first"), spec_model(spec, "f2")
    try:
        found = identify_jointly([(first, [record(first, 5)]), (second, [record(second, 6)])], "wls")
    except IdentifiabilityError:
        return
    for name in found.estimate.not_identifiable:
        assert name not in found.estimate.physical


def test_mistakes_are_said() -> None:
    model = models()["low"]
    with pytest.raises(DataError, match="are given twice"):
        identify_jointly([(model, []), (model, [])])
    with pytest.raises(DataError, match="of another chain"):
        identify_jointly([(model, []), (with_known(models()["ends"], {"K_0": 2e4}), [])])
    with pytest.raises(DataError, match="there are none"):
        identify_jointly([])
    with pytest.raises(DataError, match="sensors low: records"):
        identify_jointly([(model, [])])
