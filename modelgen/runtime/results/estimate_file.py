"""What `modelgen identify -o` saved -> the same values, every one of the type it was written with."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from modelgen.documents import json_document
from modelgen.errors import DataError, Problem, listed
from modelgen.magnitudes import is_usable
from modelgen.read_file import ESTIMATE, read_text
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.modes.modes import Modes
from modelgen.runtime.parameters.pruning import Pruning
from modelgen.runtime.results.checks import Checks
from modelgen.runtime.results.estimate_parts import FORMAT_VERSION, RowDiagnostics
from modelgen.runtime.results.verdict import Verdict
from modelgen.typed_values import typed

Numbers = Mapping[str, float]
Texts = Mapping[str, str]
Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class SavedEstimate:
    """The keys of a document, `Estimate.to_dict`, in their order, and their types.

    Null stands for a number that is not finite.

    Whoever wants parameters only does with those that have no default.
    """

    format: Literal["modelgen estimate"]
    version: int = FORMAT_VERSION
    chain: str
    sensor_set: str = ""
    title: str = ""
    method: str = ""
    method_title: str = ""
    records: tuple[str, ...]
    contents: tuple[str, ...] = ()
    params: Numbers = field(default_factory=dict)
    bse: Numbers = field(default_factory=dict)
    relative_std: Numbers = field(default_factory=dict)
    conf_int_95: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    units: Texts = field(default_factory=dict)
    physical: Numbers
    physical_bse: Numbers = field(default_factory=dict)
    physical_noise_std: Numbers = field(default_factory=dict)
    physical_drift_std: Numbers = field(default_factory=dict)
    physical_printed_std: Numbers = field(default_factory=dict)
    not_identifiable: Texts = field(default_factory=dict)
    other_solutions: tuple[Numbers, ...] = ()
    nuisance: Numbers = field(default_factory=dict)
    composites: Texts = field(default_factory=dict)
    roles: Texts = field(default_factory=dict)
    unseen: tuple[str, ...] = ()
    known: Numbers = field(default_factory=dict)
    joined: tuple[str, ...] = ()
    groupings: Texts = field(default_factory=dict)
    base: tuple[float, ...] = ()
    noise_std: Numbers = field(default_factory=dict)
    drift_std: Numbers = field(default_factory=dict)
    printed_std: Numbers = field(default_factory=dict)
    cov_params: Matrix = ()
    noise_covariance: Matrix = ()
    drift_covariance: Matrix = ()
    printed_covariance: Matrix = ()
    covariance_kind: Literal["hac", "printed"] = "hac"
    nobs: int = 0
    condition_number: float = math.nan
    condition_number_raw: float = math.nan
    relative_error: float = math.nan
    error_norm: float = math.nan
    sigma: float = math.nan
    residual_dof: Literal["r-c", "r-1"] = "r-c"
    delays: Numbers = field(default_factory=dict)
    delay_std: Numbers = field(default_factory=dict)
    rows: tuple[RowDiagnostics, ...] = ()
    pruning: Pruning | None = None
    filtering: FilterChoice | None = None
    notes: tuple[str, ...] = ()
    checks: Checks | None = None
    modes: Modes | None = None
    verdict: Verdict | None = None


DEVIATIONS = ("bse", "relative_std", "noise_std", "drift_std", "printed_std")
OF_PHYSICAL = ("physical_bse", "physical_noise_std", "physical_drift_std", "physical_printed_std")
MATRICES = ("cov_params", "noise_covariance", "drift_covariance", "printed_covariance")
# numbers that are null where they are infinite or unknown
NOT_FINITE = ("condition_number", "relative_error", "error_norm", "sigma")
# tables of numbers that are calculated with
VALUES = ("params", "physical", "nuisance", "delays", "known")
# keys whose tables have an entry for each name of another one
TABLES_OF: Mapping[str, tuple[str, ...]] = {
    "params": (*DEVIATIONS, "conf_int_95"),
    "physical": OF_PHYSICAL,
    "delays": ("delay_std",),
}


def load_estimate(path: Path) -> Mapping[str, Any]:
    """Read a saved estimate, `Estimate.to_dict` in JSON.

    Raises
    ------
    DataError
        With one problem per mistake: a key that is missing, unknown, of another type or length.
    """
    return checked_estimate(json_document(read_text(path, ESTIMATE), str(path), ESTIMATE.remedy), str(path))


def checked_estimate(document: Any, where: str) -> Mapping[str, Any]:
    """Return a document as it is if it is that of an estimate; raises as `load_estimate` does."""
    saved_estimate(document, where)
    return dict(document)


def saved_estimate(document: Any, where: str) -> SavedEstimate:
    """Return the typed values of a document; raises as `load_estimate` does."""
    if not isinstance(document, dict) or not all(isinstance(key, str) for key in document):
        raise DataError.at(where, "is no saved estimate", ESTIMATE.remedy)
    problems = [
        Problem(f"{where}: {key}", "is null", ESTIMATE.remedy)
        for key, value in document.items()
        if value is None and not key.startswith(NOT_FINITE)
    ]
    saved: SavedEstimate = typed(SavedEstimate, document, f"{where}: ", ESTIMATE.remedy, problems)
    problems = problems or [*_size_problems(where, saved), *_entry_problems(where, document)]
    DataError.raise_any(problems)
    return saved


def _size_problems(where: str, saved: SavedEstimate) -> Iterator[Problem]:
    """Yield which numbers cannot be calculated with, and which matrices are not square."""
    if saved.version != FORMAT_VERSION:
        yield Problem(f"{where}: version", f"is not {FORMAT_VERSION}", ESTIMATE.remedy)
    if saved.nobs < 0:
        yield Problem(f"{where}: nobs", "is not a number of rows", ESTIMATE.remedy)
    for key in VALUES:
        for name, value in getattr(saved, key).items():
            if not (math.isnan(value) or is_usable(value)):
                what = f"is {value:g}, not zero or between 1e-30 and 1e30"
                yield Problem(f"{where}: {key}.{name}", what, ESTIMATE.remedy)
    sizes = {key: getattr(saved, key) for key in NOT_FINITE}
    for key in (*DEVIATIONS, *OF_PHYSICAL, "delay_std"):
        sizes |= {f"{key}.{name}": value for name, value in getattr(saved, key).items()}
    for key, value in sizes.items():
        if value < 0.0:
            yield Problem(f"{where}: {key}", f"is {value:g}, and cannot be negative", ESTIMATE.remedy)
    for key in MATRICES:
        rows = getattr(saved, key)
        if any(len(row) != len(rows) for row in rows):
            yield Problem(f"{where}: {key}", "is not a square matrix, a list a row", ESTIMATE.remedy)


def _entry_problems(where: str, saved: Mapping[str, Any]) -> list[Problem]:
    """Return which tables have not the names, and which matrices not the size, of what they belong to."""
    problems = []
    for table, keys in TABLES_OF.items():
        for key in keys:
            if table not in saved or key not in saved:
                continue
            apart = saved[key].keys() ^ saved[table].keys()
            if apart - saved[table].keys() or (apart and key != "delay_std"):  # not every delay has one
                what = f"and {table} have not the same names ({listed(sorted(apart))})"
                problems.append(Problem(f"{where}: {key}", what, ESTIMATE.remedy))
    for key in MATRICES:
        if "params" in saved and key in saved and len(saved[key]) != len(saved["params"]):
            what = f"has {len(saved[key])} rows, params has {len(saved['params'])} entries"
            problems.append(Problem(f"{where}: {key}", what, ESTIMATE.remedy))
    return problems
