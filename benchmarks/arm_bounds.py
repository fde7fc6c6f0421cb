"""What physical bounds give an arm of six joints: errors with and without, coverage of the intervals, time.

Links are bodies of random points, as large as those of a PUMA; torques have white noise of a share of their
own size, since bounds count where noise is large: the second column is how well a base parameter is known
without them, the median of its standard deviation over its value. Errors are root mean squares over base
parameters and records, in standard deviations of the estimate without bounds; those of torques along another,
large motion, in shares of these torques: what a controller or a simulation makes of the estimate.

Four sines a joint of up to 0.5 rad for 20 s excite nearly all base parameters. With `--small` it is two slow
ones of up to 0.15 rad for 10 s, as beside obstacles: many combinations are hardly told, and bounds count.
What lies at a bound is taken as zero, which is where bounds of drives and friction are.

    python benchmarks/arm_bounds.py [--records 20] [--small]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from modelgen import CheckOptions, Filters, Record, identify
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.parameters.consistent_fit import bodies_of
from modelgen.spec.arms.load import load_arm
from modelgen.spec.load import catalog_path

FS = 200.0
# duration in s, largest amplitude in rad, frequencies in Hz
LARGE, SMALL = (20.0, 0.5, (0.1, 0.25, 0.45, 0.8)), (10.0, 0.15, (0.1, 0.3))
Motion = tuple[float, float, tuple[float, ...]]
MASSES = (15.0, 12.0, 5.0, 1.2, 0.6, 0.2)
SIZES = (0.15, 0.2, 0.15, 0.06, 0.04, 0.03)
FILTERS = Filters(cutoff_hz=10.0)


def true_values(model: Model, rng: np.random.Generator) -> dict[str, float]:
    """Return parameters of bodies that are made of points, and of drives."""
    values = {name: float(rng.uniform(0.5, 2.0)) for name in model.parameters}
    for names, mass, size in zip(bodies_of(model)[0].values(), MASSES, SIZES, strict=True):
        points, masses = rng.normal(0.0, size, (6, 3)), rng.uniform(0.2, 2.0, 6)
        masses *= mass / masses.sum()
        tensor = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, points, strict=True))
        numbers = [*np.asarray(tensor)[np.triu_indices(3)], *(masses @ points), mass]
        values |= {name: float(value) for name, value in zip(names, numbers, strict=True)}
    return values


def moved(model: Model, motion: Motion, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return signals of sums of sines, forces zero."""
    seconds, largest, frequencies = motion
    t = np.arange(0.0, seconds, 1.0 / FS)
    signals = {key: np.zeros(len(t)) for key in model.channels}
    for key in (k for k in model.channels if k.startswith("q_")):
        parts = [(largest * rng.uniform(0.4, 1.0), 2 * np.pi * f, rng.uniform(0, 6)) for f in frequencies]
        for order in range(3):
            front = f"d{order}_" if order else ""
            signals[front + key] = sum(
                a * w**order * np.sin(w * t + p + order * np.pi / 2) for a, w, p in parts
            )
    return signals


def simulated(
    model: Model, base: np.ndarray, share: float, motion: Motion, rng: np.random.Generator
) -> Record:
    """Return a record along sums of sines, its torques with noise."""
    signals = moved(model, motion, rng)
    forces = [key for key in model.channels if key.startswith("tau_")]
    for key, torque in zip(forces, (model.regressor(signals) @ base).T, strict=True):
        signals[key] = torque + share * np.std(torque) * rng.standard_normal(len(torque))
    return Record({key: signals[key] for key in model.channels}, FS, "arm")


def main(records: int, motion: Motion) -> None:
    """Print one line a share of noise."""
    ((file, text),) = arm_files(load_arm(catalog_path("puma560")), None).items()
    model = model_from_text(text, file)
    checks = CheckOptions(tests=False, drift_check=False, keep=tuple(model.base_parameters))
    elsewhere = np.asarray(model.regressor(moved(model, LARGE, np.random.default_rng(1000))))
    print(
        "noise    known to  error without  with  ratio  torques without    with  ratio  covered without  with"
        "  residual rises  time with bounds"
    )
    for share in (0.01, 0.05, 0.2, 1.0, 10.0):
        errors, torques, inside, rise, spent, known = [], [], [], [], [], []
        for seed in range(records):
            rng = np.random.default_rng(seed)
            base = np.array(model.base_from_physical(true_values(model, rng)))
            record = simulated(model, base, share, motion, rng)
            took, found = [], []
            for bounds in (None, "physical"):
                begun = time.process_time()
                found.append(identify(model, record, WLS(bounds=bounds), FILTERS, checks))
                took.append(time.process_time() - begun)
            bounded = found[1]
            off = [np.array([e.params.get(n, 0.0) for n in model.base_parameters]) - base for e in found]
            stated = [np.array([e.bse.get(n, np.nan) for n in model.base_parameters]) for e in found]
            known.append(np.median(np.abs(stated[0] / base)[base != 0.0]))
            errors.append([one / stated[0] for one in off])
            inside.append(
                [
                    np.mean((np.abs(one) < 1.96 * std)[np.isfinite(std)])
                    for one, std in zip(off, stated, strict=True)
                ]
            )
            whole = np.sqrt(np.mean((elsewhere @ base) ** 2, axis=0))
            torques.append([np.sqrt(np.mean((elsewhere @ one / whole) ** 2)) for one in off])
            rise.append(bounded.checks.bounds.residual_increase)
            spent.append(took[1])
        without, within = np.sqrt(np.nanmean(np.square(errors), axis=(0, 2)))
        torque, bounded_torque = np.sqrt(np.mean(np.square(torques), axis=0))
        covered = np.mean(inside, axis=0)
        print(
            f"{share:5.2f}  {100.0 * np.median(known):7.1f} %  {without:13.2f}  {within:4.2f}"
            f"  {within / without:5.2f}  {100.0 * torque:13.2f} %  {100.0 * bounded_torque:4.2f} %"
            f"  {bounded_torque / torque:5.2f}  {covered[0]:15.3f} {covered[1]:5.3f}"
            f"  {100.0 * np.mean(rise):12.3f} %  {np.mean(spent):12.2f} s",
            flush=True,
        )


if __name__ == "__main__":
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--small", action="store_true")
    given = parser.parse_args()
    main(given.records, SMALL if given.small else LARGE)
