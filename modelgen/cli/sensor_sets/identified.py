"""Data files and modules, or a spec -> an estimate: of one sensor set, or joined from records of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.cli.data_arguments import DataOptions, carrying, read_files, tagged
from modelgen.errors import DataError, Problem, listed

if TYPE_CHECKING:
    from modelgen.runtime.joining.joint_estimate import JointEstimate
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.records.read_record import Reading
    from modelgen.runtime.records.record import Record
    from modelgen.runtime.results.estimate import Estimate


@dataclass(frozen=True, eq=False)
class Identified:
    """An estimate and what it was made from; `joint` where records of several sensor sets were joined.

    `models` are those that have records, by their sensor sets; `titles` names the set of each reading where
    there are several.
    """

    models: Mapping[str, Model]
    readings: Sequence[Reading]
    estimate: Estimate
    joint: JointEstimate | None = None
    titles: tuple[str, ...] = ()

    def alone(self) -> list[tuple[str, Model, list[Record], Estimate]]:
        """Return each sensor set's title, model, records and own estimate; one set has no title."""
        if self.joint is None:
            (model,) = self.models.values()
            return [("", model, [one.record for one in self.readings], self.estimate)]
        of = list(zip(self.titles, self.readings, strict=True))
        return [
            (title, self.models[title], [one.record for name, one in of if name == title], estimate)
            for title, estimate in self.joint.parts.items()
        ]

    def text(self, details: bool) -> str:
        """Return what is printed."""
        if not details:
            return self.estimate.answer()
        return self.estimate.summary() if self.joint is None else self.joint.summary()


def models_of(
    modules: Sequence[Path],
    spec: str | None,
    sensors: Sequence[str],
    known: Mapping[str, float],
    trust: bool,
    data: Sequence[Path] = (),
) -> dict[str, Model]:
    """Return the models by their sensor sets: of modules, or of a spec's sets (`sensors`; else all of them).

    `data` are the files given as records: a spec may be among them where no option names one.

    Raises
    ------
    ModelgenError
    """
    from modelgen.cli.arguments import load_chain_or_arm, modules_of
    from modelgen.cli.candidates import spec_model
    from modelgen.runtime.model.known_parameters import with_known
    from modelgen.runtime.model.model import load_model

    if modules:
        models = _chosen([load_model(module, trust) for module in modules], sensors)
    elif spec is not None:
        described = load_chain_or_arm(spec)
        names = [name for one in sensors or (None,) for name in modules_of(described, one)]
        models = [spec_model(described, name) for name in names]
    else:
        specs = [path for path in data if path.suffix == ".toml"]
        remedy = f"write --spec {specs[0]}" if specs else "give a generated module, or the chain with --spec"
        raise DataError.at("--model", "is missing", remedy)
    titles = [model.sensor_set for model in models]
    twice = next((title for title in titles if titles.count(title) > 1), None)
    if twice is not None:
        raise DataError.at("--model", f"names the sensors {twice} twice", "give one module a sensor set")
    return {model.sensor_set: with_known(model, known, "--set") for model in models}


def _chosen(models: Sequence[Model], sensors: Sequence[str]) -> list[Model]:
    """Return the modules' models of the sensor sets that are asked for; all if none is."""
    titles = [model.sensor_set for model in models]
    remedy = f"choose from the sensor sets of --model: {listed(titles)}"
    DataError.raise_any(
        [Problem(f"--sensors {one}", "is of no module", remedy) for one in sensors if one not in titles]
    )
    return [model for model in models if not sensors or model.sensor_set in sensors]


def read_for(
    data: Sequence[Path],
    models: Mapping[str, Model],
    given: DataOptions,
    tags: Sequence[str] = (),
    of_records: Mapping[str, str] | None = None,
    inputs: Sequence[Sequence[str]] = (),
    payloads: Sequence[str] = (),
) -> list[tuple[str, Reading]]:
    """Return the readings, each with its sensor set; `inputs` are further channels, see `read_files`.

    `tags` and `payloads` are what --tag and --payload say of records.
    """
    from modelgen.cli.sensor_sets.read_by_sensors import read_by_sensors

    if len(models) == 1 and not of_records:
        (title,) = models
        used = list(models.values())
        readings = carrying(tagged(read_files(data, used, given, *inputs), tags), payloads, used)
        return [(title, one) for one in readings]
    found = read_by_sensors(data, models, given, of_records, inputs)
    readings = carrying(tagged([one for _, one in found], tags), payloads, list(models.values()))
    return [(title, one) for (title, _), one in zip(found, readings, strict=True)]


def identified(
    models: Mapping[str, Model], read: Sequence[tuple[str, Reading]], settings: Mapping[str, Any]
) -> Identified:
    """Return the estimate of readings, each with its sensor set; raises as `identify`."""
    from modelgen.cli.sensor_sets.read_by_sensors import by_set
    from modelgen.runtime.identification.identify import identify
    from modelgen.runtime.joining.identify_jointly import identify_jointly

    readings = [one for _, one in read]
    used = {title: model for title, model in models.items() if title in {title for title, _ in read}}
    if len(used) == 1:
        (model,) = used.values()
        return Identified(used, readings, identify(model, [one.record for one in readings], **settings))
    joint = identify_jointly(by_set(models, [(title, one.record) for title, one in read]), **settings)
    return Identified(used, readings, joint.estimate, joint, tuple(title for title, _ in read))


def sensors_from(given: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return what --sensors says: names of sensor sets, and sets by record."""
    pairs = dict(item.split("=", 1) for item in given if "=" in item)
    return [item for item in given if "=" not in item], pairs
