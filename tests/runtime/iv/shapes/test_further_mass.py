"""A further mass as an effect: what it does to a chain is what the longer chain does, and it is found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.companion_simulation import simulated_beside
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.effect_rows import effect_rows
from modelgen.runtime.iv.shapes.further_mass import further_mass
from modelgen.runtime.simulation.held_chain import held_chain
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.shapes.chains import KNOWN, LONG, MASS, SHORT
from tests.runtime.two_mass_records import SMALL, TRUTH, two_mass_records

OMEGA = float(np.sqrt(MASS["K_x"] / MASS["J_x"]))
HZ, DAMPING = OMEGA / (2.0 * np.pi), 0.5 * MASS["D_x"] * OMEGA / MASS["K_x"]


def test_a_chain_with_the_mass_moves_as_the_longer_chain() -> None:
    """Accelerations with the mass, what it does to itself included, are those that the chain's poles give."""
    omega = np.linspace(1200.0, 3000.0, 40)
    short, long = (
        held_chain(make_plant(model, values), omega)
        for model, values in ((SHORT, KNOWN), (LONG, KNOWN | MASS))
    )
    moved = short.acceleration(np.array([0.0, 1.0]))
    u = 1j * omega / OMEGA
    pull = MASS["J_x"] * (1.0 + 2.0 * DAMPING * u) / (1.0 + 2.0 * DAMPING * u + u**2)
    expected = long.acceleration(np.array([0.0, 1.0, 0.0]))
    # the weak feedback that holds a chain is set by its own inertia
    np.testing.assert_allclose(moved / (1.0 + pull * moved), expected, rtol=0.01)
    assert np.max(np.abs(moved / expected - 1.0)) > 0.1


@pytest.mark.parametrize("place", [0, 1])
def test_frequency_and_damping_change_the_effect_as_their_columns_say(place: int) -> None:
    record = two_mass_records(noise=0.0)[0].part(0, 2000, "short")
    simulated = simulated_beside(SMALL, TRUTH, record, choose_filter(SMALL, (record,)))
    mass, size, step = further_mass("c", 150.0, 0.1), 2e-7, 1e-4
    assert mass.moved is not None
    steps = [size * step if index == place else 0.0 for index in range(2)]
    near = [mass.moved(size, [sign * by for by in steps]) for sign in (1.0, -1.0)]
    more, less = (one.changes(simulated)["q_c"] for one in near)
    expected = mass.shape(1)[place].changes(simulated)["q_c"]
    scale = float(np.max(np.abs(expected)))
    np.testing.assert_allclose((more - less) / (2.0 * step), expected, atol=1e-5 * scale)


def test_how_a_mass_moves_at_first_belongs_to_its_record() -> None:
    record = two_mass_records(noise=0.0)[0].part(0, 2000, "short")
    simulated = simulated_beside(SMALL, TRUTH, record, choose_filter(SMALL, (record,)))
    of_first, of_second = further_mass("c", 150.0, 0.1).shape(2)[2], further_mass("c", 150.0, 0.1).shape(2)[4]
    assert of_first.changes(simulated) and not of_second.changes(simulated)
    assert of_second.changes(replace(simulated, index=1))


@pytest.mark.slow
def test_a_further_mass_in_the_band_is_found_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lumped with the load, it would move J_c by 8 %; its resonance lies below the chain's own."""
    noise = {"q_m": 3e-6, "q_c": 3e-6, "T": 8e-3}
    options = {"fs": 5000.0, "duration_s": 1.5, "oversample": 8, "noise": noise}
    records = [simulate(LONG, KNOWN | MASS, kind, **options).record for kind in ("chirp", "trapezoid")]
    asked: list[int] = []

    def counted(fit: Any, setting: Any, simulated: Any, effects: Sequence[Effect]) -> Any:
        asked.append(len(effects))
        return effect_rows(fit, setting, simulated, effects)

    monkeypatch.setattr("modelgen.runtime.iv.shapes.shape_search.effect_rows", counted)
    estimate = identify(SHORT, records)
    # a mass on the grid, one with how it begins in two records, and then its frequency and damping alone
    assert {1, 5, 2} <= {*asked} and 7 not in asked
    intervals = estimate.conf_int(physical=True)
    low, high = intervals["J_c"]
    assert low < KNOWN["J_c"] < high
    assert high - low < 0.02 * KNOWN["J_c"]
    # as exactly as the simulation is
    for name in ("J_m", "K"):
        assert estimate.physical[name] == pytest.approx(KNOWN[name], rel=1e-3)
    said = " ".join(advice.what for advice in estimate.checks.advice)
    assert f"a further mass on a spring hangs on c, with a resonance of its own near {HZ:.3g} Hz" in said
