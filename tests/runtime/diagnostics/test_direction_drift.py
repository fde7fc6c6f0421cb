from __future__ import annotations

from dataclasses import replace

import numpy as np

from modelgen.runtime.diagnostics.settings_drift import direction_drift
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.job import Job
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.least_squares.fit import Fit
from tests.runtime.rigid_motion import CHOICE, FS, RIGID, SETTINGS, TRUTH, rigid_record, swings

# at each reversal the fast term moves the crossing that the low-passed velocity shows
VIBRATING = swings((0.5, 0.25), (0.05, 3.0))


def test_what_a_low_passed_velocity_does_to_the_offset_is_in_its_interval() -> None:
    estimate = identify(RIGID, rigid_record(VIBRATING), "wls")
    (offset,) = [entry for entry in estimate.parameters.identified if entry.name == "offset"]
    error = abs(offset.value - TRUTH["offset"])
    assert 2.5 * offset.noise_std < error < 1.96 * offset.std
    assert any("other cut-offs" in note and "offset" in note for note in estimate.fit.notes)


def test_where_directions_are_clear_nothing_is_added() -> None:
    estimate = identify(RIGID, rigid_record(), **values_of("wls", **SETTINGS))
    for entry in estimate.parameters.identified:
        assert entry.drift_std < entry.noise_std


def test_it_is_the_square_of_the_move_at_twice_the_cut_off() -> None:
    record = rigid_record(VIBRATING)

    def again(choice: FilterChoice) -> Fit:
        return METHODS["wls"].run(Job(RIGID, (record,), choice))[1]

    low = replace(CHOICE, direction_cutoff_hz=3.0)
    fit, twice = again(low), again(replace(CHOICE, direction_cutoff_hz=6.0))
    move = twice.solution.x - fit.solution.x
    assert abs(move[-1]) > 0.1
    np.testing.assert_allclose(direction_drift(fit, low, FS, again), np.outer(move, move))
    # at the highest cut-off that the sampling allows there is nothing above it to try
    highest = replace(CHOICE, direction_cutoff_hz=0.4 * FS)
    np.testing.assert_array_equal(direction_drift(fit, highest, FS, again), np.zeros((4, 4)))
