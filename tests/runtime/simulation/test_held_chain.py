"""A chain held in place: what it answers to pushes at frequencies from zero on."""

from __future__ import annotations

import numpy as np

from modelgen.runtime.simulation.held_chain import held_chain
from modelgen.runtime.simulation.plant import make_plant
from tests.runtime.two_mass_records import SMALL, TRUTH


def test_a_body_on_a_spring_of_no_stiffness_has_finite_answers() -> None:
    """An estimate on the way may have one: NaN at zero frequency had become NaN at every instant."""
    loose = {**TRUTH, "K": 0.0, "D": 0.0}
    omega = 2.0 * np.pi * np.linspace(0.0, 50.0, 101)
    chain = held_chain(make_plant(SMALL, loose), omega)
    assert np.min(np.abs(chain.rates)) == 0.0
    for push in ([1.0, 0.0], [0.0, 1.0]):
        read = chain.read([sensor.key for sensor in SMALL.sensors], np.array(push))
        assert all(np.all(np.isfinite(line)) for line in read.values())


def test_it_is_held_as_fast_as_asked_for() -> None:
    omega = 2.0 * np.pi * np.linspace(0.0, 50.0, 101)
    plant = make_plant(SMALL, TRUTH)
    slow, fast = (np.min(np.abs(held_chain(plant, omega, rate).rates)) for rate in (0.1, 10.0))
    assert slow < 0.1 < 5.0 < fast


def test_forces_on_all_bodies_add_up() -> None:
    omega = 2.0 * np.pi * np.linspace(0.0, 50.0, 101)
    chain = held_chain(make_plant(SMALL, TRUTH), omega, 5.0)
    lines = np.random.default_rng(0).standard_normal((2, 101)) + 0j
    keys = [sensor.key for sensor in SMALL.sensors]
    expected = {key: np.zeros(101, dtype=complex) for key in keys}
    for push, line in zip(np.eye(2), lines, strict=True):
        for key, answer in chain.read(keys, push).items():
            expected[key] += answer * line
    for key, found in chain.driven(lines).items():
        np.testing.assert_allclose(found[1:], expected[key][1:], rtol=1e-9)
