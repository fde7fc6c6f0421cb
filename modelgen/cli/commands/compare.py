"""`modelgen compare`: regressors, orders, conditioning and noise of several models, and their estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modelgen.cli.arguments import amounts
from modelgen.cli.data_arguments import DataOptions, read_files, reading_lines, tagged
from modelgen.cli.estimation_options import (
    Cutoff,
    EstimationOptions,
    Method,
    Pairing,
    Periods,
    Tags,
    settings_typed,
)
from modelgen.cli.options import ResultOptions, SensorSet, Trust, Values, refuse_given
from modelgen.cli.output import deliver, note
from modelgen.cli.output_files import check_result
from modelgen.cli.result_pages.printed_parts import intervals_of
from modelgen.cli.result_pages.write_page import ReportFile, check_report, write_result_page
from modelgen.errors import DataError, ModelgenError, listed
from modelgen.progress import counted, step

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.results.estimate import Estimate


Sources = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE", help="TOML files, catalogue names, generated modules; saved estimates (.json)."
    ),
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

PAIR_HZ = 5000.0  # sampling frequency of the simulated pair


def compare(
    context: typer.Context,
    sources: Sources,
    given: DataOptions,
    estimation: EstimationOptions,
    sensors: SensorSet = None,
    parameters: PairParameters = None,
    data: Records = None,
    method: Method = "auto",
    cutoff_hz: Cutoff = None,
    tag: Tags = None,
    pairing: Pairing = "all",
    period_s: Periods = None,
    value: Values = None,
    yardsticks: Yardsticks = False,
    report_file: ReportFile = None,
    trust: Trust = False,
    *,
    result: ResultOptions,
) -> None:
    """Compare sensor sets: their regressors by exact algebra, what they need, and estimates.

    Condition numbers and noise gains come from a simulated, noise-free chirp and trapezoid, at 5 kHz unless
    --fs says otherwise.
    """
    from modelgen.cli.compare_tables import comparison_tables
    from modelgen.cli.tables import console
    from modelgen.runtime.comparison.sensor_set_comparison import estimates_of
    from modelgen.runtime.results.estimate import Estimate

    check_result(result)
    check_report(report_file, result.overwrite)
    if not data:
        refuse_given(replace(given, fs=None), "--data")
        refuse_given(estimation, "--data", (cutoff_hz, tag, pairing != "all", period_s))
    saved = {source: Estimate.load(source) for source in sources if Path(source).suffix == ".json"}
    models = _models([source for source in sources if source not in saved], sensors, trust)
    models = _known(models, amounts("--set", value or ()))
    if len(models) + len(saved) < (1 if yardsticks and data else 2):
        remedy = "give two or more models or estimates: modules, specs with sensor sets, saved estimates"
        raise DataError.at("SOURCE", f"names {len(models) + len(saved)} model", remedy)
    described = describe(models, parameters, given.fs or PAIR_HZ)
    found: dict[str, Estimate] = {}
    if data:
        readings = tagged(read_files(data, list(models.values()), given), tag or ())
        note(reading_lines(data, readings))
        records = [reading.record for reading in readings]
        step("identifying")
        every = estimates_of(list(models.values()), records, **settings_typed(context.params))
        found = dict(zip(models, every, strict=True))
        if yardsticks:
            described["yardsticks"] = {title: _yardsticks(model, records) for title, model in models.items()}
    if saved or data:
        described["estimates"] = _describe_estimates({**saved, **found})
    deliver(described, lambda: console().print(comparison_tables(described)), result)
    title, intervals = f"Comparison of {listed([*models, *saved])}", intervals_of({**saved, **found})
    printed = comparison_tables(described)
    write_result_page(report_file, result.overwrite, title, printed, context, intervals)


def _models(sources: Sequence[str], sensors: str | None, trust: bool) -> dict[str, Model]:
    """Return the models by a title that distinguishes them; a spec gives one per sensor set.

    Where two files call theirs alike, as two versions of one do, the second is told by its file.
    """
    from modelgen.cli.arguments import load_chain_or_arm, modules_of
    from modelgen.cli.candidates import spec_model
    from modelgen.render.writer import module_name
    from modelgen.runtime.model.model import load_model

    found: dict[str, Model] = {}
    for source in sources:
        if Path(source).suffix == ".py":
            found[_title(Path(source).stem, source, found)] = load_model(source, trust)
            continue
        spec = load_chain_or_arm(source)
        for name in modules_of(spec, sensors):
            found[_title(module_name(spec, name), source, found)] = spec_model(spec, name)
    return found


def _title(name: str, source: str, found: Mapping[str, Model]) -> str:
    return f"{name} ({source})" if name in found else name


def _known(models: Mapping[str, Model], values: Mapping[str, float]) -> dict[str, Model]:
    """Return the models with these values known, each with those of its parameters.

    Raises
    ------
    DataError
        Also for a name that no model has.
    """
    from modelgen.runtime.model.known_parameters import with_known
    from modelgen.runtime.records.record import missing_name

    names = list(dict.fromkeys(n for model in models.values() for n in model.every_parameter))
    problems = [missing_name("--set", "parameter", name, names) for name in values if name not in names]
    DataError.raise_any(problems)
    return {
        title: with_known(
            model,
            {n: v for n, v in values.items() if n in model.parameters or n in model.known},
            f"--set: {title}",
        )
        for title, model in models.items()
    }


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
    if model.is_arm:
        described["why"] = "of an arm they come from its records: --data"
        return described
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


def _describe_estimates(found: Mapping[str, Estimate]) -> dict[str, Any]:
    from modelgen.runtime.comparison.sensor_set_comparison import consistency

    return {
        "parameters": {
            title: {
                one.name: {"value": one.value, "std": one.std, "interval_95": one.interval()}
                for one in estimate.parameters.told
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
