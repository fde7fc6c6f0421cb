"""Parameters that change: with time, along a position, with a load; what is said, and what intervals hold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from modelgen.array_types import FloatArray
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.varying_parameters import courses, varying_along, varying_effects
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.iv.shapes.chains import FS, KNOWN, NOISE, SHORT, TRAVEL, noisy, there_and_back


def with_more_friction(more: Callable[[dict[str, FloatArray]], FloatArray], seed: int) -> list[Record]:
    """Return a chirp and a trapezoid whose motor has more friction than the spec says.

    A motor with more friction moves as one without it whose torque is less by it.
    """
    found = []
    for kind in ("chirp", "trapezoid"):
        clean = simulate(SHORT, KNOWN, kind, fs=FS, duration_s=3.0, oversample=40).record.signals
        signals = {key: clean[key].copy() for key in NOISE}
        direction = np.sign(np.gradient(clean["q_m"], 1.0 / FS))
        signals["T"] += direction * more(signals)
        found.append(noisy(signals, seed, kind))
    return found


def with_a_belt(share: float, times: float) -> Record:
    """Return a motion over a belt whose stiffness rises by a share from end to end; `times` the noise."""

    def link(q: float, bend: float, more: float) -> tuple[float, float]:
        return KNOWN["K"] * (1.0 + share * (q / TRAVEL - 0.5)) * bend, 0.0

    return there_and_back(link, times)


def said(estimate: Estimate) -> str:
    return " ".join(one.what for one in estimate.checks.advice)


def holds(estimate: Estimate) -> bool:
    return all(abs(estimate.params[name] - KNOWN[name]) < 3.0 * estimate.bse[name] for name in KNOWN)


def test_a_chain_whose_positions_are_not_read_changes_along_none() -> None:
    rests = Record({key: np.zeros(10) for key in NOISE}, FS, "rest")
    names = [one.name for one in varying_effects(SHORT, [rests])]
    assert "course of K along q_m" in names
    assert "friction on m with the force in K" in names
    without = Record({"T": np.zeros(10)}, FS, "rest")
    assert not any("along" in one.name for one in varying_effects(SHORT, [without]))


def test_courses_go_on_or_begin_anew_or_step_from_record_to_record() -> None:
    short, long = (Record({"q_m": np.zeros(n)}, FS, str(n), str(n)) for n in (100, 300))
    assert courses([short]) == [[(0.0, 1.0)]]
    assert courses([short, long]) == [[(0.0, 0.25), (0.25, 1.0)], [(0.0, 1.0)] * 2, [(0.0, 0.0), (1.0, 1.0)]]
    for course, rms in zip(courses([short, short]), (12.0**-0.5, 12.0**-0.5, 0.5), strict=True):
        assert varying_along(course, ["K"]) == (("K", pytest.approx(rms, rel=0.15)),)


@pytest.mark.slow
@pytest.mark.parametrize("kinds", [("chirp", "trapezoid"), ("chirp", "chirp", "trapezoid")])
def test_a_record_with_another_load_is_named_though_its_rows_lose_weight(kinds: tuple[str, ...]) -> None:
    loads = [KNOWN["J_c"]] * (len(kinds) - 1) + [1.3 * KNOWN["J_c"]]
    records = []
    for place, (kind, load) in enumerate(zip(kinds, loads, strict=True)):
        clean = simulate(SHORT, {**KNOWN, "J_c": load}, kind, fs=FS, duration_s=3.0, oversample=40)
        records.append(noisy({key: clean.record.signals[key] for key in NOISE}, 5 + place, f"{kind} {place}"))
    estimate = identify(SHORT, records)
    # of two records either is the other one
    told = ["J_c is smaller in record 1 than in the other one"] if len(kinds) == 2 else []
    told += [f"J_c is larger in record {len(kinds)} than in the other"]
    assert any(one in said(estimate) for one in told)
    assert holds(estimate)
    assert 0.1 * KNOWN["J_c"] < estimate.bse["J_c"] < 0.32 * KNOWN["J_c"]
    assert estimate.bse["J_m"] < 2e-3 * KNOWN["J_m"]


@pytest.mark.slow
def test_friction_that_grows_with_the_load_is_named() -> None:
    records = with_more_friction(lambda s: 0.05 * np.abs(KNOWN["K"] * (s["q_m"] - s["q_c"])), 3)
    estimate = identify(SHORT, records)
    assert "friction on m grows with the force in K" in said(estimate)
    assert holds(estimate)
    assert estimate.bse["J_m"] < 2e-3 * KNOWN["J_m"]


@pytest.mark.slow
def test_friction_that_rises_along_the_travel_is_named() -> None:
    def more(signals: dict[str, FloatArray]) -> FloatArray:
        q = signals["q_m"]
        return np.asarray(0.2 * ((q - np.min(q)) / np.ptp(q) - 0.5))

    estimate = identify(SHORT, with_more_friction(more, 4))
    assert "Coulomb friction on m rises with q_m" in said(estimate)
    assert holds(estimate)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "times"), [(0.2, 1.0), (0.45, 0.03)])
def test_a_belt_whose_stiffness_rises_along_the_travel_is_named(share: float, times: float) -> None:
    # with less noise rows leave more than that, and what is estimated with instruments is still the cause
    estimate = identify(SHORT, with_a_belt(share, times))
    assert "K between m and c rises with q_m" in said(estimate)
    assert holds(estimate)
    assert estimate.bse["J_c"] < 5e-3 * KNOWN["J_c"]
    # evenly from end to end
    assert 0.2 * share < estimate.bse["K"] / KNOWN["K"] < 0.4 * share
