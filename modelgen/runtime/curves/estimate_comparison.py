"""`estimate.compare`: a record and what the identified chain does under its forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import overload

import numpy as np

from modelgen.runtime.curves.subject import model_of, records_of
from modelgen.runtime.model.model import Model
from modelgen.runtime.prediction.compare import RUBBING, compare
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.validation import Validation


class EstimateComparison:
    """Compares an estimate with records."""

    def __init__(self, estimate: Estimate) -> None:
        self._estimate = estimate

    @overload
    def __call__(
        self,
        records: Record,
        horizon: int | None = None,
        values: Mapping[str, float] | None = None,
        model: Model | ModuleType | None = None,
    ) -> Validation: ...

    @overload
    def __call__(
        self,
        records: Sequence[Record] | None = None,
        horizon: int | None = None,
        values: Mapping[str, float] | None = None,
        model: Model | ModuleType | None = None,
    ) -> tuple[Validation, ...]: ...

    def __call__(
        self,
        records: Record | Sequence[Record] | None = None,
        horizon: int | None = None,
        values: Mapping[str, float] | None = None,
        model: Model | ModuleType | None = None,
    ) -> Validation | tuple[Validation, ...]:
        """Compare measured signals with the chain under the measured forces, as MATLAB's compare does.

        Parameters
        ----------
        records : Record or sequence of Record, optional
            By default those identified from; others are held out.
        horizon : int, optional
            Predict so many samples ahead; by default open loop over the whole record, from the state at its
            beginning that suits it best.
        values : mapping of str to float, optional
            Parameters (SI) that the estimate does not give. Friction and damping that neither gives count as
            zero, and the result's notes say so.
        model : Model or module, optional
            For an estimate that was loaded.

        Returns
        -------
        Validation, or tuple of them
            One a record; its `checks` hold the fit in % of each channel, 100 (1 - |error| / |variation|), and
            its `plot()` draws them.

        Raises
        ------
        DataError
            When a parameter, a force or all sensors are missing, or model or records are to be given.
        """
        known, given = model_of(self._estimate, model), records_of(self._estimate, records)
        parameters = {**_physical(known, self._estimate), **(values or {})}
        found = compare(known, parameters, given, horizon, self._estimate.identified_from)
        return found[0] if isinstance(records, Record) else found


def _physical(model: Model, estimate: Estimate) -> dict[str, float]:
    """Return the physical parameters of an estimate, or others that say the same of every signal."""
    given = {name: estimate.params[name] for name in model.parameters if name in estimate.params}
    given |= estimate.physical
    lost = [name for name in model.parameters if name not in given and name not in model.known]
    needed = [name for name in lost if name in model.roles and model.roles[name].role not in RUBBING]
    if not needed:
        return given
    chain = None if estimate.source is None else estimate.source.chain
    if chain is not None and np.isfinite(estimate.base).all():
        # any parameters with these base parameters have the same rows, and so the same signals
        return {**chain.by_name, **given}
    return given
