"""The model and the records that a curve of an estimate is of: those it was made from, or given ones."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

from modelgen.errors import DataError
from modelgen.runtime.identification.one_body.body_model import as_one_body
from modelgen.runtime.model.model import Model, model_from_module
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate


def model_of(estimate: Estimate, given: Model | ModuleType | None = None) -> Model:
    """Return the given model, or the one that the estimate was made with; as one body where it is of that.

    Raises
    ------
    DataError
        When the estimate holds none (it was loaded, or came from another process), or is of another model.
    """
    if given is None:
        if estimate.source is None:
            remedy = "give model=modelgen.load_model(...), the module that it was identified with"
            raise DataError.at("estimate", "holds no model: neither files nor pickles keep it", remedy)
        return estimate.source.model
    model = given if isinstance(given, Model) else model_from_module(given)
    if (model.chain, model.sensor_set) != (estimate.model.chain, estimate.model.sensor_set):
        what = f"is of {estimate.model}, the model of {model.chain}, sensors {model.sensor_set}"
        raise DataError.at("estimate", what, "give the module that it was identified with")
    body = as_one_body(model) if estimate.model.as_one_body else None
    return model if body is None else body


def records_of(estimate: Estimate, given: Record | Sequence[Record] | None = None) -> tuple[Record, ...]:
    """Return the given records, or those that the estimate was made from; raises as `model_of` does."""
    if given is not None:
        records = (given,) if isinstance(given, Record) else tuple(given)
        if records and all(isinstance(record, Record) for record in records):
            return records
        raise DataError.at("records", "are no Records", "give a Record, or a list of them")
    if estimate.source is None:
        remedy = "give records=[...], those that it was identified from"
        raise DataError.at("estimate", "holds no records: neither files nor pickles keep them", remedy)
    return estimate.source.records
