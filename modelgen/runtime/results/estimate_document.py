"""An estimate in plain types, for JSON; what is not finite becomes None."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from modelgen.runtime.results.estimate_parts import FORMAT_VERSION

if TYPE_CHECKING:
    from modelgen.runtime.results.estimate import Estimate


def estimate_document(estimate: Estimate) -> dict[str, Any]:
    """Return an estimate as a mapping of texts, numbers, lists and mappings, without the residual."""
    identified, physical = estimate.parameters.identified, estimate.parameters.physical
    intervals = estimate.conf_int()
    plain = {
        "format": "modelgen estimate",
        "version": FORMAT_VERSION,
        "chain": estimate.model.chain,
        "sensor_set": estimate.model.sensor_set,
        "title": estimate.model.title,
        "method": estimate.fit.method,
        "method_title": estimate.fit.method_title,
        "records": estimate.records,
        "contents": estimate.contents,
        "params": estimate.params,
        "bse": estimate.bse,
        "relative_std": estimate.relative_std,
        "conf_int_95": intervals,
        "units": {entry.name: entry.unit for entry in identified + physical},
        "physical": estimate.physical,
        "physical_bse": {entry.name: entry.std for entry in physical},
        "physical_noise_std": {entry.name: entry.noise_std for entry in physical},
        "physical_drift_std": {entry.name: entry.drift_std for entry in physical},
        "physical_printed_std": {entry.name: entry.printed_std for entry in physical},
        "not_identifiable": estimate.not_identifiable,
        "other_solutions": estimate.parameters.other_solutions,
        "nuisance": estimate.parameters.nuisance,
        "composites": estimate.model.composites,
        "roles": estimate.model.roles,
        "unseen": estimate.model.unseen,
        "known": estimate.model.known,
        "joined": estimate.model.joined,
        "groupings": estimate.model.groupings,
        "base": estimate.base.tolist(),
        "noise_std": {entry.name: entry.noise_std for entry in identified},
        "drift_std": {entry.name: entry.drift_std for entry in identified},
        "printed_std": {entry.name: entry.printed_std for entry in identified},
        "cov_params": estimate.covariances.total.tolist(),
        "noise_covariance": estimate.covariances.noise.tolist(),
        "drift_covariance": estimate.covariances.drift.tolist(),
        "printed_covariance": estimate.covariances.printed.tolist(),
        "covariance_kind": estimate.fit.covariance_kind,
        "nobs": estimate.nobs,
        "condition_number": estimate.condition_number,
        "condition_number_raw": estimate.fit.condition_number_raw,
        "relative_error": estimate.fit.relative_error,
        "error_norm": estimate.fit.error_norm,
        "sigma": estimate.fit.sigma,
        "residual_dof": estimate.fit.residual_dof,
        "delays": estimate.delays,
        "delay_std": estimate.delay_std,
        "rows": [asdict(row) for row in estimate.fit.rows],
        "pruning": asdict(estimate.fit.pruning),
        "filtering": asdict(estimate.fit.filtering),
        "notes": estimate.fit.notes,
        "checks": asdict(estimate.checks),
        "modes": estimate.modes().to_dict(),
        "verdict": asdict(estimate.verdict),
    }
    return {key: _plain(value) for key, value in plain.items()}


def _plain(value: Any) -> Any:
    """Return a value in JSON's types; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
