"""Two Dask worker processes against one, on the records of a fleet.

    python benchmarks/fleet.py

Writes one record to .npy files (deleted afterwards) that 200 records of 20 machines share, each from another
sample on, then identifies the fleet with one and with two workers, BLAS at one thread each; runs alternate,
medians are compared. A worker takes a machine at a time and does what `modelgen.identify` does with it. The
documents of the machines must not depend on the number of workers. Each run is told on stderr when
it is over; workers that stand still end the program with a message (`Watch` in `runtime.fleet.dask_cluster`).
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import statistics
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from memory import CHANNELS, SETTINGS, write_record
from throughput import FS, GENERATED

from modelgen.runtime.files.npy_channels import NpyChannels, open_npy
from modelgen.runtime.fleet.dask_cluster import fleet_client
from modelgen.runtime.fleet.identify_fleet import FleetEstimate, FleetRecord, identify_fleet


def shifted(source: NpyChannels, by: int) -> NpyChannels:
    """Return the record from so many samples on: the same data twice would be refused."""
    columns = {
        channel: replace(column, offset=column.offset + by * column.dtype.itemsize, n=column.n - by)
        for channel, column in source.columns.items()
    }
    return replace(source, columns=columns, n=source.n - by)


def identified(client: Any, records: list[FleetRecord]) -> FleetEstimate:
    """Return the estimates of the fleet."""
    return identify_fleet(client, (GENERATED / "emps300_qm_qc.py").read_text(), records, SETTINGS)


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--machines", type=int, default=20)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_record(folder, options.samples + options.records)
        paths = {channel: folder / f"{channel}.npy" for channel in CHANNELS}
        records = [
            FleetRecord(
                f"machine {i % options.machines}", shifted(open_npy(paths, FS, name=f"record {i}"), i)
            )
            for i in range(options.records)
        ]
        times: dict[int, list[float]] = {1: [], 2: []}
        found: dict[int, FleetEstimate] = {}
        with fleet_client(workers=1) as one, fleet_client(workers=2) as two:
            for client in (one, two):
                identified(client, records[:4])
            for _ in range(options.runs):
                for workers, client in ((1, one), (2, two)):
                    start = time.perf_counter()
                    found[workers] = identified(client, records)
                    times[workers].append(time.perf_counter() - start)
                    print(f"{workers} worker(s): {times[workers][-1]:.2f} s", file=sys.stderr, flush=True)
    medians = {workers: statistics.median(values) for workers, values in times.items()}
    same = found[1] == found[2]
    print(f"same documents with one and two workers: {'yes' if same else 'NO'}  (wanted: yes)")
    left_out = {**found[1].failed, **found[1].refused}
    print(f"{len(found[1].machines)} machines, left out: {left_out or 'none'}")
    for workers, value in medians.items():
        print(f"{workers} worker(s): {value:6.2f} s, {1e3 * value / options.records:6.1f} ms a record")
    print(f"one / two workers: {medians[1] / medians[2]:.2f}  (wanted: at least 1.6)")


if __name__ == "__main__":
    main()
