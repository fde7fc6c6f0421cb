"""Do stated standard deviations agree with those found, and how far are both from the Cramer-Rao bound?

    python benchmarks/efficiency.py [--records 60] [--only WORD] [--delay none]

The emps300 axis of `interval_coverage.py`, other noise, lengths and sensors a cell; method iv. For every
parameter told: the stated standard deviation over the one found, both as the root of a mean square (wanted:
0.8 to 1.25), and the one found over the Cramer-Rao bound behind the chosen filters (wanted: at most 1.3), in
brackets the bound in % of the value, and the share of 95 % intervals that hold the truth. A star marks what
misses. The bound is that of someone who knows the spectra of all noises and not the motion: rows of the
noise-free record, weighed by the inverse of their noises' covariance over all samples and rows. It counts the
samples that the fit uses.

A number over 60 records is uncertain by a tenth.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from interval_coverage import LINES, NOISE, POSITIONS, model_of, true_records

from modelgen.errors import ModelgenError
from modelgen.runtime.diagnostics.noise_ways import noise_ways
from modelgen.runtime.filter_choice.signal_to_noise import gain
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import IV
from modelgen.runtime.identification.options import CheckOptions
from modelgen.runtime.least_squares.delays import delay_rates
from modelgen.runtime.least_squares.wls import fit_from
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.observation import observe

# Points of the grid on which noise spectra are summed.
POINTS = 1 << 15


@dataclass(frozen=True)
class Cell:
    """What is measured: noise as a multiple of the usual, first-order colour of it, length in s.

    `rounded`: encoders round, in place of white noise. `alone`: only the chirp.
    """

    name: str
    sensors: str = "qm_qc"
    parameters: str = "table_2"
    noise: float = 1.0
    forces: float = 1.0
    colour: float = 0.0
    seconds: float = 2.0
    rounded: bool = False
    alone: bool = False


CELLS = (
    *(Cell(f"{s}, {p}", s, p) for s in ("qm_qc", "qm_ac", "qm") for p in ("table_1", "table_2", "light")),
    *(Cell(f"noise / 10, {p}", "qm_qc", p, 0.1, 0.1) for p in ("table_1", "light")),
    Cell("quiet encoders", noise=0.05),
    Cell("noise * 3", noise=3.0, forces=3.0),
    Cell("noise * 3, accelerometer", "qm_ac", noise=3.0, forces=3.0),
    *(Cell(f"coloured noise, {p}", "qm_qc", p, colour=0.9) for p in ("table_2", "light")),
    Cell("coloured noise, accelerometer", "qm_ac", "light", colour=0.9),
    *(Cell(f"1.5 s, {p}", "qm_qc", p, seconds=1.5) for p in ("table_2", "light")),
    *(Cell(f"chirp alone, {p}", "qm_qc", p, alone=True) for p in ("table_2", "light")),
    *(Cell(f"4096 lines, {p}", "qm_qc", p, rounded=True) for p in ("table_2", "light")),
    Cell("4096 lines, motor alone", "qm", "light", rounded=True),
)


@dataclass(frozen=True)
class Trial:
    """Values and standard deviations (in the intervals, and by noise alone) by name."""

    found: dict[str, tuple[float, float, float]]
    failure: str = ""


def clean_records(cell: Cell, factor: float = 1.0) -> tuple[Record, ...]:
    """Return the noise-free records of a cell."""
    records = true_records(cell.sensors, cell.parameters, False, factor)
    short = [
        Record({key: s[: round(cell.seconds * r.fs)] for key, s in r.signals.items()}, r.fs, r.name, r.tag)
        for r in records
    ]
    return tuple(short[:1] if cell.alone else short)


def noisy(cell: Cell, record: Record, rng: np.random.Generator) -> Record:
    """Return a record as the instruments of a cell read it."""
    from scipy.signal import lfilter

    signals = {}
    for key, samples in record.signals.items():
        if cell.rounded and key in POSITIONS:
            step, start = 2.0 * np.pi / (4.0 * LINES), rng.uniform()
            signals[key] = step * (np.round(samples / step + start) - start)
            continue
        e = rng.standard_normal(samples.size + 500)
        if cell.colour and key != "Gamma_m":
            e = np.sqrt(1.0 - cell.colour**2) * lfilter([1.0], [1.0, -cell.colour], e)
        signals[key] = samples + level(cell, key) * e[500:]
    return Record(signals, record.fs, record.name, record.tag)


def level(cell: Cell, key: str) -> float:
    """Return the standard deviation of a channel's noise."""
    if cell.rounded and key in POSITIONS:
        return 2.0 * np.pi / (4.0 * LINES) / float(np.sqrt(12.0))
    return NOISE[key] * (cell.forces if key == "Gamma_m" else cell.noise)


def estimated(cell: Cell, seed: int, delays: str, checks: bool) -> Estimate:
    """Return the estimate from one noisy set of records."""
    rng = np.random.default_rng((sum(map(ord, cell.name)), seed))
    factor = float(rng.uniform(0.9, 1.1)) if cell.rounded else 1.0
    records = [noisy(cell, record, rng) for record in clean_records(cell, factor)]
    known = CheckOptions(drift_check=checks)
    return identify(model_of(cell.sensors), records, IV(delays=delays), checks=known)


def trial(cell: Cell, delays: str, checks: bool, seed: int) -> Trial:
    """Identify one noisy set of records."""
    try:
        estimate = estimated(cell, seed, delays, checks)
    except ModelgenError as error:
        return Trial({}, str(error))
    return Trial({p.name: (p.value, p.std, p.noise_std) for p in estimate.parameters.physical})


