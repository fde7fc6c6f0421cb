"""The fused operator against the chain that it replaces, step by step with SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, cheby1, sosfiltfilt

from modelgen.errors import DataError
from modelgen.runtime.filters.allpass_states import allpass_states, responses
from modelgen.runtime.filters.block_kernels import run, scan_in_turn
from modelgen.runtime.filters.block_numpy import BlockProduct, scan
from modelgen.runtime.filters.derivatives import EIGHTH_ORDER, differentiate
from modelgen.runtime.filters.fused_operator import FusedOperator, fused_operator
from modelgen.runtime.filters.two_sided_kernel import kernels

FS = 1000.0
CENTRAL = (0.5,)


def sections(sos: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in sos.tolist())


def low_pass(cutoff: float, order: int = 4) -> np.ndarray:
    return np.asarray(butter(order, cutoff, output="sos"))


DECIMATION = np.asarray(cheby1(8, 0.05, 0.8 / 10, output="sos"))


def signal(n: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.sin(np.arange(n) * 0.01) + 0.1 * rng.standard_normal(n) + 3.0


def step_by_step(
    samples: np.ndarray,
    low: np.ndarray,
    after: np.ndarray | None,
    stencil: tuple[float, ...],
    derivative: int,
) -> np.ndarray:
    found = sosfiltfilt(low, samples)
    for _ in range(derivative):
        central = stencil == CENTRAL
        found = np.gradient(found, 1.0 / FS) if central else differentiate(found, 1.0 / FS)
    return found if after is None else np.asarray(sosfiltfilt(after, found))


@pytest.mark.parametrize("decimated", [False, True])
@pytest.mark.parametrize("stencil", [CENTRAL, EIGHTH_ORDER])
@pytest.mark.parametrize("factor", [1, 7, 10])
def test_the_interior_is_that_of_the_chain_step_by_step(
    decimated: bool, stencil: tuple[float, ...], factor: int
) -> None:
    low = low_pass(0.16)
    cascade = np.vstack([low, DECIMATION]) if decimated else low
    operator = fused_operator(sections(cascade), FS, (0, 1, 2, 3, 4), factor, stencil)
    samples = signal(16_000)
    start, count = 6001, 4000 // factor
    got = operator.apply(samples, start, count)
    for derivative in range(5):
        chain = step_by_step(samples, low, DECIMATION if decimated else None, stencil, derivative)
        expected = chain[start : start + count * factor : factor]
        scale = np.max(np.abs(expected))
        np.testing.assert_allclose(got[:, derivative], expected, rtol=0.0, atol=2e-12 * scale)


@pytest.mark.parametrize("order", [1, 2, 3, 5, 8])
def test_every_order_of_the_filter_does(order: int) -> None:
    operator = fused_operator(sections(low_pass(0.2, order)), FS, (0, 2), 4)
    samples = signal(4000)
    got = operator.apply(samples, 1500, 200)
    for column, derivative in enumerate((0, 2)):
        chain = step_by_step(samples, low_pass(0.2, order), None, EIGHTH_ORDER, derivative)[1500:2300:4]
        np.testing.assert_allclose(got[:, column], chain, rtol=0.0, atol=1e-12 * np.max(np.abs(chain)))


@pytest.mark.parametrize("cutoff", [0.03, 0.01, 0.002])
def test_a_low_cutoff_keeps_its_digits_where_differences_of_a_filtered_signal_lose_them(
    cutoff: float,
) -> None:
    # within the pass band of the filter, the fourth derivative of a sine is known
    omega = 0.3 * np.pi * cutoff
    n = int(60.0 / cutoff) * 20
    samples = np.sin(omega * np.arange(n))
    low = low_pass(cutoff)
    operator = fused_operator(sections(low), 1.0, (4,), 5)
    start, count = n // 2, 200
    got = operator.apply(samples, start, count)[:, 0]
    slope = 2.0 * sum(c * np.sin(k * omega) for k, c in enumerate(EIGHTH_ORDER, start=1))
    # prewarped bilinear Butterworth, two passes
    ratio = np.tan(omega / 2.0) / np.tan(np.pi * cutoff / 2.0)
    expected = slope**4 / (1.0 + ratio**8) * samples[start : start + 5 * count : 5]
    error = np.max(np.abs(got - expected)) / np.max(np.abs(expected))
    chain = differentiate(np.asarray(sosfiltfilt(low, samples)), 1.0, 4)[start : start + 5 * count : 5]
    by_hand = np.max(np.abs(chain - expected)) / np.max(np.abs(expected))
    # what is left is the rounding of SciPy's coefficients, relative to 1 - cos(cut-off)
    assert error < 1e-15 / cutoff**2
    assert error < 0.1 * by_hand


def test_a_polynomial_is_differentiated_exactly() -> None:
    operator = fused_operator(sections(low_pass(0.3)), 10.0, (0, 1, 2), 3)
    t = np.arange(2000) / 10.0
    polynomial = np.polynomial.Polynomial([1.0, 0.3, -0.02])
    got = operator.apply(polynomial(t), 700, 100)
    place = t[700:1000:3]
    # a zero-phase filter adds its second moment times the curvature to a parabola
    shift = got[0, 0] - polynomial(place[0])
    np.testing.assert_allclose(got[:, 0], polynomial(place) + shift, rtol=1e-12)
    np.testing.assert_allclose(got[:, 1], polynomial.deriv(1)(place), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(got[:, 2], -0.04, rtol=1e-8)


def operators(block: int | None, fast: bool | None = None) -> FusedOperator:
    cascade = sections(np.vstack([low_pass(0.1), DECIMATION]))
    return fused_operator(cascade, FS, (0, 1, 2), 10, EIGHTH_ORDER, block=block, fast=fast)


def test_blocks_change_nothing() -> None:
    samples = signal(20_000)
    expected = operators(None).apply(samples, 4000, 1000)
    for block in (10, 30, 200):
        got = operators(block).apply(samples, 4000, 1000)
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max(axis=0).max())


def test_what_lies_outside_counts_as_zero_and_is_felt_within_the_reach_only() -> None:
    operator = operators(None)
    samples = signal(20_000)
    padded = np.concatenate([np.zeros(5000), samples, np.zeros(5000)])
    whole = operator.apply(samples, -3000, 2500)
    np.testing.assert_allclose(whole, operator.apply(padded, 2000, 2500), rtol=0.0, atol=1e-9)
    changed = padded.copy()
    changed[9999] += 1e3
    far = (9999 - operator.reach - 10) // 10 * 10
    before = operator.apply(padded, far - 1000, 100)
    # a thousand at one sample is a million in the second derivative
    np.testing.assert_allclose(operator.apply(changed, far - 1000, 100), before, rtol=0.0, atol=1e-8)
    assert np.max(np.abs(operator.apply(changed, 9000, 100) - operator.apply(padded, 9000, 100))) > 1.0


def test_the_states_are_orthonormal_and_their_responses_have_the_poles_of_the_filter() -> None:
    sos = np.vstack([low_pass(0.05, 5), DECIMATION])
    A, b = allpass_states(sos)
    np.testing.assert_allclose(A @ A.T + np.outer(b, b), np.eye(len(b)), atol=1e-14)
    poles = np.concatenate([np.roots(row[3:] if row[5] else row[3:5]) for row in sos])
    np.testing.assert_allclose(np.sort(np.abs(np.linalg.eigvals(A))), np.sort(np.abs(poles)), atol=1e-11)
    table = responses(A, b, 5)
    np.testing.assert_allclose(table[4], np.linalg.matrix_power(A, 4) @ b, atol=1e-15)


def test_a_filter_that_hardly_decays_is_refused() -> None:
    with pytest.raises(DataError, match="too long to end"):
        kernels(low_pass(1e-6), (0,), CENTRAL)
    with pytest.raises(DataError, match="too long to end"):
        fused_operator(((1.0, 0.0, 0.0, 1.0, -2.0, 1.0),), FS)


def test_both_scans_carry_the_same_states() -> None:
    rng = np.random.default_rng(1)
    power = 0.9 * np.linalg.qr(rng.standard_normal((8, 8)))[0]
    powers = np.stack([np.linalg.matrix_power(power, 2**k) for k in range(9)])
    forward, backward = rng.standard_normal((40, 8)), rng.standard_normal((40, 8))
    both = np.stack([forward, backward[::-1]])
    scan(both, powers)
    expected = [both[0], both[1, ::-1]]
    state = np.zeros(8)
    for b in range(40):
        state = state @ power + forward[b]
        np.testing.assert_allclose(expected[0][b], state, atol=1e-12)
    parts = np.hstack([forward, backward])
    scan_in_turn(parts, 8, power, np.array([8, 8]))
    np.testing.assert_allclose(parts, np.hstack(expected), atol=1e-12)


@pytest.mark.parametrize("order", [3, 4])  # states that fill the compiler's four, and that do not
@pytest.mark.parametrize("stencil", [CENTRAL, EIGHTH_ORDER])
@pytest.mark.parametrize(("factor", "block"), [(1, 32), (7, 84), (7, 77), (10, 80)])
def test_loops_give_the_same_answer(
    order: int, stencil: tuple[float, ...], factor: int, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = fused_operator(sections(low_pass(0.3, order)), FS, (0, 1, 2), factor, stencil, block, fast=False)
    monkeypatch.setattr("modelgen.runtime.filters.fused_operator.compiled_run", lambda: run)
    fused_operator.cache_clear()
    loops = fused_operator(sections(low_pass(0.3, order)), FS, (0, 1, 2), factor, stencil, block, fast=True)
    fused_operator.cache_clear()
    samples = signal(2000)
    for start, count in ((900, 20), (0, 30), (-5, 9)):
        expected = plain.apply(samples, start, count)
        got = loops.apply(samples, start, count)
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_compiled_code_gives_the_same_answer() -> None:
    pytest.importorskip("numba")
    samples = signal(200_000)
    plain, fast = (operators(None, fast).apply(samples, 4000, 19_000) for fast in (False, True))
    np.testing.assert_allclose(fast, plain, rtol=0.0, atol=1e-11 * np.abs(plain).max())


def test_without_numba_numpy_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modelgen.runtime.filters.fused_operator.compiled_run", lambda: None)
    fused_operator.cache_clear()
    assert isinstance(operators(None).blocks, BlockProduct)
    with pytest.raises(DataError, match="numba cannot be imported"):
        operators(None, fast=True)
    fused_operator.cache_clear()


def test_samples_may_be_kept_farther_apart_than_the_filter_reaches() -> None:
    samples = signal(20_000)
    sos, factor = sections(low_pass(0.3)), 5_000
    every = fused_operator(sos, FS, (0, 1), 1, CENTRAL).apply(samples, 0, samples.size)
    kept = fused_operator(sos, FS, (0, 1), factor, CENTRAL).apply(samples, 1_000, 3)
    np.testing.assert_allclose(kept, every[1_000::factor][:3], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("cutoff", "way"), [(1e-6, "higher"), (1.0 - 1e-6, "lower")])
def test_a_response_that_is_too_long_asks_for_the_cutoff_that_shortens_it(cutoff: float, way: str) -> None:
    with pytest.raises(DataError, match=f"give a {way} cut-off"):
        fused_operator(sections(low_pass(cutoff)), FS, (0,), 1, CENTRAL)
