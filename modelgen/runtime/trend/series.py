"""Estimates of one machine in their order -> a series of values for every quantity that they give."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.results.estimate import Estimate


@dataclass(frozen=True, eq=False)
class Series:
    """One quantity over the entries that give it.

    Attributes
    ----------
    name, unit : str
    entries : array of int, shape (k,)
        Which of the entries.
    values : array, shape (k,)
    noise, drift : arrays, shape (k,)
        Standard deviations: what each entry errs by itself, and what entries may share.
    """

    name: str
    unit: str
    entries: IntArray
    values: FloatArray
    noise: FloatArray
    drift: FloatArray


def all_series(estimates: Sequence[Estimate]) -> tuple[Series, ...]:
    """Return the series of all parameters, physical ones and the rest, and of the modes.

    What has no standard deviation in an entry is left out there.
    """
    found: dict[tuple[str, str], list[tuple[int, float, float, float]]] = {}
    for index, estimate in enumerate(estimates):
        for name, unit, value, noise, drift in _quantities(estimate):
            if math.isfinite(value) and math.isfinite(noise) and math.isfinite(drift) and noise + drift > 0.0:
                found.setdefault((name, unit), []).append((index, value, noise, drift))
    return tuple(
        Series(name, unit, np.array([row[0] for row in rows]), *np.array([row[1:] for row in rows]).T)
        for (name, unit), rows in found.items()
    )


def _quantities(estimate: Estimate) -> Iterator[tuple[str, str, float, float, float]]:
    """Yield name, unit, value, and the standard deviations of noise and of drift."""
    physical = {entry.name for entry in estimate.parameters.physical}
    hidden = {*physical, *(estimate.model.composites if physical else ())}
    own = [entry for entry in estimate.parameters.identified if entry.name not in hidden]
    for entry in (*estimate.parameters.physical, *own):
        noise, drift = _parts(entry)
        yield entry.name, entry.unit, entry.value, noise, drift
    shared = max((_share(entry) for entry in estimate.parameters.identified), default=1.0)
    for number, mode in enumerate(estimate.modes(), 1):
        slowest = mode.time_constants_s[0] if mode.frequency_hz is None and mode.time_constants_s else None
        for what, unit, value in (
            ("frequency", "Hz", mode.frequency_hz),
            ("damping ratio", "", mode.damping_ratio),
            ("time constant", "s", slowest),
        ):
            if value is not None and value.std is not None:
                noise, drift = value.std * math.sqrt(1.0 - shared), value.std * math.sqrt(shared)
                yield f"mode {number} {what}", unit, value.value, noise, drift


def _parts(entry: Parameter) -> tuple[float, float]:
    """Return what errs by itself and what may be shared; all of it where the parts are not known."""
    share = _share(entry)
    return entry.std * math.sqrt(1.0 - share), entry.std * math.sqrt(share)


def _share(entry: Parameter) -> float:
    """Return the share of a parameter's variance that entries may have in common."""
    total = entry.noise_std**2 + entry.drift_std**2
    return entry.drift_std**2 / total if math.isfinite(total) and total > 0.0 else 1.0
