"""Units and signs of two sensors that springs let move as one: degrees, revolutions, a reversed encoder."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from modelgen.errors import DataError, IdentifiabilityError
from modelgen.runtime.diagnostics.unit_errors import unlike_units
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.physical.test_composite_iv import model_of
from tests.runtime.iv.physical.test_friction_rows import SERVO, TRUTH

BOTH = SERVO + 'q_l = { body = "l", measures = "position" }\n'
TO_GROUND = BOTH.replace("links = [", 'links = [{ bodies = ["l", "ground"], stiffness = "K_g" },')


@cache
def clean() -> tuple[Model, Record]:
    model = model_of(BOTH, "motor")
    return model, simulate(
        model, TRUTH, "chirp", fs=1000.0, duration_s=3.0, noise={"q_m": 1e-5, "q_l": 1e-5}
    ).record


def with_load(factor: float) -> Record:
    _, record = clean()
    return record.edited({"q_l": factor * record.signals["q_l"]})


def said(record: Record, model: Model | None = None) -> list[tuple[str, str]]:
    found = unlike_units(model or clean()[0], record, ("q_m", "q_l"))
    return [(one.kind, one.what) for one in found]


@pytest.mark.parametrize(("factor", "unit"), [(180.0 / np.pi, "degrees"), (0.5 / np.pi, "revolutions")])
def test_an_encoder_in_another_unit_is_told_with_that_unit(factor: float, unit: str) -> None:
    ((kind, what),) = said(with_load(factor))
    assert kind == "unit"
    assert what.endswith(f"what q_m says at low frequencies: one of them may be in {unit}")


def test_an_encoder_that_is_reversed_is_told_by_its_motion() -> None:
    ((kind, what),) = said(with_load(-1.0))
    assert (kind, what) == (
        "swapped",
        "moves against q_m at low frequencies: one of them is reversed in sign",
    )
    with pytest.raises(IdentifiabilityError, match="moves against q_m"):
        identify(clean()[0], with_load(-1.0))


def test_nothing_is_told_of_right_channels_or_other_factors() -> None:
    assert said(clean()[1]) == []
    assert said(with_load(20.0)) == []
    # beside a spring to ground a body may move as little as it likes, and against another
    held = model_of(TO_GROUND, "motor")
    assert said(with_load(-1.0), held) == said(with_load(180.0 / np.pi), held) == []


def test_a_sensor_that_reads_one_number_is_refused_beside_one_that_moves() -> None:
    model, record = clean()
    with pytest.raises(DataError, match="it does not say how l moves"):
        identify(model, record.edited({"q_l": np.full(record.n, 0.5)}))
