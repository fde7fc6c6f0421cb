"""Candidate instruments in TOML, or as options -> sensor sets made of them, and what cures one.

[sensors.q_m]
body = "m"                   # or deflection = ["m", "c"]
measures = "position"
noise = 2e-5                 # standard deviation, SI
resolution = 1.5e-3          # optional: step it is rounded to, SI
price = 180.0                # optional

[actuators.Gamma_m]          # how well the force is known
noise = 1e-4
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from math import comb
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.documents import toml_document
from modelgen.errors import DataError, ModelgenError, Problem, listed
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.read_file import INSTRUMENTS, read_text

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.planning.sensor_set_ranking import Prediction
    from modelgen.runtime.simulation.instrument import Instrument
    from modelgen.spec.arms.arm import ArmSpec
    from modelgen.spec.chain import ChainSpec, Sensor
    from modelgen.spec.units import Measures

# title, model, values, instruments -> what they promise
Judge = Callable[[str, "Model", Mapping[str, float], Mapping[str, "Instrument"]], "Prediction"]
SET = "set"
#: Each takes a tenth of a second to some seconds.
MOST_SETS = 1000
LEVELS = ("noise", "resolution", "price")
MEASURES: tuple[Measures, ...] = ("position", "velocity", "acceleration")


@dataclass(frozen=True)
class Candidates:
    """Sensors to choose from, and the instrument of every channel."""

    sensors: tuple[Sensor, ...]
    instruments: Mapping[str, Instrument]


def load_candidates(path: Path, chain: ChainSpec) -> Candidates:
    """Read a file of candidate instruments.

    Raises
    ------
    DataError
        With one problem per mistake of the file.
    """
    from modelgen.runtime.simulation.instrument import Instrument
    from modelgen.spec.chain import Sensor

    given = toml_document(read_text(path, INSTRUMENTS), str(path), ("sensors", "actuators"))
    problems = list(_problems(str(path), given, chain))
    DataError.raise_any(problems)
    instruments = {
        key: Instrument(**{level: float(table[level]) for level in LEVELS if level in table})
        for kind in ("sensors", "actuators")
        for key, table in given.get(kind, {}).items()
    }
    sensors = tuple(
        Sensor(key, table.get("body"), _pair(table), table["measures"])
        for key, table in given["sensors"].items()
    )
    return Candidates(sensors, instruments)


def candidate_models(
    chain: ChainSpec, candidates: Candidates, most_sensors: int
) -> tuple[dict[str, Model], dict[str, str]]:
    """Return a model per combination of at most so many sensors, and why others have none.

    Raises
    ------
    DataError
        When the combinations are too many, or none of them has a model.
    """
    count = sum(comb(len(candidates.sensors), size) for size in range(1, most_sensors + 1))
    if count > MOST_SETS:
        what = f"{len(candidates.sensors)} sensors make {count} sets of at most {most_sensors}"
        remedy = f"give fewer, or a smaller --most-sensors: at most {MOST_SETS} sets are compared"
        raise DataError.at("--candidates", what, remedy)
    sets = {
        "+".join(sensor.key for sensor in chosen): chosen
        for count in range(1, most_sensors + 1)
        for chosen in combinations(candidates.sensors, count)
    }
    named = {f"set_{i}": chosen for i, chosen in enumerate(sets.values())}
    spec = replace(chain, sensor_sets=named)
    models, refused = {}, {}
    for title, name in zip(sets, named, strict=True):
        try:
            models[title] = spec_model(spec, name)
        except ModelgenError as error:
            refused[title] = "; ".join(str(problem) for problem in error.problems)
    if not models:
        remedy = "add candidates, or allow more --most-sensors"
        raise DataError(*(Problem(f"--candidates: {title}", why, remedy) for title, why in refused.items()))
    return models, refused


def spec_model(chain: ChainSpec | ArmSpec, sensors: str) -> Model:
    """Return the model of a sensor set, "" that of an arm which has none, without writing a file."""
    from modelgen.render.target_writer import numpy_files
    from modelgen.runtime.model.model import model_from_text

    ((name, text),) = numpy_files(chain, sensors).items()
    return model_from_text(text, name.removesuffix(".py"))


def _pair(table: Mapping[str, Any]) -> tuple[str, str] | None:
    pair = table.get("deflection")
    return None if pair is None else (str(pair[0]), str(pair[1]))


def _problems(where: str, given: Mapping[str, Any], chain: ChainSpec) -> Iterator[Problem]:
    actuators = [body.actuator for body in chain.bodies if body.actuator]
    for key in given:
        if key not in ("sensors", "actuators"):
            yield Problem(f"{where}: {key}", "is unknown", "write tables [sensors.KEY] and [actuators.KEY]")
    if not isinstance(given.get("sensors"), dict) or not given["sensors"]:
        yield Problem(f"{where}: sensors", "is missing", "write one table [sensors.KEY] a candidate")
        return
    if not isinstance(given.get("actuators", {}), dict):
        yield Problem(f"{where}: actuators", "is no table", "write one table [actuators.KEY] a force")
        return
    for kind in ("sensors", "actuators"):
        for key, table in given.get(kind, {}).items():
            place = f"{where}: {kind}.{key}"
            if not isinstance(table, dict):
                yield Problem(place, "is no table", f"write [{kind}.{key}] and its keys below it")
                continue
            if kind == "actuators" and key not in actuators:
                yield Problem(place, "is no actuator of the chain", f"its actuators: {listed(actuators)}")
            if kind == "sensors":
                yield from _sensor_problems(place, key, table, chain)
            known = (*LEVELS, "body", "deflection", "measures") if kind == "sensors" else LEVELS
            for name, value in table.items():
                if name not in known:
                    yield Problem(f"{place}.{name}", "is unknown", f"use {', '.join(known)}")
                elif name in LEVELS and (isinstance(value, bool) or not isinstance(value, (int, float))):
                    yield Problem(f"{place}.{name}", f"is {value!r}", "give zero or a positive number")
                elif name in LEVELS and not (is_usable(value) and value >= 0.0):
                    yield Problem(f"{place}.{name}", f"is {value!r}", REMEDY)


def _sensor_problems(place: str, key: str, table: Mapping[str, Any], chain: ChainSpec) -> Iterator[Problem]:
    from modelgen.spec.chain import Sensor
    from modelgen.spec.references import check_one_sensor

    measures: Any = table.get("measures")
    pair, body = table.get("deflection"), table.get("body")
    if measures not in MEASURES:
        yield Problem(f"{place}.measures", f"is {measures!r}", f"choose from {', '.join(MEASURES)}")
    named = [body] if pair is None else pair
    fits = isinstance(named, list) and len(named) == (1 if pair is None else 2)
    bodies = [other.name for other in chain.bodies]
    if not fits or any(name not in bodies for name in named):
        remedy = f"give body = or deflection = [.., ..] out of {listed(bodies)}"
        yield Problem(place, "does not say what it is on", remedy)
        return
    sensor = Sensor(key, body, _pair(table), measures)
    yield from check_one_sensor(place, sensor, {name: None for name in table if name not in LEVELS}, chain)


def cures(
    chain: ChainSpec,
    model: Model,
    values: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    prediction: Prediction,
    judge: Judge,
) -> list[str]:
    """Return a sentence for what leaves fewer parameters open, as computed; one where nothing tried does.

    Tried are a position sensor on every body that has no sensor, and every link rigid that holds a body
    without one or a stiffness that is left open. What still needs an elimination is no cure for noise.
    """
    from modelgen.spec.chain import Sensor
    from modelgen.spec.lumped_chain import lumped

    sensors = tuple(Sensor(s.key, s.body, s.deflection, MEASURES[s.order]) for s in model.sensors)
    chain = replace(chain, sensor_sets={SET: sensors})
    seen = {sensor.body for sensor in sensors}
    unseen = [body for body in chain.bodies if body.name not in seen]
    tried, found, count = [], [], len(prediction.missing)
    reference = next((s for s in sensors if s.measures == "position" and s.key in instruments), None)
    if unseen and reference is not None:
        names = " and ".join(body.name for body in unseen)
        tried.append(f"a position sensor on {names}")
        keys = {f"position_{body.name}": body.name for body in unseen}
        more = tuple(Sensor(key, body, None, "position") for key, body in keys.items())
        every = {**instruments, **dict.fromkeys(keys, instruments[reference.key])}
        said = f"{tried[-1]} as precise as {reference.key}"
        found.append(
            _said(said, replace(chain, sensor_sets={SET: sensors + more}), values, every, judge, count)
        )
    for index, link in enumerate(chain.links):
        if link.stiffness not in prediction.missing and not {body.name for body in unseen} & {*link.bodies}:
            continue
        one = lumped(chain, index, values)
        if one is not None:
            tried.append(f"{' and '.join(link.bodies)} as one body")
            found.append(
                _said(f"{tried[-1]} (link {link.stiffness} rigid)", one[0], one[1], instruments, judge, count)
            )
    sentences = [sentence for sentence in found if sentence]
    if tried and not sentences:
        return [f"none of what was tried cures it ({', '.join(tried)})"]
    return sentences


def _said(
    what: str,
    chain: ChainSpec,
    values: Mapping[str, float],
    instruments: Mapping[str, Instrument],
    judge: Judge,
    still_open: int,
) -> str | None:
    try:
        model = spec_model(chain, SET)
        prediction = None if model.composites else judge(what, model, values, instruments)
    except ModelgenError:
        return None
    if prediction is None or not prediction.precisions or len(prediction.missing) >= still_open:
        return None
    if prediction.missing:
        return f"{what} would leave only {', '.join(prediction.missing)} open (computed from that chain)"
    return (
        f"{what} would cure it: {', '.join(model.parameters)} within {prediction.worst:.2g} % "
        "(computed from that chain)"
    )
