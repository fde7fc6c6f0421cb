"""Memory and time of identifying long records of an arm, read from files in stretches.

    .venv/bin/python benchmarks/arm_memory.py [--samples 250000 1000000] [--arm scara] [--limit 40]

A record of 10 s in closed loop, again and again with fresh noise, is written to .npy files and identified
in a process of its own, rows beyond `--limit` MB made again whenever they are asked for. Printed: how far
private memory (RssAnon, without the pages of the files) rises above what it was before, the largest of
readings 5 ms apart; processor time; the method.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import multiprocessing
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from arm_coverage import DRIVE, ENCODER, FS, arm, noisy, true_records

import modelgen
from modelgen.array_types import FloatArray
from modelgen.runtime.files.npy_channels import open_npy
from tests.runtime.made_arm_records import of_bodies


def write_record(folder: Path, true: dict[str, FloatArray], n: int) -> None:
    """Write n samples: the same motion from rest to rest, with noise of its own each time."""
    sides = {
        key: np.lib.format.open_memmap(folder / f"{key}.npy", mode="w+", dtype=np.float64, shape=(n,))
        for key in true
    }
    size = len(next(iter(true.values())))
    for seed, start in enumerate(range(0, n, size)):
        piece = noisy(true, seed, ENCODER, DRIVE)
        for key, line in sides.items():
            line[start : start + size] = piece.signals[key][: n - start]


def private_mb() -> float:
    """Return the private memory of this process in MB (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1000.0 for line in lines if line.startswith("RssAnon"))


def identified(name: str, folder: Path, warm: Path, method: str, limit_mb: float) -> tuple[float, float, str]:
    """Return rise in MB, processor time in s and method of identifying from the files."""
    model, filters = arm(name), modelgen.Filters(memory_limit_mb=limit_mb)

    def work(where: Path) -> modelgen.Estimate:
        source = open_npy({key: where / f"{key}.npy" for key in model.channels}, FS)
        return modelgen.identify(model, source, method, filters)

    work(warm)
    before, largest, over = private_mb(), [0.0], threading.Event()

    def watch() -> None:
        while not over.wait(0.005):
            largest[0] = max(largest[0], private_mb())

    watcher = threading.Thread(target=watch)
    watcher.start()
    begin = time.process_time()
    estimate = work(folder)
    taken = time.process_time() - begin
    over.set()
    watcher.join()
    return largest[0] - before, taken, estimate.fit.method


def main() -> None:
    """Print a line for every length and method."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--samples", type=int, nargs="+", default=[250_000, 1_000_000])
    parser.add_argument("--arm", default="scara")
    parser.add_argument("--limit", type=float, default=40.0)
    given = parser.parse_args()
    model = arm(given.arm)
    true = true_records(model, of_bodies(model, 1))[0]
    with tempfile.TemporaryDirectory() as place:
        folders = {n: Path(place) / str(n) for n in (20_000, *given.samples)}
        for n, folder in folders.items():
            folder.mkdir()
            write_record(folder, true, n)
        warm = folders.pop(20_000)
        for method in ("wls", "auto"):
            for n, folder in folders.items():
                with multiprocessing.get_context("spawn").Pool(1) as pool:
                    rise, taken, found = pool.apply(
                        identified, (given.arm, folder, warm, method, given.limit)
                    )
                print(
                    f"{given.arm}, {method} ({found}), {n} samples: {rise:6.1f} MB, {taken:6.1f} s",
                    flush=True,
                )


if __name__ == "__main__":
    main()
