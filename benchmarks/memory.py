"""What ten million samples take in memory, and whether the cost of a sample grows with the record.

    python benchmarks/memory.py

A record of 1e7 samples is written to .npy files (here, deleted afterwards), then identified by
`modelgen.identify` in a process of its own, from the files, which are never loaded whole: by one thread and
by two, and by instruments, which keep rows of their own. Printed is how far the process's resident memory
rises above what it was before it touched the record, and what of that is more than the rows: the samples
kept, a line for every column and one for Y of each row of the model, 8 bytes each. For comparison: the chain
written by hand (`throughput.py`), which loads the files. The estimate must be that of the record in memory
(`--whole 0` leaves that out).

Then the same record with a limit for the rows (`--limit`, in MB), which they exceed: they are made again
whenever they are asked for. By least squares, with and without the limit, and by default, which is least
squares where instruments do not fit. `--samples 100000000 --limit 100 --whole 0 --largest 1000000` does so
with 1e8 samples: 2.4 GB of files, 1.1 GB of rows.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import math
import multiprocessing
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from throughput import FACTOR, FS, by_hand, made_record, processor_seconds, two_bodies

import modelgen
from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.numerics import qr_triangle
from modelgen.runtime.numerics import threads as cores
from modelgen.runtime.records.record import Record
from modelgen.runtime.rows import record_rows

CHANNELS = ("q_m", "q_c", "Gamma_m")
PIECE = 1_000_000
FILTERS = modelgen.Filters(cutoff_hz=400.0, filter_order=4, decimation=FACTOR)
SETTINGS = {"filters": FILTERS}
# Samples of the record with which a process begins.
SHORT = 20_000


def write_record(folder: Path, n: int) -> None:
    """Write a record of n samples: the one of `throughput.py`, again and again."""
    piece = made_record(two_bodies(), min(n, PIECE))
    for channel in CHANNELS:
        target = np.lib.format.open_memmap(folder / f"{channel}.npy", mode="w+", dtype=np.float64, shape=(n,))
        for start in range(0, n, PIECE):
            stop = min(start + PIECE, n)
            target[start:stop] = piece.signals[channel][: stop - start]
        target.flush()


def rows_mb(n: int) -> float:
    """Return what the rows of a record of n samples take, in MB."""
    model = two_bodies()
    return 8e-6 * (n // FACTOR) * len(model.rows) * (len(model.base_parameters) + 1)


def from_files(folder: Path, threads: int = 1, method: str = "auto") -> modelgen.Estimate:
    """Identify from the files; a process of many would otherwise take one thread, any other all cores."""
    cores.usable_threads = lambda: threads
    source = open_npy({channel: folder / f"{channel}.npy" for channel in CHANNELS}, FS)
    return modelgen.identify(two_bodies(), source, method=method, **SETTINGS)


def within(folder: Path, limit_mb: float | None, method: str) -> modelgen.Estimate:
    """Identify from the files by one thread, the rows within a limit."""
    cores.usable_threads = lambda: 1
    source = open_npy({channel: folder / f"{channel}.npy" for channel in CHANNELS}, FS)
    filters = replace(FILTERS, memory_limit_mb=limit_mb)
    return modelgen.identify(two_bodies(), source, method=method, filters=filters)


def loaded(folder: Path) -> Record:
    """Return the record of the files."""
    return Record({channel: np.load(folder / f"{channel}.npy") for channel in CHANNELS}, FS)


def from_memory(folder: Path) -> modelgen.Estimate:
    """Load the files and identify."""
    return modelgen.identify(two_bodies(), loaded(folder), **SETTINGS)


def all_at_once(folder: Path) -> object:
    """Load the files and go through the chain written by hand."""
    return by_hand(two_bodies(), loaded(folder))


def difference(folder: Path) -> float:
    """Return by how much files and memory differ, in standard deviations; the largest of all parameters."""
    return apart(from_files(folder), from_memory(folder))


def difference_within(folder: Path, limit_mb: float) -> float:
    """Return by how much rows that are made again and rows that are kept differ, likewise."""
    return apart(within(folder, limit_mb, "wls"), within(folder, None, "wls"))


def apart(one: modelgen.Estimate, other: modelgen.Estimate) -> float:
    """Return by how many standard deviations two estimates differ; the largest of all parameters."""
    return max(abs(one.params[name] - other.params[name]) / other.bse[name] for name in other.params)


def fresh(work: Callable[..., Any], *arguments: object) -> Any:
    """Return what a process of its own answers."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(work, arguments)


