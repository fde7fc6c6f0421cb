"""Rows of force and rows of power on the same records: errors and intervals, by the noise of the encoders.

    .venv/bin/python benchmarks/power_rows.py [seeds]

Of an arm of two links (noise of positions, 1 % of torques) and the two-mass bench (chirp and trapezoid),
least squares with default filters. Columns: median over the parameters of the rms error, and of the standard
deviation stated, in %; share of the 95 % intervals that hold the truth; parameters refused.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from generated import emps300_qm_qc
from modelgen import identify
from modelgen.runtime.identification.methods import WLS
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.simulate import simulate
from tests.runtime.made_arm_records import catalogued, model_of, record_of, values_of

Noisy = Callable[[float, int], list[Record]]


def main(seeds: int) -> None:
    arm = model_of(catalogued("two_link"))
    values = values_of(arm)
    clean = [record_of(arm, values, seed=seed) for seed in (1, 2)]
    chain = model_from_module(emps300_qm_qc)
    bench = chain.parameter_sets["table_2"]
    loops = [simulate(chain, bench, kind).record for kind in ("chirp", "trapezoid")]
    print(f"{'':10}{'noise, rad':>12}{'rows':>7}{'error %':>10}{'stated %':>10}{'covered':>9}{'refused':>9}")
    for level in (1e-6, 1e-5, 1e-4):
        show("two_link", arm, values, with_noise(clean, level, 0.01), level, seeds)
    for level in (2e-6, 2e-5, 1e-4):
        show("two-mass", chain, bench, with_noise(loops, level, 0.005), level, seeds)


def with_noise(clean: Sequence[Record], level: float, share: float) -> Noisy:
    """Return what adds noise of a level (rad) to positions, and a share of their rms to forces."""

    def made(_: float, seed: int) -> list[Record]:
        found = []
        for number, record in enumerate(clean):
            rng = np.random.default_rng([seed, number])
            rms = {
                k: level if k.startswith("q") else share * float(np.std(x)) for k, x in record.signals.items()
            }
            read = {k: x + rms[k] * rng.standard_normal(record.n) for k, x in record.signals.items()}
            found.append(Record(read, record.fs, f"{record.name} {number}"))
        return found

    return made


def show(
    title: str, model: Model, values: Mapping[str, float], noisy: Noisy, level: float, seeds: int
) -> None:
    """Print a line for the rows of force, and one for those of power."""
    truth = dict(zip(model.base_parameters, model.base_from_physical(values), strict=True))
    for rows in ("force", "power"):
        errors: dict[str, list[float]] = {}
        stated: dict[str, list[float]] = {}
        inside, refused = [], 0
        for seed in range(seeds):
            estimate = identify(model, noisy(level, seed), WLS(rows=rows))
            refused += len(truth) - len(estimate.params)
            for name, value in estimate.params.items():
                errors.setdefault(name, []).append(100.0 * (value / truth[name] - 1.0))
                stated.setdefault(name, []).append(estimate.relative_std[name])
                inside.append(abs(value - truth[name]) < 1.96 * estimate.bse[name])
        rms = np.median([np.sqrt(np.mean(np.square(one))) for one in errors.values()])
        told = np.median([np.mean(one) for one in stated.values()])
        share = np.mean(inside)
        print(f"{title:10}{level:12.0e}{rows:>7}{rms:10.3f}{told:10.3f}{share:9.2f}{refused / seeds:9.1f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
