"""Simulated six-joint arms in closed loop, identified many times: bias, coverage, stated over found.

    .venv/bin/python benchmarks/arm_coverage.py [--records 100] [--method auto] [--arm puma560]

Links of point masses, drives with inertia, viscous and Coulomb friction; PD at every joint; every trajectory
is simulated once, with stick and slip, and read many times with white noise of encoders and drives.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import modelgen
from modelgen.array_types import FloatArray
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.identification.methods import METHODS
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.simulation.arms.joint_reference import fourier_reference
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm
from modelgen.spec.arms.load import load_arm
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.runtime.made_arm_records import of_bodies

FS, DURATION_S, TRAJECTORIES = 1000.0, 10.0, 4
# rms of encoders in rad, and of what drives report as a share of its rms
ENCODER, DRIVE = 2e-5, 0.02


def arm(name: str) -> Model:
    """Return the model of an arm in the catalogue."""
    spec = load_arm(Path(modelgen.__file__).parent / "catalog" / "arms" / f"{name}.toml")
    return model_from_text(arm_module(arm_base_model(arm_rows(spec))), name)


def true_records(model: Model, values: dict[str, float]) -> list[dict[str, FloatArray]]:
    """Return the noise-free channels of every trajectory."""
    found = []
    for seed in range(TRAJECTORIES):
        reference = fourier_reference(model, DURATION_S, FS, seed=seed)
        true = simulate_arm(model, values, reference).true
        found.append({key: true[key] for key in model.channels})
    return found


def noisy(true: dict[str, FloatArray], seed: int, encoder: float, drive: float) -> modelgen.Record:
    """Return a reading of a trajectory."""
    rng = np.random.default_rng(seed)
    sizes = {
        key: drive * float(line.std()) if key.startswith("tau") else encoder for key, line in true.items()
    }
    read = {key: line + sizes[key] * rng.standard_normal(line.size) for key, line in true.items()}
    return modelgen.Record(read, FS, f"run_{seed}")


def by_chance(records: int, parameters: int) -> tuple[float, float, float]:
    """Return what honest intervals leave: rms and worst bias in sd, least coverage of 95 %; medians.

    The parameters are taken as independent of each other.
    """
    rng = np.random.default_rng(0)
    bias = rng.standard_normal((2000, parameters)) / np.sqrt(records)
    covered = rng.binomial(records, 0.95, (2000, parameters)) / records
    worst, least = np.median(np.abs(bias).max(axis=1)), np.median(covered.min(axis=1))
    return 1.0 / np.sqrt(records), float(worst), float(least)


def main() -> None:
    """Print the worst parameters and the distribution over all."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--records", type=int, default=100)
    parser.add_argument("--method", default="auto")
    parser.add_argument("--arm", default="puma560")
    parser.add_argument("--encoder", type=float, default=ENCODER)
    parser.add_argument("--drive", type=float, default=DRIVE)
    parser.add_argument("--cutoff-hz", type=float)
    parser.add_argument("--delays")
    parser.add_argument("--keep", action="store_true", help="give what would be refused on doubt, too")
    given = parser.parse_args()
    model = arm(given.arm)
    values = of_bodies(model, 1)
    truth = dict(zip(model.base_parameters, model.base_from_physical(values).tolist(), strict=True))
    true = true_records(model, values)
    errors = {name: [] for name in truth}
    stated = {name: [] for name in truth}
    inside = {name: [] for name in truth}
    filters = modelgen.Filters(cutoff_hz=given.cutoff_hz)
    checks = modelgen.CheckOptions(keep=tuple(truth) if given.keep else ())
    begin, notes = time.process_time(), {}
    for k in range(given.records):
        record = noisy(true[k % TRAJECTORIES], k, given.encoder, given.drive)
        method = METHODS[given.method](delays=given.delays)
        estimate = modelgen.identify(model, record, method, filters=filters, checks=checks)
        note = estimate.fit.method
        notes[note] = notes.get(note, 0) + 1
        intervals = estimate.conf_int()
        for name, value in estimate.params.items():
            errors[name].append(value - truth[name])
            stated[name].append(estimate.bse[name])
            low, high = intervals[name]
            inside[name].append(low <= truth[name] <= high)
    print(
        f"{given.arm}, {given.method}, {given.records} records, {time.process_time() - begin:.0f} s; {notes}"
    )
    print(f"{'parameter':<12}{'given':>6}{'bias/sd':>9}{'coverage':>10}{'stated/found':>14}{'sd/value':>10}")
    lines = []
    for name, error in errors.items():
        if len(error) < 0.5 * given.records:
            print(f"{name:<12}{len(error):>6}  refused")
            continue
        e, sd = np.array(error), float(np.sqrt(np.mean(np.square(stated[name]))))
        found = float(np.std(e, ddof=1))
        line = (
            name,
            len(e),
            e.mean() / found,
            float(np.mean(inside[name])),
            sd / found,
            found / abs(truth[name]),
        )
        lines.append(line)
        print(f"{name:<12}{line[1]:>6}{line[2]:>9.2f}{line[3]:>10.2f}{line[4]:>14.2f}{line[5]:>10.1%}")
    bias, covered, ratio = (np.array([line[k] for line in lines]) for k in (2, 3, 4))
    chance, furthest, least = by_chance(given.records, len(lines))
    print(f"bias: worst {np.abs(bias).max():.2f} sd (chance alone: {furthest:.2f}), "
          f"rms {np.sqrt(np.mean(bias**2)):.2f} ({chance:.2f}); "
          f"coverage {covered.mean():.3f} ({covered.min():.2f} to {covered.max():.2f}; "
          f"chance alone: from {least:.2f}); "
          f"stated over found {np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})")  # fmt: skip


if __name__ == "__main__":
    main()
