"""ChainEstimator: identification with the manners of scikit-learn, which is not needed for it."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import Model
from modelgen.runtime.records.record import Record, missing_name
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.rows.observation import observe


class ChainEstimator:
    """Identify a model's parameters with `fit`, rebuild forces with `predict`.

    Parameters
    ----------
    model : Model or module
        See `modelgen.load_model`.
    method, cutoff_hz, filter_order, decimation, direction_cutoff_hz
        As in `modelgen.identify`; frequencies in Hz.

    Attributes
    ----------
    estimate_ : Estimate
        What `fit` found; `coef_`, shape (columns,), holds its base parameters.

    Examples
    --------
    >>> import generated.emps_rigid_qm as module
    >>> ChainEstimator(module).get_params()["method"]
    'wls'
    """

    estimate_: Estimate
    coef_: FloatArray

    def __init__(
        self,
        model: Any,
        method: str = "auto",
        cutoff_hz: float | None = None,
        filter_order: int | None = None,
        decimation: int | None = None,
        direction_cutoff_hz: float | None = None,
    ) -> None:
        # kept as they are: get_params and clone rely on it
        self.model = model
        self.method = method
        self.cutoff_hz = cutoff_hz
        self.filter_order = filter_order
        self.decimation = decimation
        self.direction_cutoff_hz = direction_cutoff_hz

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return what the estimator was made with; `deep` changes nothing here."""
        del deep
        return {name: getattr(self, name) for name in self._names()}

    def set_params(self, **params: Any) -> Self:
        """Set parameters of the estimator.

        Raises
        ------
        DataError
            For a name that is none of them.
        """
        unknown = [name for name in params if name not in self._names()]
        if unknown:
            raise DataError(
                *(missing_name("set_params", "parameter", name, self._names()) for name in unknown)
            )
        for name, value in params.items():
            setattr(self, name, value)
        return self

    def __sklearn_clone__(self) -> Self:
        # a model holds a module, of which there are no deep copies; it never changes, so it is shared
        return type(self)(**self.get_params())

    def fit(self, X: Record | Sequence[Record], y: None = None) -> Self:
        """Identify the parameters from records; the forces are in them, `y` is not used."""
        del y
        options = {name: value for name, value in self.get_params().items() if name != "model"}
        self.estimate_ = identify(self.model, X, **values_of(**options))
        self.coef_ = self.estimate_.base
        return self

    def predict(self, X: Record) -> FloatArray:
        """Return the rebuilt left-hand sides W x of a record, rows one after another, shape (samples,).

        They are filtered as in `fit`; masked samples are left out.
        """
        return np.concatenate([W @ self._solution() for _, W in self._rows(X)])

    def score(self, X: Record, y: None = None) -> float:
        """Return R^2 of the rows that hold a force, at best 1."""
        del y
        solution = self._solution()
        pairs = [(Y, W @ solution) for Y, W in self._rows(X, forces_only=True)]
        if not pairs:
            raise DataError.at(X.name, "has no sample of a row with a force", "score on a longer record")
        left = sum(float(np.sum((Y - rebuilt) ** 2)) for Y, rebuilt in pairs)
        spread = sum(float(np.sum((Y - Y.mean()) ** 2)) for Y, _ in pairs)
        return 1.0 - left / spread if spread else 0.0

    def _names(self) -> tuple[str, ...]:
        return tuple(inspect.signature(type(self).__init__).parameters)[1:]

    def _model(self) -> Model:
        from modelgen.runtime.model.model import model_from_module

        return self.model if isinstance(self.model, Model) else model_from_module(self.model)

    def _solution(self) -> FloatArray:
        if not hasattr(self, "estimate_"):
            raise DataError.at("ChainEstimator", "is not fitted", "call fit(records) first")
        nuisance = self.estimate_.parameters.nuisance
        names = self._model().base_parameters
        stand_in = np.array([nuisance.get(name, 0.0) for name in names])
        return np.where(np.isfinite(self.coef_), self.coef_, stand_in)

    def _rows(self, record: Record, forces_only: bool = False) -> list[tuple[FloatArray, FloatArray]]:
        self._solution()
        from dataclasses import replace

        filtering = self.estimate_.fit.filtering
        choice = replace(filtering, decimation=filtering.decimation[:1])
        blocks = observe(self._model(), [record], choice).dense().blocks
        return [(b.Y, b.W) for b in blocks if b.place.size and (b.has_force or not forces_only)]

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.get_params().items())
        return f"ChainEstimator({given})"
