"""What a chain of many bodies costs to identify, against the same chain with a dense W.

    python benchmarks/bodies.py

Every body has a position sensor and an actuator, an inertia and a viscous friction; every link a stiffness
and a damping. By hand: the chain of `throughput.py` on all columns of W, the zeros of its rows included, and
lstsq. Here: every signal once, a small triangle for each row, and the banded solution. The records are made
here from sines that solve the equations of motion exactly, plus noise in the forces. One BLAS thread; both
sides of a ratio alternate in one process and their medians are compared; growth is that of the processor's
time.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import math
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parent))

from modelgen.runtime.numerics.banded_least_squares import solve_banded
from modelgen.runtime.rows.record_factors import record_factors
from throughput import CUTOFF_HZ, EDGE, FACTOR, FS, HAS_NUMBA, ORDER, compared, processor_seconds

import modelgen.spec.load
from modelgen.render.view import model_view
from modelgen.render.writer import render
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.rows.filter_sections import paper_filtering
from modelgen.runtime.rows.record_rows import RecordRows
from modelgen.runtime.rows.signal_plan import signal_plan
from modelgen.symbolic.base_parameters import base_model
from modelgen.symbolic.equations.newton import motion_equations
from modelgen.symbolic.rows import identification_rows

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Signals:
    """A record whose channels are not copied."""

    signals: dict[str, FloatArray]
    fs: float = FS
    name: str = "sines"

    @property
    def n(self) -> int:
        return len(next(iter(self.signals.values())))

    def read(self, channel: str, start: int, stop: int) -> FloatArray:
        return self.signals[channel][start:stop]


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


def made_signals(bodies: int, n: int, noise: float = 1e-4) -> Signals:
    """Return positions of sines and the forces that they need: J 1e-5, F 2e-5, K 0.3, D 4e-4, and noise."""
    rng = np.random.default_rng(0)
    t = np.arange(n) / FS
    pool = []
    for _ in range(min(bodies, 23)):
        q, v, a = np.zeros(n), np.zeros(n), np.zeros(n)
        for f in rng.uniform(0.5, 180.0, 4):
            w, phase = 2.0 * np.pi * f, rng.uniform(0.0, 6.0)
            q += np.sin(w * t + phase) / f
            v += w * np.cos(w * t + phase) / f
            a -= w**2 * np.sin(w * t + phase) / f
        pool.append((q, v, a))
    signals = {}
    for i in range(bodies):
        q, v, a = pool[i % len(pool)]
        force = 1e-5 * a + 2e-5 * v + noise * rng.standard_normal(n)
        for k in (i - 1, i + 1):
            if 0 <= k < bodies:
                other, other_v, _ = pool[k % len(pool)]
                force += 0.3 * (q - other) + 4e-4 * (v - other_v)
        signals[f"q{i}"], signals[f"G{i}"] = q, force
    return Signals(signals)


def by_hand(model: Model, record: Signals) -> tuple[FloatArray, FloatArray]:
    """Return x and its standard deviations from a dense W, every column decimated."""
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
    return x, np.sqrt(variance * np.diag(np.linalg.inv(W.T @ W)))


def by_product(model: Model, record: Signals, fast: bool | None = None) -> FloatArray:
    """Return x from operators, triangles and the banded solution."""
    plan = signal_plan(model, paper_filtering(ORDER, CUTOFF_HZ, FS, FACTOR), fast)
    grid = range(EDGE, record.n - EDGE - (record.n - EDGE) % FACTOR, FACTOR)
    rows = record_factors(RecordRows(record, plan, grid)).rows
    triangles, columns = [row.triangle for row in rows], [row.columns for row in rows]
    return solve_banded(triangles, columns, len(model.base_parameters)).x


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--largest", type=int, default=1000, help="bodies of the longest chain")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    for bodies, wanted, wanted_fast in ((10, 20, 100), (20, 50, 300)):
        model, record = chain_model(bodies), made_signals(bodies, options.samples)
        (x, sd), ours = by_hand(model, record), by_product(model, record)
        sides: dict[str, Callable[[], object]] = {
            "by hand": lambda model=model, record=record: by_hand(model, record),
            "NumPy only": lambda model=model, record=record: by_product(model, record, False),
        }
        if HAS_NUMBA:
            sides["fast"] = lambda model=model, record=record: by_product(model, record, True)
        medians, busy = compared(sides, options.runs), compared(sides, options.runs, processor_seconds)
        differ = np.max(np.abs(x - ours) / sd)
        print(f"{bodies} bodies: estimates differ by {differ:.1e} standard deviations")
        for name, least in (("NumPy only", wanted), ("fast", wanted_fast)):
            if name in medians:
                ratio, share = medians["by hand"] / medians[name], busy["by hand"] / busy[name]
                said = f"{ratio:.0f}, processor's time {share:.0f}"
                print(f"    by hand / {name}: {said}  (wanted: at least {least})")
    sizes = [n for n in (20, 50, 100, 200, 500, 1000) if n <= options.largest]
    times = []
    for bodies in sizes:
        model, record = chain_model(bodies), made_signals(bodies, options.samples)
        by_product(model, record)
        runs = [processor_seconds(lambda m=model, r=record: by_product(m, r)) for _ in range(options.runs)]
        times.append(statistics.median(runs))
        print(f"{bodies:5d} bodies: {1e3 * times[-1]:8.1f} ms, {1e6 * times[-1] / bodies:8.1f} us a body")
    print(f"growth exponent, {sizes[0]} to {sizes[-1]}: {exponent(sizes, times):.2f}  (wanted: at most 1.15)")


def exponent(sizes: list[int], times: list[float]) -> float:
    """Return the slope of log time over log size, by least squares."""
    x, y = [math.log(n) for n in sizes], [math.log(t) for t in times]
    mean_x, mean_y = statistics.mean(x), statistics.mean(y)
    covariance = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True))
    return covariance / sum((a - mean_x) ** 2 for a in x)


if __name__ == "__main__":
    main()
