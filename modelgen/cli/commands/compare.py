"""`modelgen compare`: regressors, orders, conditioning and noise of several models, and their estimates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modelgen.cli.arguments import period_from
from modelgen.cli.data_arguments import DataOptions, read_files, reading_lines, tagged
from modelgen.cli.estimation_options import Cutoff, EstimationOptions, Method, Pairing, Periods, Tags
from modelgen.cli.options import Json, SensorSet, Trust, refuse_given
from modelgen.cli.output import note, print_json
from modelgen.errors import DataError, ModelgenError
from modelgen.progress import counted, step

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.records.record import Record


Sources = Annotated[
    list[str],
    typer.Argument(metavar="SPEC_OR_MODULE", help="TOML files, catalogue names, generated modules."),
]
PairParameters = Annotated[
    str | None, typer.Option(metavar="SET", help="The parameter set of the simulated pair; the first.")
]
Records = Annotated[
    list[Path] | None, typer.Option(metavar="FILE", help="A record for all models; repeatable.")
]
Yardsticks = Annotated[
    bool, typer.Option("--yardsticks", help="Also other estimators on FILE, with times; one model will do.")
]


def compare(
    sources: Sources,
    given: DataOptions,
    estimation: EstimationOptions,
    sensors: SensorSet = None,
    parameters: PairParameters = None,
    fs_hz: Annotated[float, typer.Option(help="Sampling frequency in Hz of the simulated pair.")] = 5000.0,
    data: Records = None,
    method: Method = "auto",
    cutoff_hz: Cutoff = None,
    tag: Tags = None,
    pairing: Pairing = "all",
    period_s: Periods = None,
    yardsticks: Yardsticks = False,
    trust: Trust = False,
    as_json: Json = False,
) -> None:
    """Compare sensor sets: their regressors by exact algebra, what they need, and their estimates.

    Condition numbers and noise gains come from a simulated, noise-free chirp and trapezoid.
    """
    from modelgen.cli.compare_tables import comparison_tables
    from modelgen.cli.tables import console

    if not data:
        refuse_given(given, "--data")
        refuse_given(estimation, "--data", (cutoff_hz, tag, pairing != "all", period_s))
    models = _models(sources, sensors, trust, 1 if yardsticks and data else 2)
    described = describe(models, parameters, fs_hz)
    if data:
        readings = tagged(read_files(data, list(models.values()), given), tag or ())
        note(reading_lines(data, readings))
        records = [reading.record for reading in readings]
        period = period_from(period_s or (), given.map_file)
        paired = None if pairing == "all" else pairing
        settings = estimation.settings(
            method, given, cutoff_hz=cutoff_hz, period_s=period, rows_for_tag=paired
        )
        step("identifying")
        described["estimates"] = _estimates(models, records, settings)
        if yardsticks:
            described["yardsticks"] = {title: _yardsticks(model, records) for title, model in models.items()}
    if as_json:
        print_json(described)
    else:
        console().print(comparison_tables(described))


def _models(sources: Sequence[str], sensors: str | None, trust: bool, fewest: int) -> dict[str, Model]:
    """Return the models by a title that distinguishes them; a spec gives one per sensor set."""
    from modelgen.cli.arguments import load_chain, sensor_sets
    from modelgen.render.writer import generate, module_name
    from modelgen.runtime.model.model import load_model, model_from_text

    found: dict[str, Model] = {}
    for source in sources:
        if Path(source).suffix == ".py":
            found[Path(source).stem] = load_model(source, trust)
            continue
        chain = load_chain(source)
        for name in sensor_sets(chain, sensors):
            title = module_name(chain, name)
            found[title] = model_from_text(generate(chain, name), title)
    if len(found) < fewest:
        remedy = "give two or more models: modules, specs, or a spec with several sensor sets"
        raise DataError.at("SPEC_OR_MODULE", f"names {len(found)} model", remedy)
    return found


def describe(models: dict[str, Model], parameters: str | None, fs_hz: float) -> dict[str, Any]:
    """Return models and relations as plain values."""
    from modelgen.cli.formal_rows import formal_regressor
    from modelgen.symbolic.compare import compare as relate

    formal = [formal_regressor(model, title) for title, model in models.items()]
    relations = [relate(a, b) for a, b in combinations(formal, 2)]
    return {
        "models": [
            _describe_model(title, model, parameters, fs_hz)
            for title, model in counted(list(models.items()), "simulating")
        ],
        "regressors": [
            {"first": r.first, "second": r.second, "verdict": r.verdict, "rows": list(r.lines)}
            for r in relations
        ],
    }


def _describe_model(title: str, model: Model, parameters: str | None, fs_hz: float) -> dict[str, Any]:
    from modelgen.runtime.comparison.sensor_set_comparison import conditioning

    described: dict[str, Any] = {
        "model": title,
        "rows": [{"name": r.name, "order": r.order, "differentiated": r.differentiated} for r in model.rows],
        "order": max(row.order for row in model.rows),
        "base_parameters": list(model.base_parameters),
        "identifiable": list(model.identifiable),
        "condition_number": None,
        "gains": [],
    }
    chosen = parameters or next(iter(model.parameter_sets), None)
    if chosen not in model.parameter_sets:
        described["why"] = "no parameter set to simulate with" if chosen is None else f"no set {chosen}"
        return described
    try:
        found = conditioning(model, str(chosen), fs_hz)
    except ModelgenError as error:
        described["why"] = "; ".join(str(problem) for problem in error.problems)
        return described
    return described | asdict(found)


def _yardsticks(model: Model, records: Sequence[Record]) -> dict[str, Any]:
    from modelgen.runtime.comparison.other_estimators import measure

    found = measure(model, [record.select(model.channels) for record in records])
    return {
        "methods": [
            {
                "method": y.method,
                "seconds": y.seconds,
                "reason": y.reason,
                "parameters": {n: {"value": v, "interval_95": [a, b]} for n, v, a, b in y.parameters},
            }
            for y in found.methods
        ],
        "modes": [
            {"source": source, "modes": [asdict(mode) for mode in modes]} for source, modes in found.modes
        ],
    }


def _estimates(
    models: dict[str, Model], records: Sequence[Record], settings: dict[str, Any]
) -> dict[str, Any]:
    from modelgen.runtime.comparison.sensor_set_comparison import consistency, estimates_of

    found = dict(zip(models, estimates_of(list(models.values()), records, **settings), strict=True))
    return {
        "parameters": {
            title: {
                name: {"value": estimate.params[name], "std": estimate.bse[name], "interval_95": interval}
                for name, interval in estimate.conf_int().items()
            }
            for title, estimate in found.items()
        },
        "not_identifiable": {title: dict(e.not_identifiable) for title, e in found.items()},
        "consistency": [
            {
                "first": c.first,
                "second": c.second,
                "names": list(c.names),
                "deviations_in_std": list(c.deviations),
                "chi2": c.statistic,
                "p_value": c.p_value,
                "consistent": c.consistent,
            }
            for c in consistency(found)
        ],
    }
