"""Estimate: what an identification found, frozen; the names are those of statsmodels where it has one."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from statistics import NormalDist
from types import MappingProxyType
from typing import Any

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.pruning import Pruning
from modelgen.runtime.results.checks import Checks
from modelgen.runtime.results.formats import data_frame, html_table, latex_table, markdown_table
from modelgen.runtime.results.summary import summary_text

FORMAT_VERSION = 1


@dataclass(frozen=True)
class RowDiagnostics:
    """How one row of the model did on one record.

    `used` and `masked` count samples of the decimated grid, `weight` is that of the fit. `residual_rms` is in
    `unit`; `relative_error` is that of the row alone, for a row without a force relative to its largest term.
    Both are None where no sample is left.
    """

    record: str
    row: str
    unit: str
    used: int
    masked: int
    weight: float
    residual_rms: float | None
    relative_error: float | None


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters identified from records, with what is needed to judge them.

    Attributes
    ----------
    chain, sensor_set, title : str
        The model; `method` is the estimator, `records` the records' names.
    parameters : tuple of Parameter
        The base parameters that the records answer, in the order of the model.
    physical_parameters : tuple of Parameter
        The physical ones that follow from them; standard deviations to first order.
    covariance, noise_covariance, printed_covariance : array, shape (parameters, parameters)
        Covariance behind `bse` and `conf_int`; the part of it that the residuals explain (`covariance_kind`:
        "hac" or "printed"), the rest is how X drifts with the settings; and the paper's, eq. (11).
    base : array, shape (columns,)
        All base parameters of the model in its order; NaN for what is not identifiable.
    nuisance : mapping of str to float
        Values of columns that had to stay in the fit although the records cannot answer them. Not estimates.
    not_identifiable : mapping of str to str
        Base or physical parameter to the reason why there is no number for it.
    resid : array, shape (nobs,)
        Weighted residual, rows stacked; in the unit of the row where there is only one block. Empty where
        the records were read in chunks; `residual_count` then says how long it would be.
    condition_number, condition_number_raw : float
        Of the weighted observation matrix, with and without scaling its columns to unit length.
    relative_error, error_norm : float
        Norm of the weighted residual, relative to the weighted measurement (not in %) and as it is.
    sigma : float
        Standard deviation of the weighted residual; `residual_dof` says with which degrees of freedom.
    delays, delay_std : mapping of str to float
        Delay in s of every force, and its standard deviation, where the method estimates them.
    rows : tuple of RowDiagnostics
    pruning : Pruning
        What is left without parameters of a large relative standard deviation.
    filtering : FilterChoice
    notes : tuple of str
        What one should know before believing the numbers.
    other_solutions : tuple of mappings
        Further sets of physical parameters that fit the composites of an elimination as well.
    checks : Checks
        What the guards and the tests of the residual say, and the comparisons that were asked for.
    """

    chain: str
    sensor_set: str
    title: str
    method: str
    method_title: str
    records: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    physical_parameters: tuple[Parameter, ...]
    covariance: FloatArray
    noise_covariance: FloatArray
    printed_covariance: FloatArray
    covariance_kind: str
    base: FloatArray
    nuisance: Mapping[str, float]
    not_identifiable: Mapping[str, str]
    resid: FloatArray
    condition_number: float
    condition_number_raw: float
    relative_error: float
    error_norm: float
    sigma: float
    residual_dof: str
    delays: Mapping[str, float]
    rows: tuple[RowDiagnostics, ...]
    pruning: Pruning
    filtering: FilterChoice
    notes: tuple[str, ...]
    other_solutions: tuple[Mapping[str, float], ...] = ()
    delay_std: Mapping[str, float] = field(default_factory=dict)
    checks: Checks = field(default_factory=Checks)
    residual_count: int | None = None

    def __post_init__(self) -> None:
        for name in ("covariance", "noise_covariance", "printed_covariance", "base", "resid"):
            array = np.array(getattr(self, name), dtype=float)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        for name in ("nuisance", "not_identifiable", "delays", "delay_std"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __reduce__(self) -> tuple[Any, ...]:
        # a mapping proxy cannot be sent to another process, a dict can
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        values |= {
            name: dict(values[name]) for name in ("nuisance", "not_identifiable", "delays", "delay_std")
        }
        return _rebuild, (values,)

    @property
    def params(self) -> Mapping[str, float]:
        """Base parameters identified: name to value."""
        return MappingProxyType({entry.name: entry.value for entry in self.parameters})

    @property
    def bse(self) -> Mapping[str, float]:
        """Standard deviations of `params`."""
        return MappingProxyType({entry.name: entry.std for entry in self.parameters})

    @property
    def relative_std(self) -> Mapping[str, float]:
        """Standard deviations of `params` in % of their magnitude (eq. (12))."""
        return MappingProxyType({entry.name: entry.relative_std for entry in self.parameters})

    @property
    def physical(self) -> Mapping[str, float]:
        """Physical parameters identified: name to value."""
        return MappingProxyType({entry.name: entry.value for entry in self.physical_parameters})

    @property
    def nobs(self) -> int:
        """Number of rows of the weighted observation matrix."""
        return len(self.resid) if self.residual_count is None else self.residual_count

    def cov_params(self, kind: str | None = None) -> FloatArray:
        """Return the covariance of `params`, shape (parameters, parameters).

        `kind` is None for the one behind `bse`, "noise" for the part of it that the residuals explain,
        "printed" for eq. (11), and "periods" for the spread over periods where every record has some.
        """
        kinds = {None: self.covariance, "noise": self.noise_covariance, "printed": self.printed_covariance}
        if self.checks.periods is not None:
            kinds["periods"] = np.array(self.checks.periods.covariance)
        return kinds[kind]

    def conf_int(self, alpha: float = 0.05) -> Mapping[str, tuple[float, float]]:
        """Return intervals that hold each of `params` with probability 1 - alpha (normal distribution)."""
        z = NormalDist().inv_cdf(1.0 - 0.5 * alpha)
        return MappingProxyType(
            {
                entry.name: (entry.value - z * entry.std, entry.value + z * entry.std)
                for entry in self.parameters
            }
        )

    def summary(self) -> str:
        """Return everything worth reading as plain text."""
        return summary_text(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate in plain types, without the residual; what is not finite becomes None."""
        intervals = self.conf_int()
        plain = {
            "format": "modelgen estimate",
            "version": FORMAT_VERSION,
            "chain": self.chain,
            "sensor_set": self.sensor_set,
            "title": self.title,
            "method": self.method,
            "records": self.records,
            "params": self.params,
            "bse": self.bse,
            "relative_std": self.relative_std,
            "conf_int_95": intervals,
            "units": {entry.name: entry.unit for entry in self.parameters + self.physical_parameters},
            "physical": self.physical,
            "physical_bse": {entry.name: entry.std for entry in self.physical_parameters},
            "not_identifiable": self.not_identifiable,
            "other_solutions": self.other_solutions,
            "nuisance": self.nuisance,
            "base": self.base.tolist(),
            "noise_std": {entry.name: entry.noise_std for entry in self.parameters},
            "drift_std": {entry.name: entry.drift_std for entry in self.parameters},
            "printed_std": {entry.name: entry.printed_std for entry in self.parameters},
            "cov_params": self.covariance.tolist(),
            "printed_covariance": self.printed_covariance.tolist(),
            "covariance_kind": self.covariance_kind,
            "nobs": self.nobs,
            "condition_number": self.condition_number,
            "condition_number_raw": self.condition_number_raw,
            "relative_error": self.relative_error,
            "error_norm": self.error_norm,
            "sigma": self.sigma,
            "residual_dof": self.residual_dof,
            "delays": self.delays,
            "delay_std": self.delay_std,
            "rows": [asdict(row) for row in self.rows],
            "pruning": asdict(self.pruning),
            "filtering": asdict(self.filtering),
            "notes": self.notes,
            "checks": asdict(self.checks),
        }
        return {key: _plain(value) for key, value in plain.items()}

    def to_json(self) -> str:
        """Return `to_dict` as JSON, the same for the same estimate."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False) + "\n"

    def to_latex(self) -> str:
        """Return the parameters as a LaTeX tabular (package booktabs)."""
        return latex_table(self)

    def to_markdown(self) -> str:
        """Return the parameters as a Markdown table."""
        return markdown_table(self)

    def to_dataframe(self) -> Any:
        """Return the parameters as a pandas DataFrame, one row a parameter; needs pandas."""
        return data_frame(self)

    def _repr_html_(self) -> str:
        details = f"<details><summary>everything</summary><pre>{html.escape(self.summary())}</pre></details>"
        return html_table(self) + details

    def __repr__(self) -> str:
        numbers = ", ".join(f"{entry.name}={entry.value:.6g}" for entry in self.parameters)
        return f"Estimate({self.chain}, {self.sensor_set}, {self.method}: {numbers})"


def _rebuild(values: dict[str, Any]) -> Estimate:
    return Estimate(**values)


def _plain(value: Any) -> Any:
    """Return a value in JSON's types; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
