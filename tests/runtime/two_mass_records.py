"""Noisy simulated records of two bodies on a spring, with channels out of step by a known time or zero."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

import numpy as np

from generated import emps300_qm_qc
from modelgen.cli.candidates import spec_model
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import parse_spec

GEARED_TEXT = """
[chain]
name = "geared"
motion = "rotation"

[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
coulomb = "F_sm"
actuator = "Gamma_m"

[[bodies]]
name = "c"
inertia = "J_c"

[[links]]
bodies = ["m", "c"]
stiffness = "K"
damping = "D"
ratio = 100.0

[sensors.s]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
"""

FS = 5000.0
SMALL = model_from_module(emps300_qm_qc)
GEARED = spec_model(parse_spec(GEARED_TEXT, "geared.toml"), "s")
TRUTH = MappingProxyType(dict(SMALL.parameter_sets["light"]))
GEARED_TRUTH = MappingProxyType(
    {"J_m": 1e-4, "F_vm": 2e-3, "F_sm": 0.05, "J_c": 0.8, "K": 15000.0, "D": 12.0}
)
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "Gamma_m": 1e-4}
GEARED_NOISE = {"q_m": 2e-5, "q_c": 2e-6, "Gamma_m": 1e-3}
# Fine samples a sample, and those left at both ends, so that a channel can be moved.
FINE, ENDS = 4, 400


# What effects are made from, whatever records hold: a file that simulates when it is imported takes half a
# minute to collect on a new checkout.
RAMPS = [Record(dict.fromkeys(SMALL.channels, np.linspace(0.0, 1.0, 100)), FS) for _ in range(2)]


@cache
def _clean(geared: bool, kind: str) -> Record:
    model, truth = (GEARED, GEARED_TRUTH) if geared else (SMALL, TRUTH)
    return simulate(model, truth, kind, fs=FINE * FS, duration_s=2.0, oversample=8).record


def two_mass_records(
    late: Mapping[str, float] | None = None,
    zeros: Mapping[str, float] | None = None,
    seed: int = 5,
    geared: bool = False,
    noise: float = 1.0,
    averaged: Mapping[str, int] | None = None,
) -> list[Record]:
    """A chirp and a trapezoid of 1.84 s.

    Parameters
    ----------
    late : mapping of str to float
        Channel -> by how many samples it is late, in quarters of one; early where it is negative.
    zeros : mapping of str to float
        Channel -> what it reads at zero.
    averaged : mapping of str to int
        Channel -> over how many samples it is averaged, around the instant of the sample.
    noise : float
        Multiple of `NOISE`.
    """
    rng = np.random.default_rng(seed)
    rms = GEARED_NOISE if geared else NOISE
    found = []
    for kind in ("chirp", "trapezoid"):
        fine = _clean(geared, kind)
        signals = {}
        for key, samples in fine.signals.items():
            by = round(FINE * (late or {}).get(key, 0.0))
            width = FINE * (averaged or {}).get(key, 0) + 1
            mean = np.convolve(samples, np.ones(width) / width, "same")
            read = mean[ENDS - by : fine.n - ENDS - by : FINE]
            noisy = read + noise * rms[key] * rng.standard_normal(read.size)
            signals[key] = noisy + (zeros or {}).get(key, 0.0)
        found.append(Record(signals, FS, kind, kind))
    return found


@cache
def plain_estimate() -> Estimate:
    """What the records give by default where nothing is wrong with them."""
    return identify(SMALL, two_mass_records())


def assert_truth_inside(estimate: Estimate, truth: Mapping[str, float], model: Model = SMALL) -> None:
    """Every parameter of the model has a number, and is within 3 of its standard deviations."""
    assert set(estimate.params) == set(model.parameters)
    for name, value in truth.items():
        assert abs(estimate.params[name] - value) < 3.0 * estimate.bse[name], name


def curved(records: list[Record], key: str, name: str, share: float) -> list[Record]:
    """Return the records with a force read that is more than acts, by a constant or by its cube."""
    found = []
    for record in records:
        acting = record.signals[key]
        peak = float(np.max(np.abs(acting)))
        more = TRUTH["F_sm"] * np.sign(acting) if name == "dead zone" else acting * (acting / peak) ** 2
        found.append(record.edited({key: acting + share * more}))
    return found
