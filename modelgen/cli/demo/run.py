"""The paper, end to end: derive emps300, simulate its bench, identify it, compare with the printed tables.

M.T. Pham, Ph. Poignet, M. Gautier, ICRA 2002. No record of the bench is public: it is simulated with the
values of Tables 1 and 2, so that these are what an estimate has to find. Everything is seeded: the numbers
are the same every time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from modelgen.atomic_write import write_whole
from modelgen.cli.demo.bench import CHIRP_BAND_HZ, DURATION_S, FS_HZ, NOISE, bench
from modelgen.cli.demo.closed_loop_figure import draw_closed_loop
from modelgen.cli.demo.printed_tables import PRINTED_TABLES, PrintedTable
from modelgen.progress import counted, step
from modelgen.render.target_writer import write_target
from modelgen.report.chain_drawing import draw_chain
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.methods import Pham2002
from modelgen.runtime.model.model import Model, load_model
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.write_record import write_record
from modelgen.runtime.results.estimate import Estimate
from modelgen.spec.load import catalog_path, load_spec

CHAIN = "emps300"
ENCODERS, ACCELEROMETER = "qm_qc", "qm_ac"
PAPER_DECIMATION = 10
METHODS = ("default", "pham2002")


def run_demo(folder: Path) -> dict[str, Any]:
    """Run the demo and return what it found as plain values.

    Parameters
    ----------
    folder : Path
        Gets the two modules, two records and the figures; created if absent.
    """
    spec = load_spec(catalog_path(CHAIN))
    step(f"deriving {CHAIN}")
    sets = (ENCODERS, ACCELEROMETER)
    modules = write_target(spec, sets, folder)
    models = {name: load_model(path) for name, path in zip(sets, modules, strict=True)}
    picture = folder / "figure_2.svg"
    write_whole(picture, draw_chain(spec).encode(), overwrite=True)
    tables, figures, written = [], list[Path | None]([picture]), list[Path]()
    for printed in counted(PRINTED_TABLES, "identifying"):
        true, model = spec.parameter_sets[printed.parameter_set], models[printed.sensor_set]
        records = [experiment.record for experiment in bench(model, true)]
        estimates = {method: _identify(model, records, method, printed) for method in METHODS}
        tables.append(_compare(printed, model, true, estimates))
        path = folder / f"figure_{printed.number + 2}.png"
        figures.append(draw_closed_loop(printed, models[ENCODERS], true, estimates["default"].physical, path))
        written = _write_records(records, folder)  # those of Table 2 stay
    return {
        "modules": [str(path) for path in modules],
        "records": [str(path) for path in written],
        "figures": [str(path) for path in figures if path],
        "fs_hz": FS_HZ,
        "duration_s": DURATION_S,
        "chirp_band_hz": list(CHIRP_BAND_HZ),
        "noise": dict(NOISE),
        "tables": tables,
    }


def _identify(model: Model, records: Sequence[Record], method: str, printed: PrintedTable) -> Estimate:
    if method != "pham2002":
        return identify(model, records)
    paper = Pham2002(rows_for_tag="pham2002")
    cutoff_hz = printed.cutoff_rad_s / (2.0 * math.pi)
    return identify(model, records, paper, cutoff_hz=cutoff_hz, decimation=PAPER_DECIMATION)


def _compare(
    printed: PrintedTable, model: Model, true: Mapping[str, float], estimates: Mapping[str, Estimate]
) -> dict[str, Any]:
    """Return, per parameter, what is printed and what each method finds, with deviations and error."""
    rows = []
    for name in model.base_parameters:
        two_std, relative_std = printed.deviations[name]
        rows.append(
            {
                "parameter": name,
                "unit": model.units[name],
                "printed": {"value": true[name], "two_std": two_std, "relative_std_percent": relative_std},
                "methods": {key: _found(estimate, name, true) for key, estimate in estimates.items()},
            }
        )
    filters = {
        key: {
            "method": estimate.fit.method,
            "cutoff_hz": estimate.fit.filtering.cutoff_hz,
            "decimation": list(estimate.fit.filtering.decimation),
        }
        for key, estimate in estimates.items()
    }
    return {
        "table": printed.number,
        "parameter_set": printed.parameter_set,
        "sensor_set": printed.sensor_set,
        "cutoff_rad_s": printed.cutoff_rad_s,
        "filters": filters,
        "rows": rows,
    }


def _found(estimate: Estimate, name: str, true: Mapping[str, float]) -> dict[str, float]:
    value, std = estimate.params[name], estimate.bse[name]
    return {
        "value": value,
        "two_std": 2.0 * std,
        "relative_std_percent": 100.0 * std / abs(value),
        "error_percent": 100.0 * (value - true[name]) / true[name],
        "error_in_std": (value - true[name]) / std,
    }


def _write_records(records: Sequence[Record], folder: Path) -> list[Path]:
    paths = [folder / f"{record.name}.npz" for record in records]
    for path, record in zip(paths, records, strict=True):
        write_record(path, record, overwrite=True)
    return paths
