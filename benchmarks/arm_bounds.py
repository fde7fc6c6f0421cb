"""What physical bounds give an arm of six joints: errors with and without, coverage of the intervals, time.

Links are bodies of random points, as large as those of a PUMA; torques have white noise of a share of their
own size, since bounds count where noise is large: the second column is how well a base parameter is known
without them, the median of its standard deviation over its value. Errors are root mean squares over base
parameters and records, in standard deviations of the estimate without bounds.

    python benchmarks/arm_bounds.py [records]
"""

from __future__ import annotations

import sys
import time

import numpy as np

from modelgen import CheckOptions, Filters, Record, identify
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.parameters.consistent_fit import bodies_of
from modelgen.spec.arms.load import load_arm
from modelgen.spec.load import catalog_path

FS, SECONDS = 200.0, 20.0
MASSES = (15.0, 12.0, 5.0, 1.2, 0.6, 0.2)
SIZES = (0.15, 0.2, 0.15, 0.06, 0.04, 0.03)
QUICK = CheckOptions(tests=False, drift_check=False)
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


def simulated(model: Model, values: dict[str, float], share: float, rng: np.random.Generator) -> Record:
    """Return a record along sums of sines, its torques with noise."""
    t = np.arange(0.0, SECONDS, 1.0 / FS)
    signals = {}
    for key in (k for k in model.channels if k.startswith("q_")):
        parts = [(rng.uniform(0.2, 0.5), 2 * np.pi * f, rng.uniform(0, 6)) for f in (0.1, 0.25, 0.45, 0.8)]
        for order in range(3):
            front = f"d{order}_" if order else ""
            signals[front + key] = sum(
                a * w**order * np.sin(w * t + p + order * np.pi / 2) for a, w, p in parts
            )
    forces = [key for key in model.channels if key.startswith("tau_")]
    every = {**signals, **dict.fromkeys(forces, np.zeros(len(t)))}
    torques = model.regressor(every) @ model.base_from_physical(values)
    for key, torque in zip(forces, torques.T, strict=True):
        signals[key] = torque + share * np.std(torque) * rng.standard_normal(len(t))
    return Record({key: signals[key] for key in model.channels}, FS, "arm")


def main(records: int) -> None:
    """Print one line a share of noise."""
    ((file, text),) = arm_files(load_arm(catalog_path("puma560")), None).items()
    model = model_from_text(text, file)
    print(
        "noise    known to  error without  with  ratio  covered without  with  residual rises  time of bounds"
    )
    for share in (0.01, 0.05, 0.2, 1.0, 10.0):
        errors, inside, rise, spent, known = [], [], [], [], []
        for seed in range(records):
            rng = np.random.default_rng(seed)
            values = true_values(model, rng)
            record = simulated(model, values, share, rng)
            truth = dict(zip(model.base_parameters, model.base_from_physical(values).tolist(), strict=True))
            took, found = [], []
            for bounds in (None, "physical"):
                begun = time.process_time()
                found.append(identify(model, record, WLS(bounds=bounds), FILTERS, QUICK))
                took.append(time.process_time() - begun)
            plain, bounded = found
            names = [name for name in plain.params if name in bounded.params]
            known.append(np.median([abs(plain.bse[n] / truth[n]) for n in names if truth[n]]))
            errors.append(
                [[(e.params[n] - truth[n]) / plain.bse[n] for n in names] for e in (plain, bounded)]
            )
            inside += [
                [abs(e.params[n] - truth[n]) < 1.96 * e.bse[n] for e in (plain, bounded)] for n in names
            ]
            rise.append(bounded.checks.bounds.residual_increase)
            spent.append(took[1] - took[0])
        each = np.hstack([np.array(pair) for pair in errors])
        without, within = np.sqrt(np.mean(each**2, axis=1))
        covered = np.mean(inside, axis=0)
        print(
            f"{share:5.2f}  {100.0 * np.median(known):7.1f} %  {without:13.2f}  {within:4.2f}"
            f"  {within / without:5.2f}  {covered[0]:15.3f} {covered[1]:5.3f}"
            f"  {100.0 * np.mean(rise):12.3f} %  {np.mean(spent):12.2f} s",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
