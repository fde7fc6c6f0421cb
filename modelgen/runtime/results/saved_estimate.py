"""The document of an estimate -> the parts of one: what follows from other numbers must still follow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from modelgen.errors import DataError, Problem
from modelgen.read_file import ESTIMATE
from modelgen.runtime.modes.modes import Modes
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.results.estimate_file import MATRICES, SavedEstimate, saved_estimate
from modelgen.runtime.results.estimate_parts import EstimatedFit, EstimatedModel, EstimatedParameters
from modelgen.runtime.results.thresholds import AGREEMENT

# keys that documents of version 1 did not always have
LATER = (
    "contents",
    "method_title",
    "physical_noise_std",
    "physical_drift_std",
    "physical_printed_std",
    "noise_covariance",
    "drift_covariance",
    "modes",
    "roles",
    "unseen",
    "known",
    "joined",
    "verdict",
)
NO_MODES = Modes(notes=("No modes: the estimate was saved without them.",))
CHANGED = "was changed by hand: identify again, or undo the change"


def estimate_parts(document: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the attributes of the estimate in a document, `Estimate.to_dict`.

    Parts that documents once did not have are unknown: NaN, and the method's name for its title.

    Raises
    ------
    DataError
        With one problem per mistake.
    """
    saved = saved_estimate(document, where)
    absent = [one.name for one in fields(saved) if one.name not in document and one.name not in LATER]
    if absent:
        remedy = f"{ESTIMATE.remedy}, the whole of it"
        raise DataError(*(Problem(f"{where}: {key}", "is missing", remedy) for key in absent))
    identified = _parameters(saved, "params", "bse", "")
    problems = _contradictions(saved, identified, where)
    DataError.raise_any(problems)
    return {
        "model": EstimatedModel(**_same_fields(EstimatedModel, saved)),
        "records": saved.records,
        "fit": EstimatedFit(
            **_same_fields(EstimatedFit, saved) | {"method_title": saved.method_title or saved.method},
            residuals=None,
        ),
        "covariances": _covariances(saved),
        "parameters": EstimatedParameters(
            identified,
            _parameters(saved, "physical", "physical_bse", "physical_"),
            np.array(saved.base, dtype=float),
            saved.nuisance,
            saved.not_identifiable,
            saved.other_solutions,
        ),
        "checks": saved.checks,
        "modal": NO_MODES if saved.modes is None else saved.modes,
        "contents": saved.contents,
    }


def _same_fields(kind: type, saved: SavedEstimate) -> dict[str, Any]:
    """Return the values of a part's fields that a document has under the same names."""
    return {one.name: getattr(saved, one.name) for one in fields(kind) if hasattr(saved, one.name)}


def _parameters(saved: SavedEstimate, values: str, std: str, prefix: str) -> tuple[Parameter, ...]:
    further = [getattr(saved, f"{prefix}{part}_std") for part in ("noise", "drift", "printed")]
    return tuple(
        Parameter(
            name,
            saved.units.get(name, ""),
            value,
            getattr(saved, std)[name],
            *(table.get(name, math.nan) for table in further),
        )
        for name, value in getattr(saved, values).items()
    )


def _covariances(saved: SavedEstimate) -> Covariances:
    unknown = np.full((len(saved.params), len(saved.params)), math.nan)
    found = [np.array(getattr(saved, key), dtype=float) for key in MATRICES]
    return Covariances(*(matrix if matrix.size else unknown for matrix in found))


def _contradictions(saved: SavedEstimate, identified: tuple[Parameter, ...], where: str) -> list[Problem]:
    """Return which numbers do not follow from those that they were calculated from."""
    found: list[str] = []
    for entry in identified:
        relative = saved.relative_std[entry.name]
        found += [f"relative_std.{entry.name}"] * (not _same(relative, entry.relative_std))
        pair = zip(saved.conf_int_95[entry.name], entry.interval(), strict=True)
        reach = max(abs(entry.value), abs(entry.std))  # bounds may be differences near zero
        if not all(_same(a, b, reach) for a, b in pair):
            found.append(f"conf_int_95.{entry.name}")
    for k, (row, entry) in enumerate(zip(saved.cov_params, identified, strict=True)):
        if not _same(math.sqrt(max(0.0, row[k])), entry.std):
            found.append(f"cov_params[{k}][{k}]")
    found += ["nobs"] * (saved.nobs != sum(row.used for row in saved.rows if row.weight > 0.0))
    names = (*saved.params, *saved.physical)
    found += [f"units.{name}" for name in dict.fromkeys(names) if name not in saved.units]
    what = "does not agree with the other numbers"
    return [Problem(f"{where}: {key}", what, CHANGED) for key in found]


def _same(a: float, b: float, size: float = 0.0) -> bool:
    known = math.isfinite(a), math.isfinite(b)
    return not any(known) or math.isclose(a, b, rel_tol=AGREEMENT, abs_tol=AGREEMENT * size)
