"""What ten million samples take in memory, and whether the cost of a sample grows with the record.

    python benchmarks/memory.py

A record of 1e7 samples is written to .npy files (here, deleted afterwards), then identified in a process of
its own: in chunks from the mapped files, by one thread and by two, and by the chain written by hand
(`throughput.py`). Printed is how far each process's resident memory rises above what it was before it touched
the record, and by how much the estimate differs from that of `identify`, which has the record in memory (4 GB
at 1e7 samples; `--whole 0` leaves it out) and uses the filters that were chosen for the chunks. The cost of a
sample is that of filtering, masks, solution and covariance; what `identify_stream` adds to that looks at 2^18
samples at most (the choice of filters) or does the same again (drift, pruning).
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
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from modelgen.runtime.identification.identify_stream import identify_stream, stream_choice
from modelgen.runtime.least_squares.hac_covariance_chunks import stream_hac_covariance
from modelgen.runtime.least_squares.triangle_fit import fit_factors
from modelgen.runtime.rows.record_factors import record_factors
from throughput import FS, by_hand, made_record, processor_seconds, two_bodies

from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.record_rows import matched_rows

CHANNELS = ("q_m", "q_c", "Gamma_m")
PIECE = 1_000_000


def write_record(folder: Path, n: int) -> None:
    """Write a record of n samples: the one of `throughput.py`, again and again."""
    piece = made_record(two_bodies(), min(n, PIECE))
    for channel in CHANNELS:
        target = np.lib.format.open_memmap(folder / f"{channel}.npy", mode="w+", dtype=np.float64, shape=(n,))
        for start in range(0, n, PIECE):
            stop = min(start + PIECE, n)
            target[start:stop] = piece.signals[channel][: stop - start]
        target.flush()


def resident_mb(field: str) -> float:
    """Return a field of the process's memory, in MB (Linux)."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field):
            return int(line.split()[1]) / 1000.0
    raise RuntimeError(f"no {field} in /proc/self/status")


def in_chunks(folder: Path, threads: int = 1) -> Estimate:
    """Identify from the mapped files, masks, both covariances and all."""
    source = open_npy({channel: folder / f"{channel}.npy" for channel in CHANNELS}, FS)
    settings = {"cutoff_hz": 400.0, "filter_order": 4, "decimation": 10}
    return identify_stream(two_bodies(), [source], **settings, threads=threads)


def once_through(folder: Path) -> object:
    """Filter, mask and solve, and find the covariance, with settings that are given."""
    model, source = two_bodies(), open_npy({channel: folder / f"{channel}.npy" for channel in CHANNELS}, FS)
    choice = stream_choice(model, [source], 400.0, 4, 10, None)
    task = matched_rows(model, source, choice, 10)
    fit = fit_factors(model, [record_factors(task)])
    return stream_hac_covariance(fit, [task])


def loaded(folder: Path) -> Record:
    """Return the record of the files."""
    return Record({channel: np.load(folder / f"{channel}.npy") for channel in CHANNELS}, FS)


def all_at_once(folder: Path) -> object:
    """Load the files and go through the chain written by hand."""
    return by_hand(two_bodies(), loaded(folder))


def difference(folder: Path) -> float:
    """Return by how much in chunks and from memory differ, in standard deviations; the largest."""
    chunked = in_chunks(folder)
    used = chunked.filtering
    whole = identify(
        two_bodies(),
        [loaded(folder)],
        **values_of(
            cutoff_hz=used.cutoff_hz,
            filter_order=used.filter_order,
            decimation=used.decimation[0],
            direction_cutoff_hz=used.direction_cutoff_hz,
        ),
    )
    return max(abs(chunked.params[name] - whole.params[name]) / whole.bse[name] for name in whole.params)


def fresh(work: Callable[..., float], *arguments: object) -> float:
    """Return what a process of its own answers."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(work, arguments)


def rise_mb(work: Callable[[Path], object], folder: Path, warm: Path) -> float:
    """Return how far the memory of a fresh process rises, in MB, once a short record has loaded the code."""
    return fresh(_rise, work, folder, warm)


def _rise(work: Callable[[Path], object], folder: Path, warm: Path) -> float:
    work(warm)
    Path("/proc/self/clear_refs").write_text("5")  # the high-water mark starts from here
    before = resident_mb("VmRSS")
    work(folder)
    return resident_mb("VmHWM") - before


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--whole", type=int, default=1, help="0: do not identify it from memory")
    parser.add_argument("--largest", type=int, default=100_000_000, help="record of the cost per sample")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, warm = Path(name) / "long", Path(name) / "short"
        for place, n in ((folder, options.samples), (warm, 20_000)):
            place.mkdir()
            write_record(place, n)
        chunked = rise_mb(in_chunks, folder, warm)
        print(f"in chunks:    {chunked:7.1f} MB above the start  (wanted: under 64)")
        both = rise_mb(partial(in_chunks, threads=2), folder, warm)
        print(f"two threads:  {both:7.1f} MB above the start  (wanted: under 64)")
        whole = rise_mb(all_at_once, folder, warm)
        print(f"by hand:      {whole:7.1f} MB, {whole / chunked:.0f} times as much")
        if options.whole:
            differ = fresh(difference, folder)
            print(f"in chunks and from memory: {differ:.1e} standard deviations apart  (wanted: 1e-6)")
    sizes = [10**k for k in range(5, round(math.log10(options.largest)) + 1)]
    cost = {}
    for n in sizes:
        with tempfile.TemporaryDirectory() as name:
            write_record(Path(name), n)
            runs = max(1, min(7, 20_000_000 // n))
            once_through(Path(name))
            works = [lambda folder=Path(name): once_through(folder)] * runs
            cost[n] = statistics.median(processor_seconds(work) for work in works) / n
            whole = processor_seconds(lambda folder=Path(name): in_chunks(folder)) / n
            print(
                f"{n:.0e} samples: {1e9 * cost[n]:6.1f} ns of the processor's time a sample, "
                f"{1e9 * whole:6.1f} with everything"
            )
    print(f"largest / smallest cost a sample: {max(cost.values()) / min(cost.values()):.2f}  (wanted: flat)")


if __name__ == "__main__":
    main()
