"""What filtering, Y and W, and the solution cost against the chain one writes by hand with SciPy.

    python benchmarks/throughput.py

Two bodies, both positions sensed, six parameters, decimation by 10. By hand: butter and sosfiltfilt on the
positions, numpy.gradient, decimate(zero_phase=True) on every column of W and Y, lstsq; no intervals but
those of eq. (11), no check. Against it stands what a user calls, `modelgen.identify`: with everything that
it does by default, and least squares without any check (`CheckOptions(tests=False)`); on a new Record each
time (a record keeps its spectra). Runs alternate in one process, and medians are compared. Ratios of the
processor's own time are printed as well, for machines that have other work. BLAS has the same number of
threads for all sides of a run, which is printed: one, unless OPENBLAS_NUM_THREADS says otherwise; by hand,
only lstsq (a sixth of the time) could use more. The record is made here: a sum of sines that solves the
equations of motion exactly, plus noise in the torque.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import numpy.typing as npt

import modelgen
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import Model, load_model
from modelgen.runtime.numerics import qr_triangle
from modelgen.runtime.numerics.threads import usable_threads
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows import record_rows

FloatArray = npt.NDArray[np.float64]

HAS_NUMBA = find_spec("numba") is not None

FS, CUTOFF_HZ, ORDER, FACTOR = 5000.0, 400.0, 4, 10
# samples at both ends that neither side uses: the reach of both filters to 1e-12
EDGE = 2000
GENERATED = Path(__file__).resolve().parents[1] / "generated"


@cache
def two_bodies() -> Model:
    """Return the chain of the paper, both positions sensed."""
    return load_model(GENERATED / "emps300_qm_qc.py")


def made_record(model: Model, n: int, seed: int = 0, noise: float = 1e-3) -> Record:
    """Return a record of sines on both bodies with the torque that drives them, noise in the torque."""
    truth = dict(model.parameter_sets["table_2"])
    rng = np.random.default_rng(seed)
    t = np.arange(n) / FS
    # the load follows its own sines, the motor is what the load's equation of motion asks for
    signals = {key: np.zeros(n) for key in ("q", "v", "a", "vc", "ac")}
    for f in (0.31, 1.7, 7.3, 23.0, 61.0, 109.0, 167.0):
        w, phase = 2.0 * np.pi * f, rng.uniform(0.0, 6.0)
        load = np.exp(1j * (w * t + phase)) * (2.0 / (f + f**2 / 30.0))
        stiff = truth["K"] + 1j * w * truth["F_vmc"]
        motor = load * (1.0 - w**2 * truth["J_c"] / stiff)
        signals["q"] += motor.imag
        signals["v"] += (1j * w * motor).imag
        signals["a"] += (-(w**2) * motor).imag
        signals["vc"] += load.imag
        signals["ac"] += (-(w**2) * load).imag
    torque = truth["J_m"] * signals["a"] + truth["F_vm"] * signals["v"] + truth["J_c"] * signals["ac"]
    torque += truth["F_sm"] * np.sign(signals["v"]) + noise * rng.standard_normal(n)
    return Record({"q_m": signals["q"], "q_c": signals["vc"], "Gamma_m": torque}, FS, "sines")


def by_hand(model: Model, record: Record) -> tuple[FloatArray, FloatArray]:
    """Return x and its standard deviations as the chain written by hand gives them."""
    from scipy.signal import butter, decimate, sosfiltfilt

    sos = butter(ORDER, CUTOFF_HZ, output="sos", fs=FS)
    signals = {"Gamma_m": record.signals["Gamma_m"]}
    for key in ("q_m", "q_c"):
        signals[key] = sosfiltfilt(sos, record.signals[key])
        signals["d1_" + key] = np.gradient(signals[key], 1.0 / FS)
        signals["d2_" + key] = np.gradient(signals["d1_" + key], 1.0 / FS)
    D, y = model.regressor(signals), model.measurement(signals)
    rows, columns = D.shape[1:]
    inside = slice(EDGE // FACTOR, (record.n - EDGE) // FACTOR)
    W = [
        np.column_stack([decimate(D[:, row, c], FACTOR, zero_phase=True)[inside] for c in range(columns)])
        for row in range(rows)
    ]
    Y = [decimate(y[:, row], FACTOR, zero_phase=True)[inside] for row in range(rows)]
    W_all, Y_all = np.concatenate(W), np.concatenate(Y)
    x, residual, _, _ = np.linalg.lstsq(W_all, Y_all)
    variance = float(residual[0]) / (len(Y_all) - columns)
    return x, np.sqrt(variance * np.diag(np.linalg.inv(W_all.T @ W_all)))


def at_the_door(model: Model, record: Record, fast: bool, **options: object) -> object:
    """Return the estimate that a user gets, without numba's filters unless `fast`."""
    fresh = Record(record.signals, record.fs, record.name)
    record_rows.COMPILED_SAMPLES = qr_triangle.COMPILED_ROWS = 0 if fast else sys.maxsize
    return modelgen.identify(model, fresh, **values_of(decimation=FACTOR, **options))


def seconds(work: Callable[[], object]) -> float:
    """Return the time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def processor_seconds(work: Callable[[], object]) -> float:
    """Return the processor's time of one call: that of other programs does not count."""
    start = time.process_time()
    work()
    return time.process_time() - start


def compared(
    sides: dict[str, Callable[[], object]],
    runs: int,
    clock: Callable[[Callable[[], object]], float] = seconds,
) -> dict[str, float]:
    """Return the median time of every side, runs interleaved."""
    times: dict[str, list[float]] = {name: [] for name in sides}
    for _ in range(runs):
        for name, work in sides.items():
            times[name].append(clock(work))
    return {name: statistics.median(values) for name, values in times.items()}


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=7)
    options = parser.parse_args()
    model = two_bodies()
    record = made_record(model, options.samples)
    usable = usable_threads()
    print(f"BLAS threads: {os.environ['OPENBLAS_NUM_THREADS']}, for all; threads by default: {usable}")
    sides: dict[str, Callable[[], object]] = {"by hand": lambda: by_hand(model, record)}
    wanted = {}
    for kind, fast, bounds in (("NumPy only", False, (1, 8)), ("fast", True, (2, 15)))[: 1 + HAS_NUMBA]:
        no_checks = {"method": "wls", "tests": False}
        labels = {"all it does": {}, "wls, no checks": no_checks}
        for (label, given), bound in zip(labels.items(), bounds, strict=True):
            name = f"identify, {kind}, {label}"
            sides[name] = partial(at_the_door, model, record, fast, **given)
            sides[name]()  # the first one compiles
            wanted[name] = bound
    for method in ("wls", "iv"):
        sides[f"identify, {method}"] = partial(at_the_door, model, record, HAS_NUMBA, method=method)
    medians = compared(sides, options.runs)
    busy = compared(sides, options.runs, processor_seconds)
    for name, value in medians.items():
        print(f"{name:38s} {1e9 * value / options.samples:8.1f} ns a sample")
    for name, least in wanted.items():
        ratio, share = medians["by hand"] / medians[name], busy["by hand"] / busy[name]
        print(f"by hand / {name}: {ratio:.2f}, processor's time {share:.2f}  (wanted: at least {least})")
    ratio = medians["identify, iv"] / medians["identify, wls"]
    print(f"iv / wls: {ratio:.2f}  (wanted: at most 5)")


if __name__ == "__main__":
    main()
