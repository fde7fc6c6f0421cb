"""Exact motion with Coulomb friction: against closed solutions, an ODE solver with events, and itself."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from functools import partial
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import ellipj

from modelgen.errors import DataError
from modelgen.runtime.stick_slip.compiled_steps import follow_input, has_numba
from modelgen.runtime.stick_slip.exact_steps import LARGEST_BLOCK
from modelgen.runtime.stick_slip.exact_steps import integrate as integrate_by_any
from modelgen.runtime.stick_slip.hybrid_system import Flow, refinement
from modelgen.runtime.stick_slip.linear_mode import CoulombBody, CubicForce, FrictionSystem, Mode

STEP = 1e-3
# the compiled steps are compared with these in test_stepping.py
integrate = partial(integrate_by_any, compiled=False)


def chain(
    inertia: tuple[float, ...],
    stiffness: tuple[float, ...] = (),
    damping: tuple[float, ...] = (),
    ground: float = 0.0,
    coulomb: dict[int, tuple[float, float]] | None = None,
    viscous: dict[int, tuple[float, float]] | None = None,
    offset: tuple[float, ...] | None = None,
    cubic: tuple[float, ...] = (),
) -> FrictionSystem:
    """Bodies in a line, driven by a force on the first; `ground` ties the first to the ground."""
    n = len(inertia)
    J = np.array(inertia)
    K, D = np.zeros((n, n)), np.zeros((n, n))
    for matrix, values in ((K, stiffness), (D, damping)):
        for i, value in enumerate(values):
            matrix[i : i + 2, i : i + 2] += value * np.array([[1.0, -1.0], [-1.0, 1.0]])
    K[0, 0] += ground
    bodies = tuple(CoulombBody(n + i, inertia[i], *sides) for i, sides in (coulomb or {}).items())

    def matrix(mode: Mode) -> np.ndarray:
        own = np.zeros(n)
        for body, sign in zip(bodies, mode, strict=True):
            own[body.velocity - n] = (viscous or {}).get(body.velocity - n, (0.0, 0.0))[sign < 0]
        lower = np.hstack((-K, -D - np.diag(own))) / J[:, None]
        return np.vstack((np.hstack((np.zeros((n, n)), np.eye(n))), lower))

    B = np.zeros((2 * n, 1))
    B[n] = 1.0 / J[0]
    drift = np.r_[np.zeros(n), -np.array(offset or (0.0,) * n) / J]
    levers = [np.eye(n)[i] - np.eye(n)[i + 1] for i in range(len(cubic))]
    none = np.zeros(n)
    springs = tuple(
        CubicForce(np.r_[c, none], np.r_[none, -k * c / J]) for c, k in zip(levers, cubic, strict=True)
    )
    return FrictionSystem(matrix, B, drift, bodies, springs=springs)


def force(times: np.ndarray, values: list[float], step: float, end: float) -> np.ndarray:
    t = np.arange(round(end / step) + 1) * step
    return np.interp(t, times, values)[:, None]


def solver_motion(
    system: FrictionSystem, initial: np.ndarray, w: Callable[[float], float], end: float
) -> tuple[np.ndarray, list[tuple[float, int, int]]]:
    """The same motion by an ODE solver that stops at every event: independent of the code under test."""
    t, x, events = 0.0, np.array(initial), []

    def free(t: float, x: np.ndarray, mode: Mode) -> np.ndarray:
        pulled = sum(spring.push * (spring.deflection @ x) ** 3 for spring in system.springs)
        return system.matrix(mode) @ x + system.B[:, 0] * w(t) + system.drift + pulled

    def rate(t: float, x: np.ndarray, mode: Mode) -> np.ndarray:
        change = free(t, x, mode)
        for body, sign in zip(system.bodies, mode, strict=True):
            change[body.velocity] -= (body.plus if sign > 0 else -body.minus) / body.inertia
            change[body.velocity] *= sign != 0
        return change

    def at_rest(body: CoulombBody, t: float, x: np.ndarray, mode: Mode) -> int:
        net = free(t, x, mode)[body.velocity] * body.inertia
        return int(net > body.plus) - int(net < -body.minus)

    mode = tuple(
        int(np.sign(x[b.velocity])) or at_rest(b, t, x, (0,) * len(system.bodies)) for b in system.bodies
    )
    while t < end:
        guards = []
        for body, sign in zip(system.bodies, mode, strict=True):
            if sign:
                guards.append(lambda t, x, b=body, s=sign: s * x[b.velocity])
            else:
                guards.append(
                    lambda t, x, b=body, m=mode: max(
                        free(t, x, m)[b.velocity] * b.inertia - b.plus,
                        -free(t, x, m)[b.velocity] * b.inertia - b.minus,
                    )
                )
        for guard, sign in zip(guards, mode, strict=True):
            guard.terminal, guard.direction = True, -1 if sign else 1  # type: ignore[attr-defined]
        found = solve_ivp(
            lambda t, x, m=mode: rate(t, x, m), (t, end), x, method="DOP853", rtol=1e-12, atol=1e-13,
            events=guards, max_step=2e-3,
        )  # fmt: skip
        t, x = float(found.t[-1]), found.y[:, -1].copy()
        if found.status != 1:
            break
        j = next(i for i, times in enumerate(found.t_events) if times.size)
        body = system.bodies[j]
        if mode[j]:
            x[body.velocity] = 0.0
            follow = at_rest(body, t, x, mode)
            follow = 0 if follow == mode[j] else follow
        else:
            follow = 1 if free(t, x, mode)[body.velocity] > 0.0 else -1
            x[body.velocity] = follow * 1e-15  # past its own event
        mode = (*mode[:j], follow, *mode[j + 1 :])
        events.append((t, j, follow))
    return x, events


def test_a_body_slows_down_on_a_parabola_and_stops_at_the_exact_time() -> None:
    inertia, friction, speed = 2.0, 3.0, 1.0
    system = chain((inertia,), coulomb={0: (friction, friction)})
    path = integrate(system, np.array([0.5, speed]), np.zeros((1001, 1)), STEP)
    stop = inertia * speed / friction
    (event,) = path.events
    assert event.time_s == pytest.approx(stop, abs=1e-14)
    assert (event.body, event.mode) == (0, 0)
    t = np.minimum(np.arange(1001) * STEP, stop)
    np.testing.assert_allclose(
        path.states[:, 0], 0.5 + speed * t - 0.5 * friction / inertia * t**2, atol=1e-13
    )
    rests = path.modes[:, 0] == 0
    assert rests.sum() == 1001 - 667
    assert np.all(path.states[rests, 1] == 0.0)
    assert np.all(path.states[rests, 0] == path.states[-1, 0])


def test_below_breakaway_a_body_does_not_move_at_all() -> None:
    system = chain((2.0,), coulomb={0: (3.0, 1.0)}, offset=(0.5,))
    # net of the offset, the force stays within -1 and 3
    w = force(np.array([0.0, 1.0, 2.0]), [0.0, 3.499999, -0.499999], STEP, 2.0)
    path = integrate(system, np.array([7.0, 0.0]), w, STEP)
    assert path.events == ()
    assert np.all(path.states == [7.0, 0.0])


def test_at_its_very_limit_a_body_still_sticks() -> None:
    path = integrate(chain((2.0,), coulomb={0: (3.0, 3.0)}), np.zeros(2), np.full((101, 1), 3.0), STEP)
    assert path.events == ()
    assert np.all(path.states == 0.0)


@pytest.mark.parametrize(("direction", "limit"), [(1, 3.0), (-1, 1.0)])
def test_a_body_breaks_away_at_the_exact_time(direction: int, limit: float) -> None:
    slope = 7.0
    system = chain((2.0,), coulomb={0: (3.0, 1.0)})
    w = direction * slope * np.arange(1001)[:, None] * STEP
    path = integrate(system, np.zeros(2), w, STEP)
    (event,) = path.events
    start = limit / slope
    assert event.time_s == pytest.approx(start, abs=1e-15)
    assert event.mode == direction
    moved = np.maximum(np.arange(1001) * STEP - start, 0.0)
    np.testing.assert_allclose(path.states[:, 0], direction * slope / 2.0 * moved**3 / 6.0, atol=1e-14)
    np.testing.assert_allclose(path.states[:, 1], direction * slope / 2.0 * moved**2 / 2.0, atol=1e-14)


def test_a_strong_force_reverses_the_motion_without_a_rest() -> None:
    path = integrate(
        chain((2.0,), coulomb={0: (3.0, 3.0)}), np.array([0.0, 1.0]), np.full((1001, 1), -9.0), STEP
    )
    (event,) = path.events
    assert event.time_s == pytest.approx(1.0 / 6.0, abs=1e-15)
    assert event.mode == -1
    assert path.states[-1, 1] == pytest.approx(-3.0 * (1.0 - 1.0 / 6.0), abs=1e-13)


def test_two_bodies_that_stop_at_the_same_instant() -> None:
    system = chain((1.0, 1.0), (50.0,), coulomb={0: (2.0, 2.0), 1: (2.0, 2.0)})
    path = integrate(system, np.array([0.0, 0.0, 1.0, 1.0]), np.zeros((1001, 1)), STEP)
    assert [event.mode for event in path.events] == [0, 0]
    assert [event.time_s for event in path.events] == pytest.approx([0.5, 0.5], abs=1e-13)
    np.testing.assert_allclose(path.states[-1], [0.25, 0.25, 0.0, 0.0], atol=1e-13)


def test_smooth_motion_agrees_with_an_ode_solver() -> None:
    system = chain((1.0, 0.2, 0.5), (900.0, 300.0), (0.5, 0.1), ground=50.0)
    step = 0.02
    w = np.random.default_rng(1).normal(scale=20.0, size=(26, 1))
    x = np.array([0.1, 0.0, -0.1, 0.0, 2.0, 1.0])
    path = integrate(system, x, w, step)
    A, B = system.matrix(()), system.B[:, 0]
    for k in range(25):  # from node to node, between which the input is smooth
        found = solve_ivp(
            lambda t, x, k=k: A @ x + B * (w[k, 0] + (w[k + 1, 0] - w[k, 0]) * t / step),
            (0.0, step), x, method="DOP853", rtol=1e-13, atol=1e-14,
        )  # fmt: skip
        x = found.y[:, -1]
        np.testing.assert_allclose(path.states[k + 1], x, rtol=1e-10, atol=1e-11)


def test_free_bodies_keep_their_momentum_and_their_mode_for_ten_seconds() -> None:
    J = np.array([1e-5, 7e-7])
    K = 0.38
    speed, swing = 100.0, 20.0
    omega = np.sqrt(K * (1.0 / J).sum())
    initial = np.array([0.0, 0.0, speed + swing * J[1] / J.sum(), speed - swing * J[0] / J.sum()])
    step = 2.5e-5
    path = integrate(chain(tuple(J), (K,)), initial, np.zeros((400001, 1)), step, stride=8)
    t = np.arange(50001) * 8 * step
    deflection = path.states[:, 0] - path.states[:, 1]
    np.testing.assert_allclose(path.states[:, 2:] @ J, speed * J.sum(), rtol=5e-9)
    np.testing.assert_allclose(path.states[:, :2] @ J / J.sum(), speed * t, rtol=5e-9, atol=1e-12)
    np.testing.assert_allclose(deflection, swing / omega * np.sin(omega * t), atol=1e-9 * swing / omega)


@pytest.mark.slow
def test_stick_slip_of_a_pulled_body_agrees_with_an_ode_solver() -> None:
    system = chain((0.8,), ground=40.0, coulomb={0: (2.5, 1.7)}, viscous={0: (0.3, 0.9)}, offset=(0.2,))

    step, end = 1e-3, 3.0
    nodes = np.arange(3001) * step
    pull = np.interp(
        nodes, [0.0, 0.4, 0.9, 1.3, 1.4, 2.1, 2.2, 3.0], [0.0, 8.0, 0.0, 3.0, 3.0, -9.0, 3.0, 1.0]
    )
    path = integrate(system, np.zeros(2), pull[:, None], step)
    x, events = solver_motion(system, np.zeros(2), lambda t: float(np.interp(t, nodes, pull)), end)
    assert {mode for _, _, mode in events} == {1, 0, -1}
    assert [event.mode for event in path.events] == [mode for _, _, mode in events]
    np.testing.assert_allclose([event.time_s for event in path.events], [t for t, _, _ in events], atol=1e-8)
    np.testing.assert_allclose(path.states[-1], x, atol=1e-8)


@pytest.mark.slow
def test_two_sticking_bodies_agree_with_an_ode_solver() -> None:
    system = chain(
        (0.5, 0.3), (60.0,), (0.05,), ground=20.0,
        coulomb={0: (1.0, 0.7), 1: (0.8, 1.1)}, viscous={0: (0.1, 0.4), 1: (0.2, 0.0)}, offset=(0.1, -0.2),
    )  # fmt: skip
    step, end = 1e-3, 2.0
    nodes = np.arange(2001) * step
    w = np.interp(nodes, [0.0, 0.3, 0.6, 1.0, 1.4, 2.0], [0.0, 5.0, -6.0, 0.0, 0.0, 4.0])
    initial = np.array([0.0, 0.1, 0.5, -0.4])
    path = integrate(system, initial, w[:, None], step)
    x, events = solver_motion(system, initial, lambda t: float(np.interp(t, nodes, w)), end)
    assert {body for _, body, _ in events} == {0, 1}
    assert 0 in {mode for _, _, mode in events}
    assert [(event.body, event.mode) for event in path.events] == [(body, mode) for _, body, mode in events]
    np.testing.assert_allclose([event.time_s for event in path.events], [t for t, _, _ in events], atol=1e-8)
    np.testing.assert_allclose(path.states[-1], x, atol=1e-8)


def random_chain(rng: np.random.Generator) -> FrictionSystem:
    n = int(rng.integers(2, 5))
    return chain(
        tuple(10.0 ** rng.uniform(-1.0, 1.0, n)),
        tuple(10.0 ** rng.uniform(1.0, 3.5, n - 1)),
        tuple(10.0 ** rng.uniform(-3.0, 1.0, n - 1)),
        ground=200.0,
        coulomb={i: (float(rng.uniform(0.1, 2.0)), float(rng.uniform(0.1, 2.0))) for i in range(n)},
        viscous={i: (float(rng.uniform(0.0, 1.0)), float(rng.uniform(0.0, 1.0))) for i in range(n)},
    )


@pytest.mark.parametrize("seed", range(8))
def test_every_mode_keeps_its_promise_whatever_the_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    system = random_chain(rng)
    n = len(system.bodies)
    t = np.arange(4001) * STEP
    w = 40.0 * np.sin(6.0 * t + t**2)[:, None] + 10.0
    path = integrate(system, np.zeros(2 * n), w, STEP)
    assert len(path.events) > 10
    v = path.states[:, n:]
    assert np.all(v * path.modes >= -1e-12)
    assert np.all(v[path.modes == 0] == 0.0)
    net = path.states @ system.matrix((0,) * n).T + w @ system.B.T
    for j, body in enumerate(system.bodies):
        held = net[path.modes[:, j] == 0, body.velocity] * body.inertia
        assert np.all((held <= body.plus) & (held >= -body.minus))
    # a step that is divided into three is the same step
    fine = np.interp(np.arange(12001) / 3.0, np.arange(4001), w[:, 0])[:, None]
    again = integrate(system, np.zeros(2 * n), fine, STEP / 3.0, stride=3)
    np.testing.assert_allclose(again.states, path.states, atol=1e-10)
    np.testing.assert_array_equal(again.modes, path.modes)
    np.testing.assert_allclose([e.time_s for e in again.events], [e.time_s for e in path.events], atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_the_matrices_of_all_modes_follow_from_two(seed: int) -> None:
    system = random_chain(np.random.default_rng(seed))
    flow = Flow(system, STEP)
    for mode in product((-1, 0, 1), repeat=len(system.bodies)):
        expected = STEP * flow.scale[:, None] * system.matrix(mode) / flow.scale
        held = [body.velocity for body, sign in zip(system.bodies, mode, strict=True) if sign == 0]
        expected[held], expected[:, held] = 0.0, 0.0
        np.testing.assert_array_equal(flow.motion(mode).M[: flow.scale.size, : flow.scale.size], expected)


@pytest.mark.parametrize("seed", range(4))
def test_without_input_the_energy_only_falls(seed: int) -> None:
    rng = np.random.default_rng(seed)
    system = random_chain(rng)
    n = len(system.bodies)
    path = integrate(system, np.r_[np.zeros(n), rng.normal(size=n)], np.zeros((20001, 1)), STEP)
    J = np.array([body.inertia for body in system.bodies])
    K = -system.matrix((1,) * n)[n:, :n] * J[:, None]
    energy = 0.5 * (path.states[:, n:] ** 2 @ J + ((path.states[:, :n] @ K) * path.states[:, :n]).sum(axis=1))
    assert np.all(np.diff(energy) <= 1e-13 * energy[0])
    assert energy[-1] < 0.9 * energy[0]
    assert np.all(path.modes[-1] == 0)


def test_a_reversal_that_begins_and_ends_within_one_step_is_not_missed() -> None:
    system = chain((1.0,), coulomb={0: (0.1, 0.1)})
    step = 0.5
    coarse = integrate(system, np.array([0.0, 0.1]), np.array([[-1.2], [2.0]]), step)
    fine = np.linspace(-1.2, 2.0, 1001)[:, None]
    exact = integrate(system, np.array([0.0, 0.1]), fine, step / 1000, stride=1000)
    assert coarse.states[-1, 1] > 0.0  # the nodes show no reversal
    assert [event.mode for event in coarse.events] == [-1, 1]
    # v = 0.1 - 1.3 t + 3.2 t^2 up to the first event
    assert coarse.events[0].time_s == pytest.approx((1.3 - (1.69 - 1.28) ** 0.5) / 6.4, abs=1e-15)
    np.testing.assert_allclose(
        [e.time_s for e in coarse.events], [e.time_s for e in exact.events], atol=1e-13
    )
    np.testing.assert_allclose(coarse.states, exact.states, atol=1e-13)


def test_a_body_that_only_touches_rest_goes_on() -> None:
    # v = (1 - t)^2
    path = integrate(
        chain((1.0,), coulomb={0: (0.5, 0.5)}), np.array([0.0, 1.0]), np.array([[-1.5], [2.5]]), 2.0
    )
    assert {event.mode for event in path.events} <= {0, 1}
    np.testing.assert_allclose(path.states[-1], [2.0 / 3.0, 1.0], atol=1e-7)


def test_a_stiff_link_divides_the_steps() -> None:
    system = chain((1.0, 1.0), (1e6,), (20.0,), coulomb={0: (0.5, 0.5), 1: (0.5, 0.5)})
    initial = np.array([0.0, 0.0, -3.0, 3.1])
    w = force(np.array([0.0, 0.1, 0.3]), [0.0, 30.0, -30.0], 5e-3, 0.3)
    coarse = integrate(system, initial, w, 5e-3)
    fine = force(np.array([0.0, 0.1, 0.3]), [0.0, 30.0, -30.0], 5e-5, 0.3)
    exact = integrate(system, initial, fine, 5e-5, stride=100)
    assert len(exact.events) > 50
    np.testing.assert_allclose(coarse.states, exact.states, atol=1e-10)
    np.testing.assert_allclose(
        [e.time_s for e in coarse.events], [e.time_s for e in exact.events], atol=1e-11
    )


@pytest.mark.parametrize(("stiffness", "damping", "parts"), [(4.5e8, 0.0, 16), (5.0, 25e3, 28)])
def test_a_part_spans_two_radians_or_two_time_constants(stiffness: float, damping: float, parts: int) -> None:
    # 30 rad, or 50 time constants, a step; the norm of its matrix alone had asked for 451 and 26 parts
    system = chain((1.0, 1.0), (stiffness,), (damping,))
    assert 0.9 * parts < refinement(system, STEP) <= parts


def test_a_sticking_body_does_not_creep_beside_a_stiff_vibration() -> None:
    system = chain((1.0, 1.0), (1.5e6,), coulomb={0: (1e9, 1e9)})
    path = integrate(system, np.array([0.1, 0.2, 0.0, 1.0]), np.zeros((10001, 1)), STEP)
    assert np.ptp(path.states[:, 1]) > 0.19
    assert np.all(path.states[:, 0] == 0.1)


def test_a_motion_too_fast_for_the_step_is_refused() -> None:
    with pytest.raises(DataError, match="too fast"):
        integrate(chain((1.0, 1.0), (1e14,)), np.zeros(4), np.zeros((3, 1)), 1.0)


def test_unbounded_motion_is_refused() -> None:
    with pytest.raises(DataError, match=r"grows without bound before .*; lower the gains"):
        integrate(chain((1.0,), ground=-1e4), np.array([1.0, 0.0]), np.zeros((20001, 1)), STEP)


def test_stride_keeps_every_so_many_steps() -> None:
    system = chain((2.0,), coulomb={0: (3.0, 3.0)})
    w = 10.0 * np.sin(np.arange(2001) * 0.02)[:, None]
    every = integrate(system, np.zeros(2), w, STEP)
    some = integrate(system, np.zeros(2), w, STEP, stride=7)
    np.testing.assert_array_equal(some.states, every.states[::7])
    np.testing.assert_array_equal(some.modes, every.modes[::7])
    assert some.events == every.events


def test_a_hardening_spring_swings_as_its_elliptic_function_says() -> None:
    # two free bodies: their deflection r follows mu r'' + K r + K3 r^3 = 0, Duffing's equation
    J, K, K3, wide = (2.0, 0.5), 30.0, 5e3, 0.2
    step, end = 2e-3, 10.0
    system = chain(J, (K,), cubic=(K3,))
    mu, total = J[0] * J[1] / sum(J), sum(J)
    initial = np.array([wide * J[1] / total, -wide * J[0] / total, 0.0, 0.0])
    path = integrate(system, initial, np.zeros((round(end / step) + 1, 1)), step)
    omega = np.sqrt((K + K3 * wide**2) / mu)
    t = np.arange(len(path.states)) * step
    exact = wide * ellipj(omega * t, 0.5 * K3 * wide**2 / (K + K3 * wide**2))[1]
    np.testing.assert_allclose(path.states[:, 0] - path.states[:, 1], exact, atol=1e-9 * wide)
    # far from a harmonic swing
    assert np.abs(exact - wide * np.cos(omega * t)).max() > wide


@pytest.mark.slow
def test_stick_slip_beside_a_hardening_spring_agrees_with_an_ode_solver() -> None:
    system = chain(
        (0.5, 0.3), (60.0,), (0.05,), ground=20.0, coulomb={0: (1.0, 0.7), 1: (0.8, 1.1)},
        viscous={0: (0.1, 0.4), 1: (0.2, 0.0)}, offset=(0.1, -0.2), cubic=(4e4,),
    )  # fmt: skip
    step, end = 1e-3, 10.0
    nodes = np.arange(10001) * step
    w = np.interp(nodes, np.arange(21) * 0.5, [0.0, 6.0, -6.0, 0.0, 0.0, 4.0, -9.0] * 3)
    initial = np.array([0.0, 0.1, 0.5, -0.4])
    path = integrate(system, initial, w[:, None], step)
    x, events = solver_motion(system, initial, lambda t: float(np.interp(t, nodes, w)), end)
    deflection = path.states[:, 0] - path.states[:, 1]
    assert 4e4 * np.abs(deflection).max() ** 2 > 3.0 * 60.0
    assert len(events) > 40
    assert [(event.body, event.mode) for event in path.events] == [(body, mode) for _, body, mode in events]
    peak = np.abs(path.states[:, :2]).max()
    np.testing.assert_allclose(path.states[-1, :2], x[:2], atol=1e-9 * peak)
    np.testing.assert_allclose([event.time_s for event in path.events], [t for t, _, _ in events], atol=1e-8)


def test_a_step_too_long_for_its_series_is_taken_in_parts() -> None:
    system = chain((0.5, 0.3), (60.0,), (0.05,), coulomb={1: (0.8, 1.1)}, cubic=(4e6,))
    initial = np.array([0.0, 0.1, 0.5, -0.4])
    coarse = integrate(system, initial, np.zeros((11, 1)), 0.05)
    fine = integrate(system, initial, np.zeros((10001, 1)), 5e-5, stride=1000)
    assert len(fine.events) > 10
    np.testing.assert_allclose(coarse.states, fine.states, atol=1e-10)
    np.testing.assert_allclose([e.time_s for e in coarse.events], [e.time_s for e in fine.events], atol=1e-11)


def test_a_spring_that_softens_until_it_gives_way_is_no_motion() -> None:
    system = chain((1.0, 1.0), (10.0,), cubic=(-100.0,))
    with pytest.raises(DataError, match="grows without bound"):
        integrate(system, np.array([0.5, -0.5, 0.0, 0.0]), np.zeros((2001, 1)), 1e-2)


def peak_bytes(work: Callable[[], object]) -> int:
    """Return how far the memory of NumPy and Python rises during a call."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def stiff_chain(damping: float) -> FrictionSystem:
    return chain((1.0, 1.0), (50.0,), (damping,), ground=20.0, coulomb={0: (0.5, 0.3)})


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [True, False])
@given(damping=st.floats(1e4, 0.95e6))
@settings(max_examples=8)
def test_a_stiff_chain_takes_no_more_memory_for_more_steps(compiled: bool, damping: float) -> None:
    if compiled and not has_numba():
        compiled, damping = False, min(damping, 1e5)  # each step by the interpreter would take too long
    system = stiff_chain(damping)
    parts = refinement(system, STEP)
    assert parts > 1

    def work(steps: int) -> Callable[[], object]:
        nodes = 1 + steps // parts
        w = 4.0 * np.sin(np.linspace(0.0, 6.0, nodes))[:, None]
        return lambda: integrate_by_any(system, np.zeros(4), w, STEP, nodes - 1, compiled=compiled)

    work(parts)()  # loads what is loaded once
    few, many = peak_bytes(work(6 * LARGEST_BLOCK)), peak_bytes(work(24 * LARGEST_BLOCK))
    # the input alone, at every step, would take 8 bytes a step more
    assert many < few + 8 * 18 * LARGEST_BLOCK // 2


@given(damping=st.floats(1e3, 2e4), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_an_input_between_its_nodes_is_that_at_every_step_to_the_bit(damping: float, seed: int) -> None:
    system = stiff_chain(damping)
    parts = refinement(system, STEP)
    w = np.random.default_rng(seed).normal(scale=4.0, size=(41, 1))
    place = np.arange(40 * parts + 1) / parts
    i = np.minimum(place.astype(int), 39)
    every = w[i, 0] + (place - i) * (w[i + 1, 0] - w[i, 0])
    flow = Flow(system, STEP / parts)
    known, between = (
        follow_input(flow, np.zeros(4), every, 7),
        follow_input(flow, np.zeros(4), w[:, 0], 7, parts),
    )
    assert np.array_equal(known.states, between.states)
    assert np.array_equal(known.modes, between.modes)
    assert known.events == between.events
