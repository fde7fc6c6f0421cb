"""What springs cost: six joints with encoders at motors and on links, against six rigid ones.

    python benchmarks/elastic_arm.py [--samples 250000 1000000] [--by-default]

The PUMA 560 of the catalogue with made masses and springs follows a periodic motion, exactly: links, springs,
motors, torques, with noise of encoders and drives. Records of 2.5e5 to 1e6 samples are written to .npy files
(here, deleted afterwards) and identified from these by `modelgen.identify`, by weighted least squares with a
limit of 20 MB for rows (with `--by-default` by the method, filters and limit that are the default), in
processes of their own with one thread that have loaded compiled filters before.
Printed are processor time a sample, how far memory rises that is no file's (pages of mapped files are
anybody's), and the ratio to the arm without springs; then how many times real time the closed loop of either
takes.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from memory import fresh, private_rise_mb

import modelgen
from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics import threads
from modelgen.runtime.rows import record_rows
from modelgen.runtime.simulation.arms.arm_plant import arm_plant, checked_base
from modelgen.runtime.simulation.arms.fourier_trajectory import FourierTrajectory
from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm
from modelgen.spec.arms.sensors import usual_sensors
from tests.runtime.made_arm_records import catalogued, model_of, of_bodies

FS, PERIOD_S, HARMONICS, PIECE = 1000.0, 10.0, 20, 100_000
STIFF = (40e3, 60e3, 20e3, 3e3, 3e3, 2e3)
NOISE = {"q": 5e-6, "t": 0.1}
FILTERS = modelgen.Filters(cutoff_hz=20.0, filter_order=4, decimation=10, memory_limit_mb=20.0)


@cache
def made(elastic: bool) -> tuple[Model, dict[str, float]]:
    """Return the model of the arm with or without springs, and its parameters (SI)."""
    spec = catalogued("puma560")
    if elastic:
        joints = tuple(replace(j, stiffness=f"K_{j.name}") if j.kind != "fixed" else j for j in spec.joints)
        spec = replace(spec, joints=joints)
        spec = replace(spec, sensor_sets={"encoders": usual_sensors(spec)})
    model = model_of(spec, sensor_set="encoders" if elastic else "")
    values = of_bodies(model, 3)
    names = (joint.name for joint in spec.moving)
    return model, values | ({f"K_{n}": k for n, k in zip(names, STIFF, strict=True)} if elastic else {})


def one_period(elastic: bool) -> dict[str, np.ndarray]:
    """Return what the sensors read without noise along one period."""
    model, values = made(elastic)
    plant, rng = arm_plant(model, checked_base(model, values)), np.random.default_rng(1)
    n = len(plant.joints)
    sines, cosines = 0.3 * rng.standard_normal((2, n, HARMONICS)) / np.arange(1, HARMONICS + 1)
    links = FourierTrajectory(PERIOD_S, np.zeros(n), sines, cosines)
    samples = round(FS * PERIOD_S)
    q, v, a = (plant.coordinates.stiff @ one for one in links.at(np.arange(samples) / FS))
    if elastic:  # springs carry what the links need, and motors are as far ahead
        torque = plant.smooth(q, v, a)[:n]
        spectrum = np.fft.rfft(torque / np.array(STIFF)[:, None], axis=1)
        rates = 2j * np.pi * np.fft.rfftfreq(samples, 1.0 / FS)
        for k, one in enumerate((q, v, a)):
            one[n:] += np.fft.irfft(spectrum * rates**k, samples, axis=1)
    read = dict(zip(plant.coordinates.channels, plant.coordinates.reads @ q, strict=True))
    return read | plant.driving_forces(q, v, a)


def write(folder: Path, samples: int, elastic: bool) -> None:
    """Write periods behind one another, with noise, a file a channel."""
    period, rng = one_period(elastic), np.random.default_rng(2)
    for key, line in period.items():
        target = np.lib.format.open_memmap(folder / f"{key}.npy", "w+", np.float64, (samples,))
        for start in range(0, samples, PIECE):
            piece = np.resize(line, min(PIECE, samples - start))
            target[start : start + len(piece)] = piece + NOISE[key[0]] * rng.standard_normal(len(piece))
        target.flush()


def identified(folder: Path, elastic: bool, by_default: bool) -> modelgen.Estimate:
    """Identify from the files, as given here or by default."""
    threads.usable_threads = lambda: 1
    model, _ = made(elastic)
    source = open_npy({key: folder / f"{key}.npy" for key in model.channels}, FS)
    if by_default:
        return modelgen.identify(model, source)
    return modelgen.identify(model, source, method="wls", filters=FILTERS)


def cost(folder: Path, warm: Path, elastic: bool, by_default: bool) -> tuple[float, float, float]:
    """Return processor time in s, memory in MB, and errors of parameters in standard deviations (rms)."""
    # what long records load, compiled filters, is there before
    record_rows.COMPILED_SAMPLES = 0
    identified(warm, elastic, by_default)
    begun, found = time.process_time(), []
    rise = private_rise_mb(lambda: found.append(identified(folder, elastic, by_default)))
    took = time.process_time() - begun
    model, values = made(elastic)
    truth = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    off = [(value - truth[name]) / found[0].bse[name] for name, value in found[0].params.items()]
    return took, rise, float(np.sqrt(np.mean(np.square(off))))


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--samples", type=int, nargs="+", default=[250_000, 500_000, 1_000_000])
    parser.add_argument("--by-default", action="store_true")
    given = parser.parse_args()
    for samples in given.samples:
        took = {}
        for elastic in (False, True):
            asked = {"elastic": elastic, "by_default": given.by_default}
            with tempfile.TemporaryDirectory() as name:
                folder, warm = Path(name) / "long", Path(name) / "short"
                for place, n in ((folder, samples), (warm, 20_000)):
                    place.mkdir()
                    write(place, n, elastic)
                took[elastic], rise, off = fresh(partial(cost, **asked), folder, warm)
            arm, cost_us = "elastic" if elastic else "rigid", 1e6 * took[elastic] / samples
            print(f"{samples:9,d} samples, {arm:7s}: {cost_us:6.2f} us a sample,", end=" ")
            print(f"{rise:6.1f} MB, errors {off:.2f} sd (rms)", flush=True)
        print(f"elastic over rigid: {took[True] / took[False]:.2f}  (wanted: at most 2.5)", flush=True)
    for elastic in (False, True):
        model, values = made(elastic)
        simulate_arm(model, values, duration_s=0.1)
        begun = time.process_time()
        simulate_arm(model, values, duration_s=10.0)
        word = "elastic" if elastic else "rigid"
        print(f"closed loop, {word}: {(time.process_time() - begun) / 10.0:.2f} times real time", flush=True)


if __name__ == "__main__":
    main()
