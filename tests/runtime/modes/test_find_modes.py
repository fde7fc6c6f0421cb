"""Modes of random chains against the eigenvalues of their state space, and what may be left open."""

from __future__ import annotations

import random

import numpy as np
import pytest

from generated import emps300_qm_qc, emps_rigid_asymmetric_qm
from modelgen.cli.candidates import spec_model
from modelgen.errors import ModelgenError
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.modes.find_modes import find_modes, modes_at
from modelgen.runtime.modes.modes import Modes
from modelgen.runtime.modes.uncertain_chain import uncertain_chain
from modelgen.spec.load import parse_spec
from tests.symbolic.random_chains import random_spec

AXIS = model_from_module(emps300_qm_qc)


def any_chain(seed: int) -> tuple[Model, dict[str, float]]:
    """A chain, tree or loop with gears and links to ground; damped from next to nothing to far too much."""
    rng = random.Random(seed)
    while True:
        try:
            model = spec_model(parse_spec(random_spec(rng), "chain.toml"), "set")
        except ModelgenError:
            continue
        level = 10.0 ** rng.uniform(-3.0, 1.5)
        scale = {"damping": level, "viscous": level, "stiffness": 50.0, "inertia": 1.0}
        return model, {
            name: scale.get(role.role, 1.0) * rng.uniform(0.5, 2.0) for name, role in model.roles.items()
        }


def poles_of(found: Modes) -> np.ndarray:
    poles: list[complex] = []
    for mode in found:
        if mode.frequency_hz is None:
            poles += [0.0, *(-1.0 / one.value for one in mode.time_constants_s)]
            poles += [0.0] * (not mode.time_constants_s)
            continue
        assert mode.damping_ratio is not None
        omega, zeta = 2.0 * np.pi * mode.frequency_hz.value, mode.damping_ratio.value
        poles += [complex(-zeta * omega) + sign * omega * np.sqrt(complex(zeta**2 - 1.0)) for sign in (1, -1)]
        if mode.name == "creeps":
            assert sorted(-1.0 / one.value for one in mode.time_constants_s) == pytest.approx(
                sorted(p.real for p in poles[-2:])
            )
    return np.array(poles)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_poles_are_those_of_the_state_space(seed: int) -> None:
    model, values = any_chain(seed)
    space = model.state_space(values, {f.body: 1 for f in model.friction})
    expected = np.linalg.eigvals(space.A)
    found = modes_at(model, values)
    poles = poles_of(found)
    assert len(poles) == len(expected)
    size = max(float(np.abs(expected).max()), 1.0)
    apart = np.abs(poles[:, None] - expected[None, :])
    assert apart.min(axis=1).max() < 1e-6 * size
    assert apart.min(axis=0).max() < 1e-6 * size
    # a force on a body at a frequency of the rest of the chain does not move it
    for zero in found.antiresonances:
        omega, zeta = 2.0 * np.pi * zero.frequency_hz.value, zero.damping_ratio.value
        s = complex(-zeta * omega) + omega * np.sqrt(complex(zeta**2 - 1.0))
        n = len(expected) // 2
        if np.abs(s - expected).min() < 1e-5 * size:  # a zero on a pole cancels it
            continue
        column = [entry.key for entry in model.actuators].index(zero.actuator)
        body = int(np.flatnonzero(space.B[n:, column])[0])
        at_zero = np.linalg.solve(s * np.eye(2 * n) - space.A, space.B[:, column])[body]
        near = np.linalg.solve(1.1 * s * np.eye(2 * n) - space.A, space.B[:, column])[body]
        assert abs(at_zero) < 1e-4 * abs(near)


