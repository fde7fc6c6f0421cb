"""Records of simulated machines, and faults put into their channels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from generated import emps300_qm_ac, emps300_qm_qc, emps_rigid_qm, three_mass_va_vb_vc, two_mass_bench_qm_qc
from generated import tree_positions as tree
from modelgen.runtime.advice import Advice
from modelgen.runtime.diagnostics.samples.suspicious_samples import suspicions
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate

FloatArray = npt.NDArray[np.float64]
Fault = Callable[[FloatArray], FloatArray]

RIGID, BENCH = model_from_module(emps_rigid_qm), model_from_module(two_mass_bench_qm_qc)
QC, AC = model_from_module(emps300_qm_qc), model_from_module(emps300_qm_ac)
VELOCITIES, TREE = model_from_module(three_mass_va_vb_vc), model_from_module(tree)
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}


def simulated(model: Model, kind: str, noise: bool = False, **options: Any) -> Record:
    values = next(iter(model.parameter_sets.values()))
    levels = {key: std for key, std in NOISE.items() if noise and key in model.channels}
    return simulate(model, values, kind, fs=5000.0, duration_s=2.0, noise=levels, **options).record


def faulty(record: Record, key: str, fault: Fault) -> Record:
    signals = {name: samples.copy() for name, samples in record.signals.items()}
    signals[key] = fault(signals[key])
    return Record(signals, record.fs, record.name)


def held(first: int, count: int) -> Fault:
    def fault(samples: FloatArray) -> FloatArray:
        samples[first : first + count] = samples[first]
        return samples

    return fault


def cut_off(first: int, count: int) -> Fault:
    def fault(samples: FloatArray) -> FloatArray:
        samples[first : first + count] = 0.0
        return samples

    return fault


def clipped(low: float, high: float) -> Fault:
    """Clip at shares of the range, 0 its least and 1 its largest reading."""

    def fault(samples: FloatArray) -> FloatArray:
        least, span = samples.min(), np.ptp(samples)
        return np.clip(samples, least + low * span, least + high * span)

    return fault


def only(model: Model, record: Record) -> Advice:
    (found,) = suspicions(model, [record])
    return found