def bound(cell: Cell, delays: str) -> dict[str, float]:
    """Return the Cramer-Rao bound behind the filters of the first estimate: a standard deviation by name."""
    model, clean = model_of(cell.sensors), clean_records(cell)
    choice = estimated(cell, 0, delays, False).fit.filtering
    truth = model.parameter_sets[cell.parameters]
    x = np.asarray(model.base_from_physical(truth), dtype=float)
    observation = observe(model, clean, choice, turns=False).dense()
    exact = fit_from(observation, x)
    slope = model.base_jacobian(truth)
    rates = delay_rates(exact, model, clean, choice, 0, "Gamma_m")
    total = np.zeros((len(model.parameters) + (delays == "estimate"),) * 2)
    for index, record in enumerate(clean):
        ours = [k for k, block in enumerate(exact.blocks) if block.record == index]
        if not ours:
            continue
        columns = [np.column_stack([exact.blocks[k].W @ slope, -rates[k]]) for k in ours]
        G = np.concatenate(columns)[:, : len(total)]
        noise = row_covariance(cell, record, choice, [exact.blocks[k] for k in ours], x)
        # lines far beyond the cut-off carry nothing but rounding
        noise[np.diag_indices_from(noise)] *= 1.0 + 1e-6
        half = np.linalg.solve(np.linalg.cholesky(noise), G)
        total += half.T @ half
    scale = np.sqrt(np.diag(total))
    inverse = np.linalg.pinv(total / np.outer(scale, scale)) / np.outer(scale, scale)
    return dict(zip(model.parameters, np.sqrt(np.diag(inverse)).tolist(), strict=False))


def row_covariance(cell: Cell, record: Record, choice: object, blocks: Sequence, x: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    """Return the covariance of the noise in the rows of a record over all their samples, shape (n, n)."""
    model, factor = model_of(cell.sensors), choice.decimation[blocks[0].record]  # type: ignore[attr-defined]
    f = np.fft.rfftfreq(POINTS, 1.0 / record.fs)
    power = gain(f, choice, 0, record.fs) ** 2  # type: ignore[arg-type]
    entries = noise_ways(model, record, choice, factor)  # type: ignore[arg-type]
    ways = [entries[block.row].of_residual(x).slopes for block in blocks]
    rows = []
    for i, one in enumerate(ways):
        line = []
        for j, other in enumerate(ways):
            cross = np.zeros(len(f), dtype=complex)
            for key in one.keys() & other.keys():
                spectrum = level(cell, key) ** 2 * np.ones(len(f))
                if cell.colour and key != "Gamma_m":
                    z = np.exp(-2j * np.pi * f / record.fs)
                    spectrum *= (1.0 - cell.colour**2) / np.abs(1.0 - cell.colour * z) ** 2
                cross += _response(one[key], f) * np.conj(_response(other[key], f)) * spectrum
            lags = np.fft.irfft(cross * power, POINTS)
            apart = blocks[i].place[:, None] - blocks[j].place[None, :]
            line.append(lags[(factor * apart) % POINTS])
        rows.append(np.hstack(line))
    return np.vstack(rows)


def _response(slopes: Mapping[int, np.ndarray], f: np.ndarray) -> np.ndarray:
    return np.asarray(sum(float(slope[0, 0]) * (2j * np.pi * f) ** order for order, slope in slopes.items()))


def lines(cell: Cell, trials: Sequence[Trial], best: dict[str, float]) -> Iterator[str]:
    """Yield a line a parameter."""
    truth = model_of(cell.sensors).parameter_sets[cell.parameters]
    for name, true in truth.items():
        entries = [t.found[name] for t in trials if name in t.found]
        if len(entries) < 5:
            continue
        values, stated, noise = np.array(entries).T
        found = float(np.std(values, ddof=1))
        ratio = float(np.sqrt(np.mean(noise**2))) / found
        held = float(np.mean(np.abs(values - true) <= 1.96 * stated))
        bias = float(np.mean(values) - true) / found
        lost = found / best[name]
        missed = not 0.8 <= ratio <= 1.25 or lost > 1.3 or not 0.9 <= held <= 0.98
        share, star = 100.0 * best[name] / true, " *" if missed else ""
        yield (
            f"  {name:<6} stated/found {ratio:5.2f}  found/bound {lost:5.2f} ({share:.3g} %)"
            f"  bias {bias:+.2f}  held {held:.2f}  n {len(entries)}{star}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=60)
    parser.add_argument("--only", help="cells whose name contains this")
    parser.add_argument("--delays", default="estimate", choices=("estimate", "none"))
    parser.add_argument("--checks", action="store_true", help="with all that widens intervals")
    parser.add_argument("--workers", type=int, help="processes, by default one a core")
    options = parser.parse_args()
    # numba looks for a module "coverage": no script here is it
    here = Path(__file__).resolve().parent
    sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() != here]
    with ProcessPoolExecutor(options.workers) as pool:
        for cell in CELLS:
            if options.only and options.only not in cell.name:
                continue
            one = partial(trial, cell, options.delays, options.checks)
            trials = list(pool.map(one, range(options.records), chunksize=5))
            print(cell.name, flush=True)
            for line in lines(cell, trials, pool.submit(bound, cell, options.delays).result()):
                print(line, flush=True)
            for failure in dict.fromkeys(t.failure for t in trials if t.failure):
                print(f"  failed: {failure}")


if __name__ == "__main__":
    main()
