"""Gains of drives and torque sensors of elastic arms: named, and all parameters known to no better scale."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.identification.elastic.force_gains import ForceGain, all_but_one, force_gains
from modelgen.runtime.iv.model_errors import delay_effect
from modelgen.runtime.records.record import Record
from tests.runtime.identification.elastic.test_channels_set_right import FS, errors, estimated, made, told

OFF, SHARE = "tau_2", 0.03


def test_only_forces_that_others_can_be_compared_with_have_a_gain() -> None:
    model = made()[0]
    assert [one.channel for one in force_gains(model)] == ["tau_1", "tau_2"]
    alone: Any = SimpleNamespace(actuators=model.actuators[:1], roles=model.roles)
    assert not list(force_gains(alone))
    # a gain that is a parameter is estimated anyway
    given: Any = SimpleNamespace(actuators=model.actuators, roles={"gain_1": SimpleNamespace(role="gain")})
    assert not list(force_gains(given))


def test_the_gain_of_one_force_is_the_scale_of_the_others() -> None:
    model = made()[0]
    first, second = force_gains(model)
    assert not all_but_one((delay_effect("tau_1"),), model)
    assert all_but_one((first,), model)
    assert all_but_one((first, second), model)


def test_a_force_is_set_right_by_its_gain() -> None:
    gain = next(iter(force_gains(made()[0])))
    record = Record({"tau_1": np.array([1.1, -2.2])}, FS, "two")
    assert isinstance(gain, ForceGain)
    np.testing.assert_allclose(gain.corrected(record, 0, 0.1).signals["tau_1"], [1.0, -2.0])


@pytest.mark.slow
@pytest.mark.parametrize("sides", [("motor", "link"), ("motor",)])
def test_a_torque_constant_that_is_off_is_named_and_in_all_intervals(sides: tuple[str, ...]) -> None:
    """Stiffness was 3 % off at 47 deviations, and nothing but a residual of more than noise was said."""
    model, read, truth = made(sides)
    found = estimated(model, read | {OFF: (1.0 + SHARE) * read[OFF]})
    assert any(
        f"the gain of {OFF} is off (+3" in said or "the gain of tau_1 is off (-" in said
        for said in told(found)
    )
    assert np.max(np.abs(errors(found, truth))) < 2.6
    for name in ("K1", "K2"):
        assert found.bse[name] > 0.6 * SHARE * found.params[name], name


@pytest.mark.slow
def test_a_right_record_has_no_gain_and_its_narrow_intervals() -> None:
    model, read, truth = made()
    found = estimated(model, read)
    assert not any("gain" in said for said in told(found))
    assert found.bse["K1"] < 0.1 * SHARE * found.params["K1"]
    assert np.max(np.abs(errors(found, truth))) < 4.0
