"""The TX40 identified: against published values, on halves of the record, against plain SciPy in time.

    .venv/bin/python benchmarks/tx40.py

Processor time, the best of three. The pipeline by hand has the regressor of the generated module ready: it
filters, differentiates, fills the entries, decimates those that are not zero and solves with weights.
"""

from __future__ import annotations

import csv
import re
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import modelgen
from modelgen.array_types import FloatArray
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.model.model import model_from_text
from modelgen.spec.arms.load import load_arm
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "tx40"
FS = 5000.0
GEARS = np.array([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
# rad/s of joints below which they leave samples out
SLOW = (0.0501, 0.0501, 0.0750, 0.0716, 0.0559, 0.1222)
SLOW_SPEEDS = {f"q_{axis}": speed for axis, speed in enumerate(SLOW, start=1)}
# what they did: Butterworth of order 4, MATLAB's decimation, all of it
PUBLISHED = modelgen.Filters(
    cutoff_hz=100.0, filter_order=4, decimation=100, slow_speeds=SLOW_SPEEDS, filtered_forces=True
)
# matched rows with their cut-offs; the rows' own low-pass has its share of the decimated rate
GIVEN = modelgen.Filters(
    cutoff_hz=20.0,
    signal_cutoff_hz=100.0,
    decimation=100,
    direction_cutoff_hz=100.0,
    slow_speeds=SLOW_SPEEDS,
)
WAYS = (
    ("as published", "pham2002", PUBLISHED),
    ("with their cut-offs", "auto", GIVEN),
    ("default", "auto", modelgen.Filters()),
)
TRUSTED_PERCENT = 10.0
PUBLISHED_NAMES = {"Iam6": "Ia_6_motor", "fvm6": "Fv_6_motor", "fsm6": "Fs_6_motor"}


def arm() -> modelgen.Model:
    """Return the model of the arm in the catalogue."""
    spec = load_arm(Path(modelgen.__file__).parent / "catalog" / "arms" / "tx40.toml")
    return model_from_text(arm_module(arm_base_model(arm_rows(spec))), "tx40")


def record() -> modelgen.Record:
    """Return the measured record: positions of joints in rad, torques of motors in N m."""
    motors = np.loadtxt(DATA / "pos_read_data.csv", delimiter=",", skiprows=1)
    torques = np.loadtxt(DATA / "curr_data.csv", delimiter=",", skiprows=1)
    transmission = np.diag(GEARS)
    transmission[5, 4] = 32.0
    joints = np.linalg.solve(transmission, motors.T)
    signals = {f"q_{k + 1}": q for k, q in enumerate(joints)}
    return modelgen.Record({**signals, **{f"tau_{k + 1}": t for k, t in enumerate(torques.T)}}, FS, "tx40")


def published() -> dict[str, tuple[float, float]]:
    """Return value and deviation in % of their weighted least squares, by the first parameter of each sum."""
    found = {}
    with (DATA / "TX40_bp_5.csv").open() as lines:
        for grouping, _, _, value, percent in csv.reader(lines):
            first = grouping.split()[0]
            name = re.sub(r"(\d)$", r"_\1", first[0].upper() + first[1:] if first[0] == "f" else first)
            found[PUBLISHED_NAMES.get(first, name)] = (float(value), float(percent))
    return found


def deviations(estimate: Any) -> dict[str, float]:
    """Return by what share the trusted published values differ from an estimate's."""
    ours = as_published({name.removesuffix("_R"): value for name, value in estimate.params.items()})
    return {
        name: abs(ours[name] / value - 1.0)
        for name, (value, percent) in published().items()
        if percent < TRUSTED_PERCENT and name in ours
    }


def as_published(ours: Mapping[str, float]) -> dict[str, float]:
    """Return values where the motor of axis 6 acts on the other axis only: theirs have its share in both."""
    found = dict(ours)
    for kind in ("Ia", "Fv"):
        for axis in ("5", "6"):
            found[f"{kind}_{axis}"] = ours.get(f"{kind}_{axis}", np.nan) + ours.get(f"{kind}_6_motor", np.nan)
    return found


def inertia_of_axis_6(estimate: Any) -> tuple[float, float]:
    """Return what their Ia6 is, and its standard deviation: what the axis has of its own, and its motor."""
    names = list(estimate.params)
    both = [names.index(name) for name in ("Ia_6", "Ia_6_motor") if name in names]
    variance = np.asarray(estimate.cov_params())[np.ix_(both, both)].sum()
    return sum(estimate.params[names[at]] for at in both), float(np.sqrt(variance))


def by_hand(model: modelgen.Model, measured: modelgen.Record) -> FloatArray:
    """Return base parameters by the published pipeline, plain SciPy, shape (61,)."""
    from scipy.signal import butter, decimate, filtfilt

    b, a = butter(4, 100.0, fs=FS)
    signals: dict[str, FloatArray] = {}
    for k in range(1, 7):
        q = filtfilt(b, a, measured.signals[f"q_{k}"])
        speed = np.gradient(q, 1.0 / FS)
        signals |= {f"q_{k}": q, f"d1_q_{k}": speed, f"d2_q_{k}": np.gradient(speed, 1.0 / FS)}
        signals[f"tau_{k}"] = filtfilt(b, a, measured.signals[f"tau_{k}"])

    def twice(line: FloatArray) -> FloatArray:
        return np.asarray(decimate(decimate(line, 10), 10))

    lines = model.module.entries(signals)
    left = model.module.measurement(signals).T
    rows = []
    for row in range(6):
        y = twice(left[row])
        W = np.zeros((len(y), len(model.base_parameters)))
        for (at, column), line in zip(model.module.ENTRIES, lines, strict=True):
            if at == row:
                W[:, column] = twice(line)
        fast = np.abs(signals[f"d1_q_{row + 1}"][::100]) > SLOW[row]
        rows.append((W[fast], y[fast]))
    W, y = np.concatenate([W for W, _ in rows]), np.concatenate([y for _, y in rows])
    x = np.linalg.lstsq(W, y, rcond=None)[0]
    weights = np.concatenate([np.full(len(y), 1.0 / np.std(y - W @ x)) for W, y in rows])
    return np.asarray(np.linalg.lstsq(W * weights[:, None], y * weights, rcond=None)[0])


def seconds(work: Callable[[], object]) -> float:
    """Return the processor time of the best of three."""
    found = []
    for _ in range(3):
        begin = time.process_time()
        work()
        found.append(time.process_time() - begin)
    return min(found)


def halves(model: modelgen.Model, measured: modelgen.Record) -> Mapping[str, float]:
    """Return by how many standard deviations of both the halves of the record differ."""
    middle = measured.n // 2
    first, second = (
        modelgen.identify(model, measured.part(start, stop, name))
        for start, stop, name in ((0, middle, "first"), (middle, measured.n, "second"))
    )
    both = [name for name in first.params if name in second.params]
    return {
        name: (first.params[name] - second.params[name]) / float(np.hypot(first.bse[name], second.bse[name]))
        for name in both
    }


def plain_error(estimate: Any) -> float:
    """Return |Y - W X| / |Y| of all rows in N m, without weights, as the published figure is."""
    rows = estimate.fit.rows
    left = sum(row.used * row.residual_rms**2 for row in rows)
    return float(np.sqrt(left / sum(row.used * (row.residual_rms / row.relative_error) ** 2 for row in rows)))


def main() -> None:
    """Print all comparisons."""
    model, measured = arm(), record()
    for title, method, filters in WAYS:
        estimate = modelgen.identify(model, measured, method, filters)
        off = np.array(list(deviations(estimate).values()))
        axis, spread = inertia_of_axis_6(estimate)
        print(f"{title} ({estimate.fit.method}): {len(estimate.params)} of 61 base parameters, residual "
              f"{100.0 * plain_error(estimate):.2f} % unweighted (theirs 5.25) and "
              f"{100.0 * estimate.fit.relative_error:.2f} % weighted, {len(off)} trusted values differ by a "
              f"median of {100.0 * np.median(off):.2f} % (worst {100.0 * off.max():.1f} %), Ia6 {axis:.5f} "
              f"+- {spread:.5f}, motor of axis 6 alone {estimate.params['Ia_6_motor']:.5f} +- "
              f"{estimate.bse['Ia_6_motor']:.5f}")  # fmt: skip
    z = np.array(list(halves(model, measured).values()))
    print(f"halves: {len(z)} parameters, {100.0 * np.mean(np.abs(z) < 1.96):.0f} % within 1.96 deviations")
    hand = seconds(lambda: by_hand(model, measured))
    print(f"by hand {hand:.2f} s")
    for title, checks in (
        ("checked", modelgen.CheckOptions()),
        ("unchecked", modelgen.CheckOptions(tests=False)),
    ):
        for name, method, filters in WAYS:
            taken = seconds(
                lambda m=method, f=filters, c=checks: modelgen.identify(model, measured, m, f, checks=c)
            )
            print(f"{title}, {name}: {taken:.2f} s, {taken / hand:.2f} of by hand")


if __name__ == "__main__":
    main()
