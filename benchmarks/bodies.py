"""What a chain of many bodies costs to identify, against the same chain with a dense W.

    python benchmarks/bodies.py

Every body has a position sensor and an actuator, an inertia and a viscous friction; every link a stiffness
and a damping. Measured is what a user calls, `modelgen.identify`, with its default options: filters chosen,
all intervals of parameters, all checks. Modes are worked out when they are asked for, and not measured here.
Each length of chain has a process of its own, which has identified a short chain before (it loads the code):
printed are its own processor time and how far its resident memory rises above what it was with the model and
the record. By hand: the chain of `throughput.py` on all columns of W, the
zeros of its rows included, and lstsq; no check. The records are made here from sines that solve the equations
of motion exactly, plus noise in the forces. One BLAS thread; both sides of a ratio alternate in one process
and their medians are compared.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import cProfile
import math
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parent))

from memory import fresh, rise_mb
from throughput import CUTOFF_HZ, EDGE, FACTOR, FS, ORDER, compared, processor_seconds

import modelgen
import modelgen.spec.load
from modelgen.render.view import model_view
from modelgen.render.writer import render
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.symbolic.base_parameters import base_model
from modelgen.symbolic.equations.newton import motion_equations
from modelgen.symbolic.rows import identification_rows

FloatArray = npt.NDArray[np.float64]

TRUTH = {"J": 1e-5, "F": 2e-5, "K": 0.3, "D": 4e-4}
# Bodies of the chain with which a process begins.
SHORT = 3
# Functions that a profile lists.
LISTED = 15


def chain_model(bodies: int) -> Model:
    """Return a chain of so many bodies, every position sensed, every body actuated."""
    modelgen.spec.load.SPEC = replace(modelgen.spec.load.SPEC, largest=10**9)
    lines = ["[chain]", 'name = "c"', 'motion = "rotation"']
    for i in range(bodies):
        lines += ["[[bodies]]", f'name = "b{i}"', f'inertia = "J{i}"', f'viscous = "F{i}"']
        lines += [f'actuator = "G{i}"']
    for i in range(bodies - 1):
        lines += ["[[links]]", f'bodies = ["b{i}", "b{i + 1}"]', f'stiffness = "K{i}"', f'damping = "D{i}"']
    lines += ["[sensors.s]"] + [f'q{i} = {{ body = "b{i}", measures = "position" }}' for i in range(bodies)]
    spec = modelgen.spec.load.parse_spec("\n".join(lines), "c.toml")
    rows = identification_rows(motion_equations(spec), "s")
    return model_from_text(render(model_view(base_model(rows))), "chain")


def made_record(bodies: int, n: int, noise: float = 1e-4) -> Record:
    """Return positions of sines and the forces that they need, with noise in these."""
    rng = np.random.default_rng(0)
    t = np.arange(n) / FS
    motions = []
    for _ in range(bodies):
        q, v, a = np.zeros(n), np.zeros(n), np.zeros(n)
        for f in rng.uniform(0.5, 180.0, 4):
            w, phase = 2.0 * np.pi * f, rng.uniform(0.0, 6.0)
            q += np.sin(w * t + phase) / f
            v += w * np.cos(w * t + phase) / f
            a -= w**2 * np.sin(w * t + phase) / f
        motions.append((q, v, a))
    signals = {}
    for i, (q, v, a) in enumerate(motions):
        force = TRUTH["J"] * a + TRUTH["F"] * v + noise * rng.standard_normal(n)
        for k in (i - 1, i + 1):
            if 0 <= k < bodies:
                other, other_v, _ = motions[k]
                force += TRUTH["K"] * (q - other) + TRUTH["D"] * (v - other_v)
        signals[f"q{i}"], signals[f"G{i}"] = q, force
    return Record(signals, FS, "sines")


def by_hand(model: Model, record: Record) -> dict[str, float]:
    """Return the parameters from a dense W, every column decimated; standard deviations are found, too."""
    from scipy.signal import butter, decimate, sosfiltfilt

    sos = butter(ORDER, CUTOFF_HZ, output="sos", fs=FS)
    signals = dict(record.signals)
    for sensor in model.sensors:
        key = sensor.key
        signals[key] = sosfiltfilt(sos, signals[key])
        signals["d1_" + key] = np.gradient(signals[key], 1.0 / FS)
        signals["d2_" + key] = np.gradient(signals["d1_" + key], 1.0 / FS)
    D, y = model.regressor(signals), model.measurement(signals)
    rows, columns = D.shape[1:]
    inside = slice(EDGE // FACTOR, (record.n - EDGE) // FACTOR)
    W = np.concatenate(
        [
            np.column_stack([decimate(D[:, row, c], FACTOR, zero_phase=True)[inside] for c in range(columns)])
            for row in range(rows)
        ]
    )
    Y = np.concatenate([decimate(y[:, row], FACTOR, zero_phase=True)[inside] for row in range(rows)])
    x, residual, _, _ = np.linalg.lstsq(W, Y)
    variance = float(residual[0]) / (len(Y) - columns)
    np.sqrt(variance * np.diag(np.linalg.inv(W.T @ W)))
    return dict(zip(model.base_parameters, x.tolist(), strict=True))


def at_the_door(model: Model, record: Record, **options: object) -> modelgen.Estimate:
    """Return the estimate that a user gets; of a new Record, because one keeps its spectra."""
    return modelgen.identify(model, Record(record.signals, record.fs, record.name), **options)


def largest_error(found: dict[str, float]) -> float:
    """Return the largest relative error of the parameters, in %."""
    return max(100.0 * abs(value / TRUTH[name[0]] - 1.0) for name, value in found.items())


def compare(bodies: int, samples: int, runs: int) -> None:
    """Print what a chain takes by hand, as a multiple of what it takes here."""
    model, record = chain_model(bodies), made_record(bodies, samples)
    sides: dict[str, Callable[[], object]] = {"by hand": partial(by_hand, model, record)}
    for name, checks in (("all it does", True), ("no checks", False)):
        options = modelgen.CheckOptions(drift_check=checks)
        sides[f"identify, {name}"] = partial(at_the_door, model, record, checks=options)
    medians, busy = compared(sides, runs), compared(sides, runs, processor_seconds)
    errors = largest_error(by_hand(model, record)), largest_error(at_the_door(model, record).params)
    print(f"{bodies} bodies: largest error {errors[0]:.2g} % by hand, {errors[1]:.2g} % by identify")
    for name in list(sides)[1:]:
        ratio, share = medians["by hand"] / medians[name], busy["by hand"] / busy[name]
        print(f"    by hand / {name}: {ratio:.2f}, processor's time {share:.2f}")


def cost(bodies: int, samples: int, runs: int) -> tuple[float, float]:
    """Return the processor time in s (median of runs) and the rise of memory in MB (of one run)."""
    at_the_door(chain_model(SHORT), made_record(SHORT, samples))
    model, record = chain_model(bodies), made_record(bodies, samples)
    work = partial(at_the_door, model, record)
    rise = rise_mb(work)
    return statistics.median([processor_seconds(work) for _ in range(runs)]), rise


def profiled(bodies: int, samples: int) -> dict[str, tuple[float, int]]:
    """Return the own time in s and the calls of every function, by its place and name."""
    at_the_door(chain_model(SHORT), made_record(SHORT, samples))
    model, record = chain_model(bodies), made_record(bodies, samples)
    watch = cProfile.Profile()
    watch.runcall(at_the_door, model, record)
    found: dict[str, tuple[float, int]] = {}
    for entry in watch.getstats():
        code = entry.code
        place = code if isinstance(code, str) else f"{Path(code.co_filename).stem} {code.co_name}"
        own, calls = found.get(place, (0.0, 0))
        found[place] = own + entry.inlinetime, calls + entry.callcount
    return found


def print_growth(small: int, large: int, samples: int) -> None:
    """Print the functions whose own time grows most from one chain to the other."""
    before, after = fresh(profiled, small, samples), fresh(profiled, large, samples)
    growth = {name: own - before.get(name, (0.0, 0))[0] for name, (own, _) in after.items()}
    print(f"own time in s and calls, {small} and {large} bodies:")
    for name in sorted(growth, key=growth.__getitem__, reverse=True)[:LISTED]:
        (own, calls), (later, more) = before.get(name, (0.0, 0)), after[name]
        print(f"    {name:60s} {own:7.3f} {calls:6d} {later:7.3f} {more:6d}")


def exponent(sizes: Sequence[int], values: Sequence[float]) -> float:
    """Return the slope of the logarithm of values over that of sizes, by least squares."""
    x, y = [math.log(n) for n in sizes], [math.log(value) for value in values]
    mean_x, mean_y = statistics.mean(x), statistics.mean(y)
    covariance = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True))
    return covariance / sum((a - mean_x) ** 2 for a in x)


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--bodies", type=int, nargs="+", default=[10, 20, 40, 100])
    parser.add_argument("--by-hand", type=int, nargs="*", default=[10, 20], help="bodies of chains compared")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--profile", action="store_true", help="list what grows; three lengths or more")
    options = parser.parse_args()
    for bodies in options.by_hand:
        compare(bodies, options.samples, options.runs)
    found = []
    for bodies in options.bodies:
        seconds, rise = fresh(cost, bodies, options.samples, options.runs)
        found.append((seconds, rise))
        per_body = f"{1e3 * seconds / bodies:6.1f} ms and {rise / bodies:5.2f} MB a body"
        print(f"{bodies:5d} bodies: {seconds:6.2f} s, {rise:7.1f} MB, {per_body}", flush=True)
    times, rises = zip(*found, strict=True)
    ends = f"{options.bodies[0]} to {options.bodies[-1]} bodies"
    print(f"growth exponent, {ends}: time {exponent(options.bodies, times):.2f}  (wanted: at most 1.2)")
    print(f"growth exponent, {ends}: memory {exponent(options.bodies, rises):.2f}  (wanted: at most 1.0)")
    if options.profile:
        print_growth(*options.bodies[-3::2], options.samples)


if __name__ == "__main__":
    main()
