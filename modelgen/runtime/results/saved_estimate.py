"""The document of an estimate -> the parts of one: what follows from other numbers must still follow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError, Problem
from modelgen.read_file import ESTIMATE
from modelgen.runtime.modes.modes import Modes
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.results.estimate_file import KEYS, PARTS, checked_estimate
from modelgen.runtime.results.estimate_parts import EstimatedFit, EstimatedModel, EstimatedParameters
from modelgen.runtime.results.thresholds import AGREEMENT
from modelgen.typed_values import typed

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
CHANGED = "was changed by hand: identify again, or undo the change"


def estimate_parts(document: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the attributes of the estimate in a document, `Estimate.to_dict`.

    Parts that documents once did not have are unknown: NaN, and the method's name for its title.

    Raises
    ------
    DataError
        With one problem per mistake.
    """
    saved = checked_estimate(document, where)
    absent = [key for key in (*KEYS, *PARTS) if key not in saved and key not in LATER]
    if absent:
        remedy = f"{ESTIMATE.remedy}, the whole of it"
        raise DataError(*(Problem(f"{where}: {key}", "is missing", remedy) for key in absent))
    present = {key: kind for key, kind in PARTS.items() if key in saved}
    parts = {key: typed(kind, saved[key], where, ESTIMATE.remedy, []) for key, kind in present.items()}
    identified = _parameters(saved, "params", "bse", "")
    problems = _contradictions(saved, identified, parts["rows"], where)
    if problems:
        raise DataError(*problems)
    return {
        "model": EstimatedModel(
            saved["chain"],
            saved["sensor_set"],
            saved["title"],
            saved["composites"],
            saved.get("roles", {}),
            tuple(saved.get("unseen", ())),
            _reals(saved.get("known", {})),
            tuple(saved.get("joined", ())),
            saved.get("groupings", {}),
        ),
        "records": tuple(saved["records"]),
        "fit": _fit(saved, parts),
        "covariances": _covariances(saved),
        "parameters": EstimatedParameters(
            identified,
            _parameters(saved, "physical", "physical_bse", "physical_"),
            np.array([_real(value) for value in saved["base"]]),
            _reals(saved["nuisance"]),
            saved["not_identifiable"],
            tuple(_reals(one) for one in saved["other_solutions"]),
        ),
        "checks": parts["checks"],
        "modal": parts.get("modes", Modes(notes=("No modes: the estimate was saved without them.",))),
        "contents": tuple(saved.get("contents", ())),
    }


def _fit(saved: Mapping[str, Any], parts: Mapping[str, Any]) -> EstimatedFit:
    return EstimatedFit(
        method=saved["method"],
        method_title=saved.get("method_title", saved["method"]),
        covariance_kind=saved["covariance_kind"],
        filtering=parts["filtering"],
        rows=parts["rows"],
        resid=None,
        condition_number=_real(saved["condition_number"], math.inf),
        condition_number_raw=_real(saved["condition_number_raw"], math.inf),
        relative_error=_real(saved["relative_error"], math.inf),
        error_norm=_real(saved["error_norm"]),
        sigma=_real(saved["sigma"]),
        residual_dof=saved["residual_dof"],
        pruning=parts["pruning"],
        delays=_reals(saved["delays"]),
        delay_std=_reals(saved["delay_std"]),
        notes=tuple(saved["notes"]),
    )


def _parameters(saved: Mapping[str, Any], values: str, std: str, prefix: str) -> tuple[Parameter, ...]:
    further = [saved.get(f"{prefix}{part}_std", {}) for part in ("noise", "drift", "printed")]
    return tuple(
        Parameter(
            name,
            saved["units"].get(name, ""),
            _real(value),
            _real(saved[std][name]),
            *(_real(table.get(name)) for table in further),
        )
        for name, value in saved[values].items()
    )


def _covariances(saved: Mapping[str, Any]) -> Covariances:
    count = len(saved["params"])
    unknown = [[None] * count] * count
    keys = ("cov_params", "noise_covariance", "drift_covariance", "printed_covariance")
    return Covariances(*(_matrix(saved.get(key, unknown)) for key in keys))


def _contradictions(
    saved: Mapping[str, Any], identified: tuple[Parameter, ...], rows: Any, where: str
) -> list[Problem]:
    """Return which numbers do not follow from those that they were calculated from."""
    found: list[str] = []
    for entry in identified:
        relative = _real(saved["relative_std"][entry.name], math.inf)
        found += [f"relative_std.{entry.name}"] * (not _same(relative, entry.relative_std))
        pair = zip(saved["conf_int_95"][entry.name], entry.interval(), strict=True)
        reach = max(abs(entry.value), abs(entry.std))  # bounds may be differences near zero
        if not all(_same(_real(a), b, reach) for a, b in pair):
            found.append(f"conf_int_95.{entry.name}")
    for name, row, entry in zip(saved["params"], saved["cov_params"], identified, strict=True):
        k = list(saved["params"]).index(name)
        if not _same(math.sqrt(max(0.0, _real(row[k], 0.0))), entry.std):
            found.append(f"cov_params[{k}][{k}]")
    found += ["nobs"] * (saved["nobs"] != sum(row.used for row in rows if row.weight > 0.0))
    names = (*saved["params"], *saved["physical"])
    found += [f"units.{name}" for name in dict.fromkeys(names) if name not in saved["units"]]
    what = "does not agree with the other numbers"
    return [Problem(f"{where}: {key}", what, CHANGED) for key in found]


def _same(a: float, b: float, size: float = 0.0) -> bool:
    known = math.isfinite(a), math.isfinite(b)
    return not any(known) or math.isclose(a, b, rel_tol=AGREEMENT, abs_tol=AGREEMENT * size)


def _real(value: float | None, otherwise: float = math.nan) -> float:
    return otherwise if value is None else float(value)


def _reals(table: Mapping[str, float | None]) -> dict[str, float]:
    return {name: _real(value) for name, value in table.items()}


def _matrix(rows: Any) -> FloatArray:
    return np.array([[_real(value) for value in row] for row in rows], dtype=float).reshape(len(rows), -1)