@pytest.mark.slow
@pytest.mark.parametrize("seed", (4, 7, 13, 21))
def test_intervals_are_those_of_many_draws(seed: int) -> None:
    model, values = any_chain(100 + seed)
    base = model.base_from_physical(values)
    if model.composites or len(model.identifiable) < len(model.parameters):
        pytest.fail("base parameters are composites: choose another seed")
    rng = np.random.default_rng(seed)
    root = np.diag(0.02 * np.abs(base)) @ rng.normal(size=(len(base), len(base))) / np.sqrt(len(base))
    found = find_modes(model, uncertain_chain(model, base, root @ root.T, values))
    draws = [base + root @ rng.normal(size=len(base)) for _ in range(300)]
    told = [modes_at(model, model.physical_from_base(draw)) for draw in draws]
    for k, mode in enumerate(found):
        if mode.frequency_hz is None or mode.damping_ratio is None:
            continue
        drawn = np.array([one[k].frequency_hz.value for one in told])
        assert np.std(drawn) == pytest.approx(mode.frequency_hz.std, rel=0.3)
        held = (drawn > mode.frequency_hz.low) & (drawn < mode.frequency_hz.high)
        assert 0.9 < held.mean() < 0.99


@pytest.mark.slow
def test_intervals_hold_where_poles_meet() -> None:
    """Time constants near critical damping have no finite slope; their intervals hold all the same."""
    light = AXIS.parameter_sets["table_1"]
    rng = np.random.default_rng(1)
    for share in (0.3835, 0.42):  # damping ratios from 1.002 on
        truth = {**light, "F_vmc": share * light["F_vmc"]}
        base = AXIS.base_from_physical(truth)
        std = 0.01 * np.abs(base)
        inside = total = 0
        (right,) = (mode for mode in modes_at(AXIS, truth) if mode.name == "creeps")
        for _ in range(80):
            drawn = base + std * rng.normal(size=len(base))
            (mode,) = (
                mode
                for mode in find_modes(AXIS, uncertain_chain(AXIS, drawn, np.diag(std**2), truth))
                if mode.name != "free"
            )
            for own, one in zip(mode.time_constants_s, right.time_constants_s, strict=False):
                total += 1
                inside += own.low <= one.value <= own.high
        assert total > 90
        assert inside / total > 0.9


def test_what_the_base_parameters_leave_open_is_named() -> None:
    truth = AXIS.parameter_sets["light"]
    base = AXIS.base_from_physical(truth)
    exact = np.zeros((len(base),) * 2)

    def without(*names: str) -> Modes:
        left = base.copy()
        left[[AXIS.base_parameters.index(name) for name in names]] = np.nan
        kept = np.flatnonzero(np.isfinite(left))
        start = {name: value for name, value in truth.items() if name not in names}
        C = exact[np.ix_(kept, kept)]
        chain = uncertain_chain(AXIS, left, C, start)
        return find_modes(AXIS, chain, lambda near: uncertain_chain(AXIS, left, C, near))

    # what is no part of a linear chain
    assert without("F_sm").modes == modes_at(AXIS, truth).modes
    free, swinging = without("F_vm")
    assert free.time_constants_s == ()
    assert swinging.damping_ratio is None
    assert swinging.frequency_hz.value == pytest.approx(123.59, rel=1e-3)
    assert (
        "need F_vm, which the records leave open; the frequencies hold for F_vm = 0"
        in without("F_vm").notes[0]
    )
    found = without("K")
    assert [mode.name for mode in found] == ["free"]
    assert found.notes[0] == "1 of 2 modes cannot be computed: they need K, which the records leave open."
    (note,) = modes_at(AXIS, {**truth, "J_c": -1e-7}).notes
    assert note == "No modes: J_c comes out below zero (-1e-07 kg m^2), and no body is without inertia."


def test_friction_that_depends_on_the_direction_counts_with_its_mean() -> None:
    model = model_from_module(emps_rigid_asymmetric_qm)
    p = {"M": 95.0, "Fv_plus": 180.0, "Fc_plus": 20.0, "Fv_minus": 220.0, "Fc_minus": 20.0}
    (mode,) = modes_at(model, p)
    assert mode.time_constants_s[0].value == pytest.approx(95.0 / 200.0)
    assert "mean of both" in modes_at(model, p).notes[0]
