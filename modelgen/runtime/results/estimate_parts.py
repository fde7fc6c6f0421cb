"""The parts of an Estimate: its model, its fit with how every row did, its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.frozen_values import FrozenValues, read_only
from modelgen.runtime.filter_choice.filter_choice import FilterChoice
from modelgen.runtime.model.mechanical_parts import BENDING
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.parameters.pruning import Pruning

FORMAT_VERSION = 1  # of saved estimates


@dataclass(frozen=True)
class EstimatedModel:
    """Which generated model was identified: names of its chain and sensor set, and the chain's title.

    `composites` maps base parameters that go by a short symbol to their formula in the physical ones, `roles`
    physical parameters to what they are (inertia, stiffness, ...). `unseen` are those that these sensors
    cannot determine, whatever the records hold; `known` holds values (SI) of those that were not estimated.
    `groupings` maps the short names of sums to these, of arms.
    `joined` are the sensor sets whose estimates were joined to this one; none for a single one.
    """

    chain: str
    sensor_set: str
    title: str
    composites: Mapping[str, str] = field(default_factory=dict)
    roles: Mapping[str, str] = field(default_factory=dict)
    unseen: tuple[str, ...] = ()
    known: Mapping[str, float] = field(default_factory=dict)
    joined: tuple[str, ...] = ()
    groupings: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.chain}, sensors {self.sensor_set}"

    @property
    def as_one_body(self) -> bool:
        """Whether the chain was identified as one body, as its records show no spring."""
        return BENDING in self.roles.values()


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
class EstimatedFit(FrozenValues):
    """How the parameters were found, and how well the rows are fitted.

    Attributes
    ----------
    method, method_title : str
        The estimator, and what it is called in full.
    covariance_kind : str
        How the covariance of the noise was made: "hac", or "printed" for eq. (11).
    filtering : FilterChoice
    rows : tuple of RowDiagnostics
    residuals : tuple of (float, array), or None
        Weight and residual of each row on each record, (n,) in the unit of the row. None where a limit of
        memory did not let the rows stay, and in an estimate from a file.
    condition_number, condition_number_raw : float
        Of the weighted observation matrix, with and without scaling its columns to unit length.
    relative_error, error_norm : float
        Norm of the weighted residual, relative to what the rows' own errors are relative to (not in %), and
        as it is.
    sigma : float
        Standard deviation of the weighted residual; `residual_dof` says with which degrees of freedom.
    delays, delay_std : mapping of str to float
        Delay in s of every force whose delay was estimated, and its standard deviation.
    pruning : Pruning
        What is left without parameters of a large relative standard deviation.
    notes : tuple of str
        What one should know before believing the numbers.
    """

    method: str
    method_title: str
    covariance_kind: str
    filtering: FilterChoice
    rows: tuple[RowDiagnostics, ...]
    residuals: tuple[tuple[float, FloatArray], ...] | None
    condition_number: float
    condition_number_raw: float
    relative_error: float
    error_norm: float
    sigma: float
    residual_dof: str
    pruning: Pruning
    delays: Mapping[str, float] = field(default_factory=dict)
    delay_std: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.residuals is not None:
            kept = tuple((weight, read_only(residual)) for weight, residual in self.residuals)
            object.__setattr__(self, "residuals", kept)

    @cached_property
    def resid(self) -> FloatArray | None:
        """Weighted residual, rows stacked, shape (nobs,); None without `residuals`.

        In the unit of the row where there is only one block.
        """
        if self.residuals is None:
            return None
        found = np.concatenate([weight * residual for weight, residual in self.residuals])
        found.flags.writeable = False
        return found


@dataclass(frozen=True, eq=False)
class EstimatedParameters(FrozenValues):
    """The parameters that the records answer, and why they do not answer the others.

    Attributes
    ----------
    identified : tuple of Parameter
        The base parameters that the records answer, in the order of the model.
    physical : tuple of Parameter
        The physical ones that follow from them; standard deviations to first order.
    base : array, shape (columns,)
        All base parameters of the model in its order; NaN for what is not identifiable.
    nuisance : mapping of str to float
        Values of columns that had to stay in the fit although the records cannot answer them. Not estimates.
    not_identifiable : mapping of str to str
        Base or physical parameter to the reason why there is no number for it.
    other_solutions : tuple of mappings
        Further sets of physical parameters that fit the composites of an elimination as well.
    """

    identified: tuple[Parameter, ...]
    physical: tuple[Parameter, ...]
    base: FloatArray
    nuisance: Mapping[str, float]
    not_identifiable: Mapping[str, str]
    other_solutions: tuple[Mapping[str, float], ...] = ()

    @property
    def told(self) -> tuple[Parameter, ...]:
        """The base parameters identified, then the physical ones that are none of these."""
        names = {entry.name for entry in self.identified}
        return (*self.identified, *(entry for entry in self.physical if entry.name not in names))
