"""The paper, end to end: derive emps300, simulate its bench, identify it, and compare with the true values.

M.T. Pham, Ph. Poignet, M. Gautier, ICRA 2002: the sets `table_1` and `table_2` of the spec are the
benches of its Tables 1 and 2. Everything is seeded: the numbers are the same every time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from modelgen.cli.figure import Panel, draw_forces
from modelgen.progress import counted, step
from modelgen.render.writer import write_modules
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import Pham2002
from modelgen.runtime.model.model import Model, load_model
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.observation import observe
from modelgen.runtime.rows.record_rows import matched_rows
from modelgen.runtime.simulation.default_excitation import default_excitation
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, load_spec

CHAIN = "emps300"
SENSOR_SETS = ("qm_qc", "qm_ac")
PARAMETER_SETS = ("table_1", "table_2")
FS_HZ = 5000.0
DURATION_S = 10.0
CHIRP_BAND_HZ = (20.0, 200.0)
NOISE = {"q_m": 2e-5, "q_c": 2e-5, "a_c": 2.0, "Gamma_m": 1e-4}  # rad, rad, rad/s^2, N m rms
# The paper's filter; `wls` chooses its own from the records.
PAPER_CUTOFF_HZ = 2500.0 / (2.0 * math.pi)
PAPER_DECIMATION = 10
# The records that are written out, and the windows of the picture in s.
SAMPLE_SETS = ("table_2", "qm_ac")
WINDOWS_S = {"chirp": (4.0, 4.2), "trapezoid": (0.0, 1.0)}


def run_demo(folder: Path) -> dict[str, Any]:
    """Run the demo and return what it found as plain values.

    Parameters
    ----------
    folder : Path
        Gets the two modules, two records and the picture; created if absent.
    """
    spec = load_spec(catalog_path(CHAIN))
    step(f"deriving {CHAIN}")
    modules = write_modules(spec, SENSOR_SETS, folder)
    models = {name: load_model(path) for name, path in zip(SENSOR_SETS, modules, strict=True)}
    paths, tables, panels = list[Path](), [], list[Panel]()
    for parameter_set, sensor_set in counted(list(product(PARAMETER_SETS, models)), "identifying"):
        true, model = spec.parameter_sets[parameter_set], models[sensor_set]
        records = _bench(model, true)
        estimates = {method: _identify(model, records, method) for method in ("wls", "pham2002")}
        tables.append({"parameter_set": parameter_set, **_compare(model, true, estimates)})
        if (parameter_set, sensor_set) == SAMPLE_SETS:
            paths = _write_records(records, folder)
        if sensor_set == SAMPLE_SETS[1]:
            panels += [_panel(model, record, estimates["wls"], parameter_set) for record in records]
    step("drawing")
    picture = _draw(panels, folder / "demo.png")
    return {
        "modules": [str(path) for path in modules],
        "records": [str(path) for path in paths],
        "picture": str(picture) if picture else None,
        "fs_hz": FS_HZ,
        "duration_s": DURATION_S,
        "chirp_band_hz": list(CHIRP_BAND_HZ),
        "noise": dict(NOISE),
        "pham2002": {"cutoff_hz": PAPER_CUTOFF_HZ, "decimation": PAPER_DECIMATION},
        "tables": tables,
    }


def _bench(model: Model, true: Mapping[str, float]) -> list[Record]:
    """Return the two experiments as the sensors of this model would record them."""
    noise = {key: std for key, std in NOISE.items() if key in model.channels}
    chirp = default_excitation("chirp", model, true, FS_HZ, duration_s=DURATION_S, band_hz=CHIRP_BAND_HZ)
    trapezoid = default_excitation("trapezoid", model, true, FS_HZ, duration_s=DURATION_S)
    return [
        simulate(model, true, excitation, fs=FS_HZ, noise=noise, seed=seed).record
        for seed, excitation in enumerate((chirp, trapezoid))
    ]


def _identify(model: Model, records: Sequence[Record], method: str) -> Estimate:
    if method != "pham2002":
        return identify(model, records, method=method)
    paper = Pham2002(rows_for_tag="pham2002")
    return identify(model, records, paper, cutoff_hz=PAPER_CUTOFF_HZ, decimation=PAPER_DECIMATION)


def _compare(model: Model, true: Mapping[str, float], estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    """Return, per parameter and method: estimate, error in % of the true value and in standard deviations."""
    rows = []
    for name in model.base_parameters:
        methods = {}
        for method, estimate in estimates.items():
            value, error = estimate.params[name], estimate.params[name] - true[name]
            methods[method] = {
                "estimate": value,
                "error_percent": 100.0 * error / true[name],
                "error_in_std": error / estimate.bse[name],
            }
        rows.append({"parameter": name, "unit": model.units[name], "true": true[name], "methods": methods})
    filters = {
        method: {"cutoff_hz": e.fit.filtering.cutoff_hz, "decimation": list(e.fit.filtering.decimation)}
        for method, e in estimates.items()
    }
    return {"sensor_set": model.sensor_set, "filters": filters, "rows": rows}


def _write_records(records: Sequence[Record], folder: Path) -> list[Path]:
    paths = [folder / f"{record.name}.npz" for record in records]
    for path, record in zip(paths, records, strict=True):
        write_record(path, record, overwrite=True)
    return paths


def _panel(model: Model, record: Record, estimate: Estimate, parameter_set: str) -> Panel:
    """Return force and W x of the undifferentiated row, filtered as for the estimate, at the full rate."""
    choice = replace(estimate.fit.filtering, decimation=(1,))
    row = next(index for index, info in enumerate(model.rows) if not info.differentiated)
    rows = matched_rows(model, record, choice, factor=1)
    block = observe(model, [record], choice).blocks[row]
    measured = rows.lines()[row][-1]
    # where the motor sticks, sign() is meaningless and the row is masked: a gap in the line
    rebuilt = np.full(len(measured), np.nan)
    rebuilt[block.place] = block.W @ estimate.base
    time_s = np.array(rows.grid) / record.fs
    start, stop = WINDOWS_S[record.name]
    shown = (time_s >= start) & (time_s <= stop)
    title = f"{parameter_set}, {model.sensor_set}, {record.name}: row {block.row_name}"
    title += " (not rebuilt at rest)" if block.masked else ""
    return Panel(title, block.unit, time_s[shown], measured[shown], rebuilt[shown])


def _draw(panels: Sequence[Panel], path: Path) -> Path | None:
    """Draw the picture and return its path, or None where matplotlib is missing."""
    try:
        draw_forces(panels, path)
    except ImportError:
        return None
    return path
