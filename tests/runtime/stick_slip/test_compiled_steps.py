"""Step by step, compiled or not, the motion is that of the blocks in `stick_slip`."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pytest

from generated import emps300_qm_qc, two_mass_bench_qm_qc
from modelgen.errors import DataError
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.closed_loop import closed_loop, default_controller
from modelgen.runtime.simulation.drive import Drive
from modelgen.runtime.simulation.plant import make_plant
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.stick_slip import compiled_steps as stepping
from modelgen.runtime.stick_slip import event_kernel as step_kernel
from modelgen.runtime.stick_slip import hybrid_system
from modelgen.runtime.stick_slip.exact_steps import integrate
from modelgen.runtime.stick_slip.hybrid_system import Event
from modelgen.runtime.stick_slip.linear_mode import CoulombBody, CubicForce, FrictionSystem

EMPS = model_from_module(emps300_qm_qc)
BENCH = model_from_module(two_mass_bench_qm_qc)
STEP = 5e-4


@pytest.fixture(params=["interpreted", "compiled"])
def steps(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """How many steps are reasonable, with the kernel as it stands or behind numba."""
    if request.param == "compiled" and not stepping.has_numba():
        pytest.skip("numba is not installed (extra fast)")
    if request.param == "interpreted":
        monkeypatch.setattr(stepping, "has_numba", lambda: False)
    stepping._kernel.cache_clear()
    yield 1500 if request.param == "interpreted" else 20000
    stepping._kernel.cache_clear()


def loop_of(name: str) -> FrictionSystem:
    if name == "bench":
        plant = make_plant(BENCH, {**BENCH.parameter_sets["reference"], "Om": 0.03, "Oc": -0.02})
    else:
        plant = make_plant(EMPS, EMPS.parameter_sets[name])
    return closed_loop(plant, default_controller(plant))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["table_1", "table_2", "light", "bench"])
def test_steps_agree_with_blocks(name: str, steps: int) -> None:
    system = loop_of(name)
    rng = np.random.default_rng(3)
    corners = np.arange(0, steps + 1, 150)
    height = 4.0 * max(body.plus for body in system.bodies)
    w = np.interp(np.arange(steps + 1), corners, rng.normal(scale=height, size=corners.size))[:, None]
    blocks = integrate(system, np.zeros(4), w, STEP, 3, compiled=False)
    single = integrate(system, np.zeros(4), w, STEP, 3, compiled=True)
    assert len(blocks.events) >= 4
    assert [(e.body, e.mode) for e in single.events] == [(e.body, e.mode) for e in blocks.events]
    np.testing.assert_allclose(
        [e.time_s for e in single.events], [e.time_s for e in blocks.events], atol=1e-10
    )
    peak = np.abs(blocks.states).max(axis=0)
    np.testing.assert_allclose(single.states / peak, blocks.states / peak, atol=1e-10)
    np.testing.assert_array_equal(single.modes, blocks.modes)


@pytest.mark.slow
def test_more_events_than_expected_are_kept(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    system = loop_of("table_2")
    w = 0.05 * np.sin(0.2 * np.arange(1001))[:, None]
    plenty = integrate(system, np.zeros(4), w, STEP, compiled=True)
    monkeypatch.setattr(stepping, "FIRST_EVENTS", 2)
    again = integrate(system, np.zeros(4), w, STEP, compiled=True)
    assert len(plenty.events) > 8
    assert again.events == plenty.events


def test_an_unstable_loop_is_explained(steps: int) -> None:
    plant = make_plant(EMPS, {**EMPS.parameter_sets["light"], "F_vm": -1.0})
    with pytest.raises(DataError, match=r"grows without bound before .* s; lower the gains"):
        integrate(
            closed_loop(plant, default_controller(plant)),
            np.ones(4), np.ones((1001, 1)), STEP, compiled=True,
        )  # fmt: skip


def interpreted(monkeypatch: pytest.MonkeyPatch, calm: int) -> None:
    monkeypatch.setattr(stepping, "has_numba", lambda: False)
    monkeypatch.setattr(step_kernel, "CALM", calm)


@pytest.mark.slow
@pytest.mark.parametrize("calm", [1, 7, 1000])
def test_it_does_not_matter_how_many_steps_are_taken_at_once(
    calm: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    w = 0.05 * np.sin(0.2 * np.arange(801))[:, None]
    drive = Drive(rate_hz=50.0, delay_s=1e-2, velocity="backward")
    found = []
    stepping._kernel.cache_clear()
    for length in (64, calm):
        interpreted(monkeypatch, length)
        path = integrate(loop_of("table_2"), np.zeros(4), w, STEP, 3, compiled=True)
        p = EMPS.parameter_sets["table_2"]
        sampled = simulate(EMPS, p, "trapezoid", fs=500.0, duration_s=0.2, drive=drive)
        found.append((path, sampled.true))
    stepping._kernel.cache_clear()
    (path, true), (other, other_true) = found
    assert len(path.events) > 8
    np.testing.assert_array_equal(other.states, path.states)
    np.testing.assert_array_equal(other.modes, path.modes)
    assert other.events == path.events
    assert set(true["mode_m"]) == {-1.0, 0.0, 1.0}
    for key, values in true.items():
        np.testing.assert_array_equal(other_true[key], values)


def test_a_motion_without_bounds_is_noticed_at_the_step_that_leaves_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plant = make_plant(EMPS, {**EMPS.parameter_sets["light"], "F_vm": -1.0})
    system = closed_loop(plant, default_controller(plant))
    said = []
    stepping._kernel.cache_clear()
    for length in (1, 64):
        interpreted(monkeypatch, length)
        with pytest.raises(DataError, match="grows without bound before") as caught:
            integrate(system, np.ones(4), np.ones((1001, 1)), STEP, compiled=True)
        said.append(str(caught.value))
    stepping._kernel.cache_clear()
    assert said[0] == said[1]


def test_more_bodies_with_friction_than_can_be_tabulated_are_refused() -> None:
    count = stepping.LARGEST_TABLE + 1
    bodies = tuple(CoulombBody(count + i, 1.0, 1.0, 1.0) for i in range(count))
    springs = (CubicForce(np.zeros(2 * count), np.zeros(2 * count)),)
    system = FrictionSystem(
        lambda mode: np.zeros((2 * count,) * 2),
        np.zeros((2 * count, 1)),
        np.zeros(2 * count),
        bodies,
        0,
        springs,
    )
    with pytest.raises(DataError, match="has 9 bodies with Coulomb friction, where 8 are possible"):
        integrate(system, np.zeros(2 * count), np.zeros((11, 1)), STEP)


def test_numba_that_does_not_go_with_other_packages_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    stepping.has_numba.cache_clear()
    assert not stepping.can_compile(loop_of("table_2"))
    stepping.has_numba.cache_clear()


def test_events_are_listed_for_who_asks_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    # thousands, where noise moves a body about rest: simulations for instruments ask for none
    made = list[Event]()
    monkeypatch.setattr(hybrid_system, "Event", lambda *given: made.append(Event(*given)) or made[-1])
    path = integrate(
        loop_of("table_1"), np.zeros(4), 0.3 * np.sin(np.arange(4000) * STEP * 20.0)[:, None], STEP
    )
    assert made == []
    assert list(path.events) == made
    assert len(made) > 1
