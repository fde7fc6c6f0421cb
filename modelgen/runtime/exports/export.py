"""export(): a model with identified numbers -> the files of another tool."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import MappingProxyType

from modelgen.atomic_write import check_place, write_whole
from modelgen.errors import DataError, Problem, nearest
from modelgen.runtime.exports.case import Case, Written
from modelgen.runtime.exports.mechanics import mechanics
from modelgen.runtime.exports.samples import with_samples
from modelgen.runtime.exports.values import Values, export_values
from modelgen.runtime.model.known_parameters import as_identified
from modelgen.runtime.model.model import Model
from modelgen.runtime.results.estimate import Estimate

# what a spec's names are; a module may come from a stranger, and names become parts of programs here
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}\Z")


@dataclass(frozen=True)
class Target:
    """A format: the suffix of its files, its module, roles of parameters that it can do without."""

    suffix: str
    module: str
    optional: tuple[str, ...] = ()


TARGETS: Mapping[str, Target] = MappingProxyType(
    {
        "state-space": Target(".json", "state_space_json", ("coulomb", "offset")),
        "matlab": Target(".m", "matlab", ("coulomb", "offset")),
        "fmu": Target(".fmu", "fmu"),
        "modelica": Target(".mo", "modelica"),
        "mjcf": Target(".xml", "mjcf"),
        "urdf": Target(".urdf", "urdf"),
    }
)


@dataclass(frozen=True)
class Export:
    """The files of an export, in memory.

    Attributes
    ----------
    target : str
    suffix : str
        Of its files, such as ".json".
    files : mapping of str to bytes
        By what is added to the name before the suffix: "" for the nominal values, "_sample_001" and so on.
    values : Values
        The parameters, with the origin of each.
    notes : tuple of str
        What the format cannot say, and how many samples were drawn again.
    """

    target: str
    suffix: str
    files: Mapping[str, bytes]
    values: Values
    notes: tuple[str, ...]

    def paths(self, path: str | Path) -> dict[Path, bytes]:
        """Return the files that `save` writes, by their path."""
        path = Path(path)
        return {path.with_name(f"{path.stem}{more}{path.suffix}"): text for more, text in self.files.items()}

    def save(self, path: str | Path, *, overwrite: bool = False) -> list[Path]:
        """Write the files, each whole or not at all; existing ones are replaced only if asked to.

        Raises
        ------
        DataError
            For another suffix, or a file that exists.
        """
        given = Path(path)
        if given.suffix != self.suffix:
            remedy = f"call it {given.with_suffix(self.suffix).name}"
            raise DataError.at(str(path), f"has the suffix {given.suffix!r}", remedy)
        files = self.paths(given)
        for place in files:
            check_place(place)
        if not overwrite:
            there = [Problem(str(p), "exists already", "choose another name, or overwrite") for p in files if
                     p.exists()]  # fmt: skip
            DataError.raise_any(there)
        for place, content in files.items():
            write_whole(place, content, overwrite=overwrite)
        return list(files)


def export(
    model: Model,
    source: Estimate | Mapping[str, float] | str,
    to: str,
    *,
    values: Mapping[str, float] | None = None,
    samples: int = 0,
    seed: int = 0,
) -> Export:
    """Return a model with numbers in the format of another tool.

    Parameters
    ----------
    model : Model
        The generated module, see `modelgen.load_model`.
    source : Estimate, mapping of str to float, or str
        Where the numbers are from: an estimate, values of parameters (SI), or the name of a parameter set.
    to : str
        "state-space" (JSON), "matlab" (a script that makes an ss object, for Simulink), "fmu" (FMI 2.0 for
        co-simulation), "modelica", "mjcf" (MuJoCo) or "urdf".
    values : mapping of str to float, optional
        Parameters that the source lacks, or in place of its own. Where an estimate has only a sum of two, the
        other one follows.
    samples : int
        Further sets of parameters, drawn from the estimate's covariance; impossible ones are drawn again.
    seed : int
        Of the samples.

    Returns
    -------
    Export
        Files in memory; `save` writes them. The same input gives the same bytes.

    Raises
    ------
    DataError
        With one problem for every parameter that has no value; for what the format cannot hold.
    """
    if to not in TARGETS:
        close = nearest(to, TARGETS)
        remedy = f"did you mean {close}?" if close else f"choose one of {', '.join(TARGETS)}"
        raise DataError.at(f"to {to!r}", "is no format", remedy)
    target = TARGETS[to]
    model.refuse_arm("export")
    _refuse_names(model)
    if isinstance(source, str):
        if source not in model.parameter_sets:
            remedy = f"choose one of {', '.join(model.parameter_sets) or 'none'}, or give an estimate"
            raise DataError.at(f"parameters {source}", "is no parameter set of the model", remedy)
        source = model.parameter_sets[source]
    if isinstance(source, Estimate):
        model = as_identified(model, source.model.known)
    found = export_values(model, source, values, target.optional)
    notes: tuple[str, ...] = ()
    if samples:
        if not isinstance(source, Estimate):
            raise DataError.at(
                "samples", "need the covariance of an estimate", "give an estimate, or no samples"
            )
        found = with_samples(model, found, source, samples, seed)
        if found.drawn_again:
            notes = (f"{found.drawn_again} samples with impossible values (below zero) were drawn again",)
    write: Callable[[Case], Written] = import_module(f"modelgen.runtime.exports.{target.module}").write
    written = write(Case(model, mechanics(model), found))
    return Export(to, target.suffix, written.files, found, notes + written.notes)


def _refuse_names(model: Model) -> None:
    bodies = [body for role in model.roles.values() for body in role.bodies]
    keys = [*(sensor.key for sensor in model.sensors), *(actuator.key for actuator in model.actuators)]
    names = [model.chain, model.sensor_set, *model.parameters, *model.known, *model.roles, *bodies, *keys]
    wrong = [name for name in dict.fromkeys(names) if not NAME.match(name)]
    if wrong:
        remedy = "generate the module from a spec (modelgen generate)"
        raise DataError.at(f"model {wrong[0]!a}", "is no name that a spec can have", remedy)
