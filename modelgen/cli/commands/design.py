"""`modelgen design`: which sensors, and which excitation, before buying them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from modelgen.cli.arms.trajectory_options import TrajectoryFlags
from modelgen.cli.options import (
    Noise,
    ParameterSet,
    Resolution,
    ResultOptions,
    SensorSet,
    SpecOfAny,
)
from modelgen.cli.output import deliver
from modelgen.cli.output_files import check_result
from modelgen.errors import DataError, IdentifiabilityError
from modelgen.progress import counted

if TYPE_CHECKING:
    from modelgen.cli.candidates import Judge
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.planning.sensor_set_ranking import Prediction
    from modelgen.runtime.simulation.instrument import Instrument
    from modelgen.spec.chain import ChainSpec


Candidates = Annotated[
    Path | None, typer.Option(metavar="FILE.toml", help="Instruments to choose from, with noise and price.")
]
Price = Annotated[
    list[str] | None, typer.Option(metavar="KEY=AMOUNT", help="Price of an instrument; repeatable.")
]
WantedPercent = Annotated[
    float, typer.Option(help="Wanted error of every parameter in %: the cheapest set is named.")
]
Excitations = Annotated[
    list[str] | None,
    typer.Option(metavar="KIND", help="chirp, trapezoid or a reference file; repeatable; both."),
]
OptimisedFile = Annotated[
    Path | None,
    typer.Option(metavar="FILE.csv", help="Optimise the excitation of the best set; write references."),
]
Criterion = Annotated[
    Literal["worst", "d-optimal", "condition"] | None,
    typer.Option(help="What --optimise looks at: worst; of an arm condition (or d-optimal)."),
]
Limits = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=PEAK",
        help="Largest position (travel), velocity, force or deflection, SI; by default the pair's.",
    ),
]
Rate = Annotated[
    float | None,
    typer.Option("--fs", "--fs-hz", metavar="HZ", help="Sampling frequency in Hz: 5000; of an arm 1000."),
]
Duration = Annotated[
    float | None, typer.Option(metavar="SECONDS", help="Duration in s of every record: 2; of an arm 10.")
]
Method = Annotated[
    str | None,
    typer.Option(help="The estimator: auto, what identify does by default; wls or iv, in closed form; auto."),
]
Draws = Annotated[int | None, typer.Option(metavar="N", help="Confirm every set by N simulated experiments.")]


def design(
    context: typer.Context,
    spec: SpecOfAny,
    candidates: Candidates = None,
    most_sensors: Annotated[int, typer.Option(min=1, max=4, help="Largest set made of candidates.")] = 2,
    sensors: SensorSet = None,
    noise: Noise = None,
    resolution: Resolution = None,
    price: Price = None,
    parameters: ParameterSet = None,
    wanted_percent: WantedPercent = 1.0,
    excitation: Excitations = None,
    optimise: OptimisedFile = None,
    criterion: Criterion = None,
    limit: Limits = None,
    rounds: Annotated[int, typer.Option(min=1, help="Trials of --optimise.")] = 200,
    fs: Rate = None,
    duration_s: Duration = None,
    method: Method = None,
    monte_carlo: Draws = None,
    *,
    trajectory: TrajectoryFlags,
    result: ResultOptions,
) -> None:
    """Predict the precision of every parameter for each sensor set, and rank the sets.

    Prices, noise and resolution come from a file of candidates, or from the options for the spec's own sets.
    Of an arm: search for a trajectory that distinguishes its base parameters, within the limits of the joints
    and boxes, and write it with --optimise. Of an elastic arm also a fast one about its modes, and what every
    sensor set would find in both, or in those of --excitation files.
    """
    from modelgen.cli.arguments import amounts, check_method, excitation_from, parameter_values
    from modelgen.cli.arms.design_arm import chain_unless_arm
    from modelgen.cli.design_tables import design_tables
    from modelgen.cli.tables import console
    from modelgen.runtime.planning.sensor_set_ranking import judge_set

    check_result(result)
    check_method(method)
    chain = chain_unless_arm(context, spec, trajectory, result)
    if chain is None:
        return
    values = parameter_values(chain, parameters)
    models, instruments, refused = _sets(
        chain, candidates, most_sensors, sensors, noise or (), resolution or (), price or ()
    )
    kinds = [excitation_from(text)[0] for text in excitation or ("chirp", "trapezoid")]
    lasting = 2.0 if duration_s is None else duration_s
    options: dict[str, Any] = {"fs": fs or 5000.0, "duration_s": lasting, "method": method}
    ranked, cured = _judged(
        chain, models, values, instruments, partial(judge_set, excitations=kinds, **options)
    )
    described = {**_predicted(ranked, options, refused, wanted_percent), "cures": cured}
    if monte_carlo:
        described["monte_carlo"] = _confirm(ranked, monte_carlo)
    if optimise is not None:
        best = _complete(ranked[0], models)
        limits = amounts("--limit", limit or ())
        search = {"criterion": criterion or "worst", "rounds": rounds, "limits": limits}
        described["excitation"] = _optimise(
            best, values, instruments, options, search, optimise, result.overwrite
        )
    deliver(described, lambda: console().print(design_tables(described)), result)


def _judged(
    chain: ChainSpec,
    models: Mapping[str, Model],
    values: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    judge: Judge,
) -> tuple[tuple[Prediction, ...], dict[str, list[str]]]:
    """Return what is predicted of the sets, most precise first, and what would cure those that lack some."""
    from modelgen.cli.candidates import cures
    from modelgen.runtime.planning.sensor_set_ranking import rank

    named = counted(list(models.items()), "predicting")
    ranked = rank([judge(title, model, values, instruments) for title, model in named])
    lacking = [one for one in ranked if one.missing]
    return ranked, {
        one.sensor_set: cures(chain, models[one.sensor_set], values, instruments, one, judge)
        for one in (counted(lacking, "looking for cures") if lacking else ())
    }


def _predicted(
    ranked: Sequence[Prediction], options: Mapping[str, Any], refused: Mapping[str, str], wanted: float
) -> dict[str, Any]:
    from modelgen.cli.design_tables import describe
    from modelgen.runtime.planning.sensor_set_ranking import DEFAULT_METHOD, cheapest

    return {
        "method": options["method"] or DEFAULT_METHOD,
        "fs_hz": options["fs"],
        "sets": [describe(prediction) for prediction in ranked],
        "refused": refused,
        "wanted_percent": wanted,
        "cheapest": getattr(cheapest(ranked, wanted), "sensor_set", None),
    }


def _sets(
    chain: ChainSpec,
    candidates: Path | None,
    most_sensors: int,
    sensors: str | None,
    noise: Sequence[str],
    resolution: Sequence[str],
    price: Sequence[str],
) -> tuple[dict[str, Model], dict[str, Instrument], dict[str, str]]:
    """Return the models to compare by title, the instruments by channel, and sets without a model."""
    from modelgen.cli.arguments import amounts, sensor_sets
    from modelgen.cli.candidates import candidate_models, load_candidates, spec_model
    from modelgen.runtime.records.record import missing_name
    from modelgen.runtime.simulation.instrument import Instrument
    from modelgen.runtime.simulation.sensor_readings import instrument_keys

    if candidates is not None:
        given = load_candidates(candidates, chain)
        models, refused = candidate_models(chain, given, most_sensors)
        return models, dict(given.instruments), refused
    models = {name: spec_model(chain, name) for name in sensor_sets(chain, sensors)}
    known = list(dict.fromkeys(key for model in models.values() for key in instrument_keys(model)))
    levels = {
        "noise": amounts("--noise", noise),
        "resolution": amounts("--resolution", resolution),
        "price": amounts("--price", price),
    }
    problems = [
        missing_name(f"--{level}", "channel", key, known)
        for level, table in levels.items()
        for key in table
        if key not in known
    ]
    if not any(levels["noise"].values()) and not any(levels["resolution"].values()):
        remedy = "give --candidates FILE.toml, or --noise KEY=STD for every channel"
        problems += DataError.at("instruments", "are all perfect", remedy).problems
    DataError.raise_any(problems)
    instruments = {
        key: Instrument(**{level: table.get(key, 0.0) for level, table in levels.items()}) for key in known
    }
    return models, instruments, {}


def _confirm(ranked: Sequence[Prediction], draws: int) -> dict[str, Any]:
    from modelgen.cli.design_tables import describe_monte_carlo
    from modelgen.runtime.planning.monte_carlo import monte_carlo

    found = {
        one.sensor_set: monte_carlo(one.planned, draws, one.promised)
        for one in ranked
        if one.precisions and one.planned is not None
    }
    return describe_monte_carlo(found, draws)


def _complete(best: Prediction, models: Mapping[str, Model]) -> Model:
    """Return the model of the best set, which must leave nothing open."""
    if best.missing:
        what = f"leaves {', '.join(best.missing)} open"
        raise IdentifiabilityError.at(f"--optimise: {best.sensor_set}", what, "add a sensor")
    return models[best.sensor_set]


def _optimise(
    model: Model,
    values: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    options: Mapping[str, Any],
    search: Mapping[str, Any],
    path: Path,
    overwrite: bool,
) -> dict[str, Any]:
    from modelgen.runtime.planning.optimal_excitation import optimise
    from modelgen.runtime.simulation.fourier_excitation import write_references

    found = optimise(model, values, instruments, **search, **options)
    written = write_references(path, found.excitations, options["fs"], overwrite=overwrite)
    return {
        "written": [str(p) for p in written],
        "criterion": search["criterion"],
        "method": found.method,
        "limits": {key: float(value) for key, value in found.limits.items()},
        "reached": {key: float(value) for key, value in found.reached.items()},
        "pair_worst_percent": found.pair_worst,
        "worst_percent": found.worst,
        "gain": found.pair_worst / found.worst,
        "parameters": {name: {"pair_percent": a, "optimised_percent": b} for name, a, b in found.parameters},
    }
