"""An estimate in plain types, for JSON; what is not finite becomes None."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

from modelgen.documents import plain_json
from modelgen.runtime.results.estimate_parts import FORMAT_VERSION

if TYPE_CHECKING:
    from modelgen.runtime.results.estimate import Estimate


def estimate_document(estimate: Estimate) -> dict[str, Any]:
    """Return an estimate as a mapping of texts, numbers, lists and mappings, without the residual.

    Its keys are those of `SavedEstimate`: what an estimate or one of its parts has under that name, or below.
    """
    from modelgen.runtime.results.estimate_file import SavedEstimate

    identified, physical = estimate.parameters.identified, estimate.parameters.physical
    stds = ("noise_std", "drift_std", "printed_std")
    own = {
        "format": "modelgen estimate",
        "version": FORMAT_VERSION,
        "contents": tuple(estimate.contents),
        "conf_int_95": estimate.conf_int(),
        "units": {entry.name: entry.unit for entry in identified + physical},
        "physical_bse": {entry.name: entry.std for entry in physical},
        **{f"physical_{std}": {entry.name: getattr(entry, std) for entry in physical} for std in stds},
        **{std: {entry.name: getattr(entry, std) for entry in identified} for std in stds},
        "base": estimate.base.tolist(),
        "cov_params": estimate.covariances.total.tolist(),
        "noise_covariance": estimate.covariances.noise.tolist(),
        "drift_covariance": estimate.covariances.drift.tolist(),
        "printed_covariance": estimate.covariances.printed.tolist(),
        "modes": estimate.modes().to_dict(),
    }
    parts = (estimate, estimate.model, estimate.fit, estimate.parameters)
    for name in (one.name for one in fields(SavedEstimate) if one.name not in own):
        own[name] = next(getattr(part, name) for part in parts if hasattr(part, name))
    return {one.name: plain_json(own[one.name]) for one in fields(SavedEstimate)}
