"""A link that creeps: its column, what a step of its frequency does, and what identify says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lsim

from modelgen.runtime.curves.rebuilt import rebuild
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.iv.effect import Effect
from modelgen.runtime.iv.shapes.creep import creep, spread_creep
from modelgen.runtime.iv.shapes.further_mass import further_mass
from modelgen.runtime.records.record import Record
from tests.runtime.iv.shapes.chains import FS, KNOWN, SHORT, noisy, simulated_alone, there_and_back

# By how much the link is stiffer in fast motion, over K, and from which frequency in Hz on.
SHARE, HZ = 0.3, 40.0


@pytest.mark.parametrize("link", [creep("K", HZ), spread_creep("K", 0.5, 500.0, 0.2)])
def test_a_step_of_the_shape_changes_the_effect_as_its_column_says(link: Effect) -> None:
    simulated, size, step = simulated_alone(), 0.1, 1e-4
    assert link.moved is not None
    near = [link.moved(size, [sign * size * step]) for sign in (1.0, -1.0)]
    more, less = (one.changes(simulated)["q_c"] for one in near)
    (shape,) = link.shape(1)
    expected = shape.changes(simulated)["q_c"]
    scale = float(np.max(np.abs(expected)))
    np.testing.assert_allclose((more - less) / (2.0 * step), expected, atol=1e-5 * scale)


def test_creep_far_above_the_motion_is_a_damper_and_far_below_a_spring() -> None:
    simulated = simulated_alone()
    fast, slow = (creep("K", hz).changes(simulated)["q_c"] for hz in (1e4, 2e4))
    np.testing.assert_allclose(fast, 2.0 * slow, atol=0.05 * float(np.max(np.abs(fast))))
    stiff, too = (creep("K", hz).changes(simulated)["q_c"] for hz in (1e-4, 2e-4))
    np.testing.assert_allclose(stiff, too, atol=1e-3 * float(np.max(np.abs(stiff))))


def test_steps_lead_to_no_frequency_that_a_record_does_not_hold() -> None:
    simulated = simulated_alone()
    link = creep("K", HZ, 30.0)
    for _ in range(3):
        assert link.moved is not None
        link = link.moved(0.1, [-0.1])
    expected = creep("K", 30.0).changes(simulated)["q_c"]
    np.testing.assert_array_equal(link.changes(simulated)["q_c"], expected)
    mass, same = further_mass("c", HZ, 0.1, 30.0), further_mass("c", 30.0, 0.1)
    for _ in range(3):
        assert mass.moved is not None
        mass = mass.moved(0.1, [-0.1, 0.0])
    np.testing.assert_allclose(mass.changes(simulated)["q_c"], same.changes(simulated)["q_c"])


def test_creep_at_all_frequencies_is_that_at_each_and_its_tilt_has_limits() -> None:
    simulated = simulated_alone()
    spread = spread_creep("K", 1.0, 100.0).changes(simulated)["q_c"]
    parts = [0.5 * creep("K", hz).changes(simulated)["q_c"] for hz in np.geomspace(1.0, 100.0, 5)]
    np.testing.assert_allclose(spread, np.sum(parts, axis=0), atol=1e-9 * float(np.max(np.abs(spread))))
    link = spread_creep("K", 1.0, 100.0)
    for _ in range(20):
        assert link.moved is not None
        link = link.moved(0.1, [1.0])
    steepest = spread_creep("K", 1.0, 100.0, 1.0).changes(simulated)["q_c"]
    np.testing.assert_array_equal(link.changes(simulated)["q_c"], steepest)
    assert "at all frequencies" in link.said(5.0) and not link.possible(-1.0)


def test_its_size_is_said_and_it_never_softens() -> None:
    link = creep("K", HZ)
    assert link.possible(1.0) and not link.possible(-1.0)
    assert "creeps" in link.said(56.4) and link.said(56.4).endswith("from some 40 Hz on (by 56.4)")


@pytest.mark.slow
@pytest.mark.parametrize("times", [1.0, 0.1])
def test_a_link_that_creeps_is_found_and_named(times: float) -> None:
    rate = 2.0 * np.pi * HZ

    def link(q: float, bend: float, crept: float) -> tuple[float, float]:
        return KNOWN["K"] * (bend + SHARE * (bend - crept)), rate * (bend - crept)

    records = [there_and_back(link, times)]
    estimate = identify(SHORT, records)
    said = " ".join(one.what for one in estimate.checks.advice)
    assert "the link of K creeps" in said
    assert f"from some {HZ:.2g} Hz on" in said
    for name in KNOWN:
        assert abs(estimate.params[name] - KNOWN[name]) < 3.0 * estimate.bse[name]
    for name, share in (("J_m", 5e-3), ("J_c", 5e-3), ("K", 0.03)):
        assert estimate.bse[name] < share * KNOWN[name]
    # curves are rebuilt with what was estimated besides
    for row, entry in zip(rebuild(SHORT, records, estimate)[0], estimate.fit.rows, strict=True):
        left = float(np.sqrt(np.nanmean(row.residual**2)))
        assert left == pytest.approx(entry.residual_rms, rel=1e-9)


def belt(way: float, times: float) -> Record:
    """Return a motion one way, a multisine on it, with a link that creeps at 0.5, 5 and 50 Hz."""
    p, hz, finer = KNOWN, np.array([0.5, 5.0, 50.0]), 10
    t, lines = np.arange(6000 * finer) / (FS * finer), 2.0 * np.pi * np.arange(1.0, 160.0, 3.0)
    phases, rates = np.random.default_rng(int(5 + way)).uniform(0.0, 6.3, len(lines)), 2.0 * np.pi * hz
    force = p["F_vm"] * 20.0 * way + 0.3 * np.sum(np.sin(np.multiply.outer(t, lines) + phases), axis=-1)
    crept = 0.02 * p["K"] * np.ones(3)
    link = np.concatenate([np.array([1.0, -1.0]) * (p["K"] + crept.sum()), [p["D"], -p["D"]], -crept])
    A = np.zeros((7, 7))
    A[0, 2] = A[1, 3] = 1.0
    A[2], A[3] = -link / p["J_m"], link / p["J_c"]
    A[2, 2] -= p["F_vm"] / p["J_m"]
    A[4:, 0], A[4:, 1], A[4:, 4:] = rates, -rates, -np.diag(rates)
    push = np.zeros((7, 1))
    push[2] = 1.0 / p["J_m"]
    begun = np.array([0.0, 0.0, 20.0 * way, 20.0 * way, 0.0, 0.0, 0.0])
    x = lsim((A, push, np.eye(7), np.zeros((7, 1))), force, t, begun)[2]
    assert np.all(way * x[:, 2] > 0.0)
    read = {"q_m": x[::finer, 0], "q_c": x[::finer, 1], "T": (force + p["F_sm"] * way)[::finer]}
    return noisy(read, 0, f"{way}", times)


@pytest.mark.slow
def test_a_belt_that_noise_nearly_hides_is_found_and_the_intervals_hold_the_truth() -> None:
    """Without it K is 6.7 standard deviations off: no row leaves much more than noise."""
    estimate = identify(SHORT, [belt(way, 5.0) for way in (1.0, -1.0)])
    assert "the link of K creeps" in " ".join(one.what for one in estimate.checks.advice)
    for name, value in KNOWN.items():
        assert abs(estimate.params[name] - value) < 2.5 * estimate.bse[name]
    assert estimate.bse["K"] < 0.03 * KNOWN["K"]