def resident_mb(field: str) -> float:
    """Return a field of the process's memory, in MB (Linux)."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field):
            return int(line.split()[1]) / 1000.0
    raise RuntimeError(f"no {field} in /proc/self/status")


def rise_mb(work: Callable[[], object]) -> float:
    """Return how far the memory of this process rises during a call, in MB."""
    Path("/proc/self/clear_refs").write_text("5")  # the high-water mark starts from here
    before = resident_mb("VmRSS")
    work()
    return resident_mb("VmHWM") - before


def private_rise_mb(work: Callable[[], object]) -> float:
    """Return how far memory that is no file's rises during a call, in MB: looked at every 5 ms.

    Pages of mapped files are resident as long as nobody else needs the memory.
    """
    before, peak, done = resident_mb("RssAnon"), [0.0], threading.Event()

    def watch() -> None:
        while not done.wait(0.005):
            peak[0] = max(peak[0], resident_mb("RssAnon"))

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        work()
    finally:
        done.set()
        watching.join()
    return peak[0] - before


def warm_rise_mb(work: Callable[[Path], object], folder: Path, warm: Path) -> float:
    """Return the rise of a call on a record, once a short one has loaded the code, compiled parts, too."""
    limits = record_rows.COMPILED_SAMPLES, qr_triangle.COMPILED_ROWS
    record_rows.COMPILED_SAMPLES = qr_triangle.COMPILED_ROWS = 0
    work(warm)
    record_rows.COMPILED_SAMPLES, qr_triangle.COMPILED_ROWS = limits
    return rise_mb(partial(work, folder))


def print_memory(samples: int, whole: bool) -> None:
    """Print how far the memory rises, and whether files and memory give the same."""
    rows = rows_mb(samples)
    with tempfile.TemporaryDirectory() as name:
        folder, warm = Path(name) / "long", Path(name) / "short"
        for place, n in ((folder, samples), (warm, SHORT)):
            place.mkdir()
            write_record(place, n)
        sides = {f"{k} thread(s)": partial(from_files, threads=k) for k in (1, 2)}
        others = {"iv": partial(from_files, method="iv"), "by hand": all_at_once}
        for side, work in (sides | others).items():
            rise = fresh(warm_rise_mb, work, folder, warm)
            beyond = f"{rise - rows:7.1f} MB more than the rows ({rows:.0f} MB)"
            wanted = "  (wanted: at most 64)" if side in sides else ""
            print(f"{side:12s} {rise:7.1f} MB above the start, {beyond}{wanted}", flush=True)
        if whole:
            differ = fresh(difference, folder)
            print(
                f"from files and from memory: {differ:.1e} standard deviations apart  (wanted: at most 1e-6)"
            )


def print_limited(samples: int, limit_mb: float, whole: bool) -> None:
    """Print how far the memory rises where the rows exceed a limit, and whether that changes the estimate."""
    rows = rows_mb(samples)
    with tempfile.TemporaryDirectory() as name:
        folder, warm = Path(name) / "long", Path(name) / "short"
        for place, n in ((folder, samples), (warm, SHORT)):
            place.mkdir()
            write_record(place, n)
        for method in ("wls", "auto"):
            start = time.perf_counter()
            rise = fresh(warm_rise_mb, partial(within, limit_mb=limit_mb, method=method), folder, warm)
            took = time.perf_counter() - start
            print(
                f"{method}, limit {limit_mb:g} MB: {rise:7.1f} MB above the start, rows of {rows:.0f} MB "
                f"made again, {took:.0f} s  (wanted: at most 64 beyond the limit)",
                flush=True,
            )
        if whole:
            differ = fresh(difference_within, folder, limit_mb)
            print(f"made again and kept: {differ:.1e} standard deviations apart  (wanted: at most 1e-9)")


def print_cost(sizes: list[int]) -> None:
    """Print what a sample costs in records of these lengths."""
    cost = []
    for n in sizes:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            write_record(folder, n)
            from_files(folder)
            runs = max(1, min(5, 3_000_000 // n))
            found = [processor_seconds(partial(from_files, folder)) for _ in range(runs)]
        cost.append(statistics.median(found) / n)
        print(f"{n:.0e} samples: {1e9 * cost[-1]:6.1f} ns of the processor's time a sample", flush=True)
    print(f"largest / smallest cost a sample: {max(cost) / min(cost):.2f}  (wanted: flat)")


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--whole", type=int, default=1, help="0: do not identify it from memory")
    parser.add_argument("--limit", type=float, default=50.0, help="MB of rows in the second part")
    parser.add_argument("--largest", type=int, default=10_000_000, help="record of the cost per sample")
    options = parser.parse_args()
    if options.limit < rows_mb(options.samples):
        print_limited(options.samples, options.limit, bool(options.whole))
    if options.samples <= 10_000_000:
        print_memory(options.samples, bool(options.whole))
    print_cost([10**k for k in range(5, round(math.log10(options.largest)) + 1)])


if __name__ == "__main__":
    main()
