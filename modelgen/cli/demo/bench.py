"""The paper's bench: an encoder at each end, an accelerometer on the load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.simulate import simulate

FS_HZ = 5000.0
DURATION_S = 10.0
CHIRP_BAND_HZ = (20.0, 200.0)
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}  # rad, rad, rad/s^2, N m rms


@dataclass(frozen=True, eq=False)
class BenchExperiment:
    """One excitation of the bench: what is asked of the loop, and what the sensors of a set read."""

    excitation: Excitation
    controller: PositionVelocityController
    record: Record


def bench(model: Model, true: Mapping[str, float]) -> list[BenchExperiment]:
    """Return a chirp and a trapezoid as the sensors of this model would record them."""
    noise = {key: std for key, std in NOISE.items() if key in model.channels}
    chirp = default_excitation("chirp", model, true, FS_HZ, duration_s=DURATION_S, band_hz=CHIRP_BAND_HZ)
    trapezoid = default_excitation("trapezoid", model, true, FS_HZ, duration_s=DURATION_S)
    found = []
    for seed, excitation in enumerate((chirp, trapezoid)):
        done = simulate(model, true, excitation, fs=FS_HZ, noise=noise, seed=seed)
        found.append(BenchExperiment(excitation, done.settings.controller, done.record))
    return found
