"""Records of different sensors: which file is for which sensor set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.cli.data_arguments import DataOptions, reading_options
from modelgen.errors import DataError, Problem, listed
from modelgen.progress import counted

if TYPE_CHECKING:
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.records.read_record import Reading
    from modelgen.runtime.records.record import Record


def read_by_sensors(
    paths: Sequence[Path],
    models: Mapping[str, Model],
    options: DataOptions,
    chosen: Mapping[str, str] | None = None,
    inputs: Sequence[Sequence[str]] = (),
) -> list[tuple[str, Reading]]:
    """Read one record a file for the sensor set it has the channels of; pairs of its title and the reading.

    Of the sets that a file has all channels of it is the one with the most; `chosen` maps names of records
    (or files) to titles in place of that. `inputs` are further channels of every record, see `read_files`.

    Raises
    ------
    DataError
        With one problem per mistake: a file that has the channels of no set, or of two equally large ones.
    """
    how = {title: _options(model, models, options, inputs) for title, model in models.items()}
    given = dict(chosen or {})
    found: list[tuple[str, Reading]] = []
    problems: list[Problem] = []
    for path in counted(paths, "reading"):
        title = next((given.pop(name) for name in (path.name, path.stem, str(path)) if name in given), None)
        try:
            found.append(_read(path, how if title is None else {title: how[title]}))
        except DataError as error:
            problems += error.problems
        except KeyError:
            problems.append(
                Problem(f"{path}: sensors {title}", "are no set", f"choose from {listed(models)}")
            )
    remedy = f"name one of {listed([path.stem for path in paths])}"
    problems += [Problem(f"sensors of {name}", "are for no record", remedy) for name in given]
    DataError.raise_any(problems)
    return found


def by_set(
    models: Mapping[str, Model], read: Sequence[tuple[str, Record]]
) -> list[tuple[Model, list[Record]]]:
    """Return each model that has records with them, in the order of the models."""
    found = [(model, [record for of, record in read if of == title]) for title, model in models.items()]
    return [(model, records) for model, records in found if records]


def _options(
    model: Model, models: Mapping[str, Model], options: DataOptions, inputs: Sequence[Sequence[str]]
) -> dict[str, Any]:
    """Return the options of `read` for one set; what is mapped for the others does nothing here."""
    every = reading_options(list(models.values()), options, *inputs)
    others = {key for other in models.values() for key in (*other.channel_units, *other.channels)}
    others -= {*model.channels}
    # what is no channel of the chain is where a direction comes from
    wanted = tuple(key for key in every["needed"] if key not in others)
    scales = {key: one for key, one in every["scales"].items() if key not in others}
    return {**every, "needed": wanted, "scales": scales, "units": model.channel_units}


def _read(path: Path, how: Mapping[str, Mapping[str, Any]]) -> tuple[str, Reading]:
    from modelgen.runtime.records.read_record import read

    fitting: dict[str, Reading] = {}
    refused: dict[str, DataError] = {}
    for title, options in how.items():
        try:
            fitting[title] = read(path, **options)
        except DataError as error:
            refused[title] = error
    if not fitting:
        if len({str(error) for error in refused.values()}) == 1:  # a file that cannot be read at all
            raise next(iter(refused.values()))
        raise DataError(
            *(
                Problem(f"{one.where} (sensors {title})", one.what, one.remedy)
                for title, error in refused.items()
                for one in error.problems
            )
        )
    most = max(len(how[title]["needed"]) for title in fitting)
    largest = [title for title in fitting if len(how[title]["needed"]) == most]
    if len(largest) > 1:
        remedy = f"say which: --sensors {path.stem}={largest[0]}"
        raise DataError.at(str(path), f"has the channels of {listed(largest)}", remedy)
    return largest[0], fitting[largest[0]]
