"""The same records by modelgen and by what a user would take otherwise: errors, intervals, lines, seconds.

    pip install -e '.[peers]'
    python benchmarks/peers.py [--emps DATA_EMPS.mat] [--records 5] [--only WORD]

Two bodies behind a spring, both encoders read, from a simulator that shares nothing with modelgen (true stick
and slip; `off_bench_machine`); and the public record of the EMPS bench (one carriage), where it is at hand,
against its published values. Each program has what suits it: stretches that do not drift for simulations, a
start 30 % off where one is needed, filters for rows. Lines are those that a user has to write, blank ones and
docstrings left out; seconds are the processor's, of one pair of records. "holds" is how many of the 95 %
intervals hold the truth.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import inspect
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import off_bench
import peers_one_body as one_body
import peers_two_bodies as two_bodies
from off_bench_kinds import Kind, kinds

import modelgen
from modelgen.cli.candidates import spec_model
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record
from modelgen.spec.load import load_spec

Found = dict[str, tuple[float, float]]
PUBLISHED = {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "offset": -3.1648}
DRIVE_GAIN = 35.15065188  # N / V, published with the record
CODE_LINES = 3  # load the model, read the files, identify


def by_modelgen(model: Model, records: Sequence[Record]) -> Found:
    """Return value and half of the 95 % interval by name, with the defaults."""
    estimate = modelgen.identify(model, records)
    return {p.name: (p.value, 1.96 * p.std) for p in estimate.parameters.physical}


def lines_of(function: Callable[..., object]) -> int:
    """Return how many lines of a function a user has to write."""
    source = inspect.getsource(function).splitlines()
    document = len((function.__doc__ or "").splitlines())
    return len([line for line in source if line.strip()]) - document


def mode(found: Mapping[str, tuple[float, float]]) -> float:
    """Return the frequency in Hz of the mode that values belong to, NaN without all of them."""
    if "f_1" in found:
        return found["f_1"][0]
    if not {"K", "J_m", "J_c"} <= {*found}:
        return float("nan")
    J_m, J_c, K = (max(found[name][0], 0.0) for name in ("J_m", "J_c", "K"))
    return float(np.sqrt(K * (1.0 / J_m + 1.0 / J_c)) / (2.0 * np.pi)) if J_m and J_c else float("nan")


def row(title: str, runs: Sequence[Found], truth: Mapping[str, float], lines: int, spent: float) -> str:
    """Return a line of the table: rms errors in %, how many intervals hold, lines, seconds."""
    cells = []
    for name, true in truth.items():
        errors = [run[name][0] / true - 1.0 for run in runs if name in run]
        cells.append(f"{100.0 * float(np.sqrt(np.mean(np.square(errors)))):.2g}" if errors else "-")
    told = [(run[n][0], run[n][1], true) for run in runs for n, true in truth.items() if n in run]
    stated = [(v, half, true) for v, half, true in told if np.isfinite(half)]
    holds = sum(abs(v - true) <= half for v, half, true in stated)
    covered = f"{holds} of {len(stated)}" if stated else "none stated"
    return f"| {title} | " + " | ".join(cells) + f" | {covered} | {lines} | {spent:.1f} |"


def table(truth: Mapping[str, float], sides: Mapping[str, tuple[Callable[..., Found], int]],
          inputs: Sequence[tuple[object, ...]]) -> None:  # fmt: skip
    """Print the table of one problem; `inputs` are what every side is called with, one after the other."""
    print("| | " + " | ".join(truth) + " | holds | lines | seconds |")
    print("|---|" + "---|" * (len(truth) + 3))
    for title, (side, lines) in sides.items():
        runs: list[Found] = []
        begun = time.process_time()
        for arguments in inputs:
            try:
                runs.append(side(*arguments))
            except (RuntimeError, ValueError, np.linalg.LinAlgError, ImportError) as error:
                print(f"| {title} | fails: {str(error)[:90]} |")
        spent = (time.process_time() - begun) / max(len(inputs), 1)
        if runs:
            print(row(title, runs, truth, lines, spent), flush=True)


def drive(count: int, only: str) -> None:
    """Print the table of the two bodies."""
    kind = next(one for one in kinds() if one.name == "plain drive")
    truth = kind.truth
    guess = {name: 1.3 * value for name, value in truth.items()}
    spec = len([line for line in kind.spec.splitlines() if line.strip()])
    model = off_bench.model_of(kind.spec)
    truth = {**truth, "f_1": mode({name: (value, 0.0) for name, value in truth.items()})}

    def with_mode(side: Callable[..., Found], records: Sequence[Record], start: Mapping[str, float]) -> Found:
        found = side(records, start)
        return {**found, "f_1": (mode(found), np.nan)}

    peers = {
        "SciPy, output error by hand": two_bodies.scipy_output_error,
        "SciPy's filters, statsmodels WLS": two_bodies.statsmodels_rows,
        "mujoco.sysid": two_bodies.mujoco_sysid,
        "opty (Ipopt)": two_bodies.opty_collocation,
        "python-control, ERA": two_bodies.control_era,
    }
    sides = {
        "modelgen": (partial(with_mode, lambda records, _: by_modelgen(model, records)), spec + CODE_LINES)
    }
    sides |= {title: (partial(with_mode, side), lines_of(side)) for title, side in peers.items()}
    chosen = {title: side for title, side in sides.items() if only in title}
    print(f"Two bodies, {count} pairs of records: rms error in %")
    table(truth, chosen, [(records_of(kind, seed), guess) for seed in range(count)])


def records_of(kind: Kind, seed: int) -> list[Record]:
    """Return a chirp and a trapezoid."""
    rng = np.random.default_rng(seed)
    return [off_bench.record(kind, name, rng, 1.0) for name in kind.motions]


def carriage(path: Path, only: str) -> None:
    """Print the table of the public record."""
    from scipy.io import loadmat

    held = loadmat(path, variable_names=["qm", "vir"])
    force = DRIVE_GAIN * held["vir"].ravel()
    record = Record({"q_m": held["qm"].ravel(), "F": force}, 1000.0, "EMPS")
    spec = Path(modelgen.__file__).parent / "catalog" / "emps_rigid.toml"
    model = spec_model(load_spec(spec), "qm")
    written = [line for line in spec.read_text().splitlines() if line.strip() and not line.startswith("#")]
    peers = {
        "SciPy, output error by hand": one_body.scipy_output_error,
        "SciPy's filters, statsmodels OLS": one_body.statsmodels_rows,
        "Pinocchio's regressor, numpy": one_body.pinocchio_rows,
    }
    sides = {"modelgen": (lambda one: by_modelgen(model, [one]), len(written) + CODE_LINES)}
    sides |= {title: (side, lines_of(side)) for title, side in peers.items()}
    print("EMPS: difference from the published values in %")
    table(PUBLISHED, {title: side for title, side in sides.items() if only in title}, [(record,)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=5, help="pairs of records of the two bodies")
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat, the public record")
    parser.add_argument("--only", default="", help="programs whose title contains this")
    options = parser.parse_args()
    drive(options.records, options.only)
    if options.emps is not None:
        print()
        carriage(options.emps, options.only)


if __name__ == "__main__":
    main()
