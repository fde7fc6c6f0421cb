"""What `modelgen identify -o` saved -> the same values, every one of the type it was written with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

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

Holds = Callable[[Any], bool]


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_real(value: Any) -> bool:
    """Tell whether a value is a finite number, or null, which stands for one that was not."""
    return value is None or (isinstance(value, (int, float)) and not isinstance(value, bool))


def _is_value(value: Any) -> bool:
    return _is_real(value) and (value is None or is_usable(value))


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _list_of(holds: Holds) -> Holds:
    return lambda value: isinstance(value, list) and all(map(holds, value))


def _table_of(holds: Holds) -> Holds:
    return lambda value: isinstance(value, dict) and all(map(holds, value.values()))


def _is_interval(value: Any) -> bool:
    return _list_of(_is_real)(value) and len(value) == 2


def _is_square(value: Any) -> bool:
    return _list_of(_list_of(_is_real))(value) and all(len(row) == len(value) for row in value)


TEXT, TEXTS = (_is_text, "a text"), (_list_of(_is_text), "a list of texts")
NUMBER, NUMBERS = (_is_real, "a finite number or null"), (_table_of(_is_real), "a table of numbers")
VALUES = (_table_of(_is_value), "a table of numbers between 1e-30 and 1e30, zeros or nulls")
MATRIX = (_is_square, "a square matrix of finite numbers, a list a row")
# what is a dataclass in an estimate, checked field by field
PARTS: Mapping[str, Any] = {
    "rows": tuple[RowDiagnostics, ...],
    "pruning": Pruning,
    "filtering": FilterChoice,
    "checks": Checks,
    "modes": Modes,
    "verdict": Verdict,
}
DEVIATIONS = ("bse", "relative_std", "noise_std", "drift_std", "printed_std")
OF_PHYSICAL = ("physical_bse", "physical_noise_std", "physical_drift_std", "physical_printed_std")
MATRICES = ("cov_params", "noise_covariance", "drift_covariance", "printed_covariance")
KEYS: Mapping[str, tuple[Holds, str]] = {
    "format": (lambda value: value == "modelgen estimate", 'the text "modelgen estimate"'),
    "version": (lambda value: value == FORMAT_VERSION and _is_count(value), f"the number {FORMAT_VERSION}"),
    **dict.fromkeys(("chain", "sensor_set", "title", "method", "method_title"), TEXT),
    **dict.fromkeys(("covariance_kind", "residual_dof"), TEXT),
    **dict.fromkeys(("records", "contents", "notes", "unseen", "joined"), TEXTS),
    **dict.fromkeys(("params", "physical", "nuisance", "delays", "known"), VALUES),
    **dict.fromkeys((*DEVIATIONS, *OF_PHYSICAL, "delay_std"), NUMBERS),
    **dict.fromkeys(
        ("units", "not_identifiable", "composites", "roles", "groupings"),
        (_table_of(_is_text), "a table of texts"),
    ),
    "conf_int_95": (_table_of(_is_interval), "a table of pairs of numbers"),
    "other_solutions": (_list_of(_table_of(_is_real)), "a list of tables of numbers"),
    "base": (_list_of(_is_real), "a list of numbers"),
    **dict.fromkeys(MATRICES, MATRIX),
    "nobs": (_is_count, "a number of rows"),
    **dict.fromkeys(("condition_number", "condition_number_raw", "relative_error"), NUMBER),
    **dict.fromkeys(("error_norm", "sigma"), NUMBER),
}
NEEDED = ("format", "chain", "physical", "records")
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


def checked_estimate(saved: Any, where: str) -> Mapping[str, Any]:
    """Return a document as it is if it is that of an estimate; raises as `load_estimate` does."""
    if not isinstance(saved, dict) or not all(isinstance(key, str) for key in saved):
        raise DataError.at(where, "is no saved estimate", ESTIMATE.remedy)
    problems = [
        Problem(f"{where}: {key}", "is missing", ESTIMATE.remedy) for key in NEEDED if key not in saved
    ]
    for key, value in saved.items():
        if key in PARTS:
            typed(PARTS[key], value, f"{where}: {key}", ESTIMATE.remedy, problems)
        elif key not in KEYS:
            problems.append(Problem(f"{where}: {key}", "is no key of an estimate", ESTIMATE.remedy))
        elif not KEYS[key][0](value):
            problems.append(Problem(f"{where}: {key}", f"is not {KEYS[key][1]}", ESTIMATE.remedy))
    problems = problems or _entry_problems(where, saved)
    if problems:
        raise DataError(*problems)
    return saved


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
