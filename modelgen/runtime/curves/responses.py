"""Measured and modelled frequency responses of a record's sensors over a force, ready to be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modelgen.array_types import FloatArray, IntArray
from modelgen.errors import DataError
from modelgen.runtime.curves.equivalent_gains import EquivalentGains
from modelgen.runtime.curves.model_response import (
    EstimatedChain,
    ModelResponse,
    estimated_chain,
    model_response,
    response_unit,
)
from modelgen.runtime.curves.thresholds import CURVE_POINTS, MOST_POINTS
from modelgen.runtime.least_squares.delays import advanced
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.frequency_response import FrequencyResponse
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.results.estimate import Estimate


@dataclass(frozen=True, eq=False)
class ResponsePair:
    """A measured response, thinned to what a plot shows, and the modelled one over the same band."""

    measured: FrequencyResponse
    modelled: ModelResponse

    @property
    def title(self) -> str:
        """What is over what, and on which record."""
        return f"{self.measured.output} over {self.measured.input}, {self.measured.record}"


def responses(
    model: Model,
    record: Record,
    estimate: Estimate,
    outputs: Sequence[str] | None = None,
    input: str | None = None,
) -> list[ResponsePair]:
    """Return the responses of sensors over one force of a record, delays that the estimate found taken out.

    Parameters
    ----------
    model : Model
    record : Record
    estimate : Estimate
        Of the same model; its filter says up to where motion is more than noise.
    outputs : sequence of str, optional
        Sensors; by default all that the record has.
    input : str, optional
        Actuator; by default the first whose force moves.

    Raises
    ------
    DataError
        When a name is no sensor or actuator of the record, or no force moves.
    """
    force, late = _force(model, record, input), estimate.delays
    record = advanced(record, late)
    keys = [s.key for s in model.sensors if s.key in record.signals]
    wanted = keys if outputs is None else list(outputs)
    problems = [missing_name(record.name, "sensor", key, keys) for key in wanted if key not in keys]
    DataError.raise_any(problems)
    try:
        chain = estimated_chain(model, estimate)
        gains = chain.gains(record, estimate.fit.filtering.cutoff_hz)
    except DataError as error:
        # no chain has such parameters: what was measured is drawn all the same
        return [_measured_alone(model, record, key, force, str(error)) for key in wanted]
    pairs = [_pair(chain, gains, record, key, force) for key in wanted]
    notes = {k: _late(k, late.get(k, 0.0), estimate.fit.filtering.cutoff_hz) for k in (force, *wanted)}
    return [
        replace(
            pair, modelled=replace(pair.modelled, notes=(*pair.modelled.notes, *notes[force], *notes[key]))
        )
        for key, pair in zip(wanted, pairs, strict=True)
    ]


def _late(key: str, delay_s: float, cutoff_hz: float) -> tuple[str, ...]:
    """Return what is said of a delay that was found and taken out, where it turns a phase by a degree."""
    if abs(360.0 * delay_s * cutoff_hz) < 1.0:
        return ()
    word = "late" if delay_s > 0.0 else "early"
    return (f"measured without the delay that was found: {key} is {1e3 * abs(delay_s):.3g} ms {word}",)


def moving_forces(model: Model, record: Record) -> list[str]:
    """Return the actuators whose force changes in a record."""
    keys = [a.key for a in model.actuators if a.key in record.signals]
    return [key for key in keys if record.facts.extent(key).span > 0.0]


def _force(model: Model, record: Record, given: str | None) -> str:
    moving = moving_forces(model, record)
    if given is None:
        if not moving:
            what = "has no force of this model that moves"
            raise DataError.at(record.name, what, "choose a record in which an actuator works")
        return moving[0]
    if given not in moving:
        raise DataError(missing_name(record.name, "moving force", given, moving))
    return given


def _pair(
    chain: EstimatedChain, gains: EquivalentGains | None, record: Record, output: str, input: str
) -> ResponsePair:
    found = _thinned(record.frequency_response(output, input))
    f = found.frequency_hz
    curve_hz = np.geomspace(f[0], f[-1], CURVE_POINTS) if len(f) > 1 else f
    return ResponsePair(found, model_response(chain, output, input, np.asarray(curve_hz), gains))


def _measured_alone(model: Model, record: Record, output: str, input: str, reason: str) -> ResponsePair:
    found, none = _thinned(record.frequency_response(output, input)), np.zeros(0)
    unit = response_unit(model, output, input)
    modelled = ModelResponse(
        output, input, unit, none, none.astype(complex), none, none, "measured", (reason,)
    )
    return ResponsePair(found, modelled)


def _thinned(found: FrequencyResponse) -> FrequencyResponse:
    keep = _spread(found.frequency_hz)
    return replace(
        found,
        frequency_hz=found.frequency_hz[keep],
        response=found.response[keep],
        coherence=found.coherence[keep],
    )


def _spread(f: FloatArray) -> IntArray:
    """Return places of at most MOST_POINTS frequencies, spread evenly over a logarithmic axis."""
    if f.size <= MOST_POINTS:
        return np.arange(f.size)
    wanted = np.geomspace(f[0], f[-1], MOST_POINTS)
    return np.unique(np.searchsorted(f, wanted).clip(0, f.size - 1))
