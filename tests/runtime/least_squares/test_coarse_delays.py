"""How late forces are, in whole samples: found where small steps would not find it, and nothing made up."""

from __future__ import annotations

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.least_squares.coarse_delays import coarse_delays
from modelgen.runtime.least_squares.thresholds import EARLIEST, LATEST
from modelgen.runtime.least_squares.wls import fit_matched
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows.observation import observe
from tests.runtime.rigid_motion import CHOICE, RIGID, rigid_record, swings
from tests.runtime.rigid_motion import FS as RIGID_FS
from tests.runtime.two_mass_records import GEARED, SMALL, two_mass_records


def found(model: Model, records: list[Record], channel: str = "Gamma_m") -> float:
    """The delay in samples."""
    choice = choose_filter(model, records)
    fit = fit_matched(observe(model, records, choice, turns=False))
    delays = coarse_delays(fit, model, records, choice, [channel])
    assert list(delays) == [channel]
    return delays[channel] * records[0].fs


@pytest.mark.parametrize("samples", [*range(EARLIEST, -2, 3), 3, 7, 20, LATEST])
def test_a_late_force_is_found_to_the_sample(samples: int) -> None:
    assert abs(found(SMALL, two_mass_records(late={"Gamma_m": samples})) - samples) <= 1.0


@pytest.mark.parametrize("geared", [False, True])
def test_a_force_on_time_is_left_alone(geared: bool) -> None:
    assert found(GEARED if geared else SMALL, two_mass_records(geared=geared)) == 0.0


@pytest.mark.parametrize("samples", [LATEST + 10, EARLIEST - 10])
def test_no_delay_beyond_those_looked_at_is_told(samples: int) -> None:
    assert EARLIEST <= found(SMALL, two_mass_records(late={"Gamma_m": samples})) <= LATEST


@pytest.mark.parametrize("samples", [-8, 5, 30])
def test_a_rigid_axis_tells_its_delay_as_well(samples: int) -> None:
    lively = rigid_record(swings((0.4, 0.7), (0.1, 4.3), (0.05, 9.1)), noise=1e-8)
    force = np.roll(lively.signals["F"], samples)
    records = [Record({**lively.signals, "F": force}, RIGID_FS, "run")]
    fit = fit_matched(observe(RIGID, records, CHOICE, turns=False))
    delays = coarse_delays(fit, RIGID, records, CHOICE, ["F"])
    assert abs(delays["F"] * RIGID_FS - samples) <= 1.0


def test_without_a_force_to_look_at_nothing_is_looked_for() -> None:
    records = two_mass_records()
    choice = choose_filter(SMALL, records)
    fit = fit_matched(observe(SMALL, records, choice, turns=False))
    assert coarse_delays(fit, SMALL, records, choice, []) == {}
