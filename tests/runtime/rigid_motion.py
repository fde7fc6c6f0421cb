"""Records of a rigid axis whose motion and force are known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from generated import emps_rigid_qm
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate

RIGID = model_from_module(emps_rigid_qm)
TRUTH = {"M": 95.0, "Fv": 200.0, "Fc": 20.0, "offset": -3.0}
FS = 1000.0
# fixed filters: what a test says does not hang on how they are chosen
SETTINGS: dict[str, Any] = {"cutoff_hz": 40.0, "direction_cutoff_hz": 10.0}
CHOICE = FilterChoice(4, 40.0, 10.0, (10,), 30.0, 30.0, (), (), ())

# time -> position, velocity, acceleration
Motion = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


def swings(*terms: tuple[float, float], speed: float = 0.0) -> Motion:
    """A sum of sines, pairs of speed amplitude and frequency in Hz, on a constant speed."""

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        q, v, a = speed * t, np.full(len(t), speed), np.zeros(len(t))
        for amplitude, hz in terms:
            w = 2.0 * np.pi * hz
            q = q + amplitude / w * np.sin(w * t)
            v = v + amplitude * np.cos(w * t)
            a = a - amplitude * w * np.sin(w * t)
        return q, v, a

    return motion


# slow enough for friction, fast enough for the inertia, with reversals of both
LIVELY = swings((0.4, 0.1), (0.1, 1.3), (0.05, 3.1))

# never reversing
ONE_WAY = {sign: swings((0.4, 0.1), (0.1, 1.3), (0.05, 3.1), speed=2.0 * sign) for sign in (1.0, -1.0)}


def kinds(estimate: Estimate) -> list[str]:
    """The kinds of advice that an estimate gives."""
    return [advice.kind for advice in estimate.checks.advice]


def rigid_record(
    motion: Motion = LIVELY,
    n: int = 25000,
    noise: float = 1e-7,
    force_noise: float = 0.5,
    seed: int = 0,
    name: str = "run",
    extra: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray] | None = None,
) -> Record:
    """A record of so many samples; `extra` adds a force of q, v, a that the model does not know."""
    q, v, a = motion(np.arange(n) / FS)
    rng = np.random.default_rng(seed)
    force = TRUTH["M"] * a + TRUTH["Fv"] * v + TRUTH["Fc"] * np.sign(v) + TRUTH["offset"]
    if extra is not None:
        force = force + extra(q, v, a)
    q = q + noise * rng.standard_normal(n)
    return Record({"q_m": q, "F": force + force_noise * rng.standard_normal(n)}, FS, name)
