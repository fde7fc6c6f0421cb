"""Estimate: what an identification found, frozen; the names are those of statsmodels where it has one."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from modelgen.array_types import FloatArray
from modelgen.atomic_write import write_whole
from modelgen.documents import json_document
from modelgen.errors import DataError
from modelgen.lazy_accessor import LazyAccessor
from modelgen.read_file import ESTIMATE, read_text
from modelgen.runtime.modes.arm_modes import modes_of_arm
from modelgen.runtime.modes.chain_of_fit import modes_of_fit
from modelgen.runtime.modes.measured_peaks import with_peaks
from modelgen.runtime.modes.modes import Modes
from modelgen.runtime.parameters.grouped_reasons import reasons_of_parameters
from modelgen.runtime.parameters.physical_parameters import Covariances
from modelgen.runtime.results.answer import answer_html, answer_text
from modelgen.runtime.results.checks import Checks
from modelgen.runtime.results.estimate_document import estimate_document
from modelgen.runtime.results.estimate_parts import (
    EstimatedFit,
    EstimatedModel,
    EstimatedParameters,
)
from modelgen.runtime.results.formats import data_frame, latex_table, markdown_table
from modelgen.runtime.results.source import EstimateSource
from modelgen.runtime.results.summary import summary_text
from modelgen.runtime.results.verdict import Verdict, verdict


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters identified from records, with what is needed to judge them.

    Attributes
    ----------
    model : EstimatedModel
        Chain, sensor set and title.
    records : tuple of str
        Names of the records that were identified from.
    fit : EstimatedFit
        Method, filters, residual, conditioning, delays, how every row did, and notes.
    covariances : Covariances
        Covariance behind `bse` and `conf_int`; the part of it that the residuals explain, the rest, which is
        how X drifts with the settings; and the paper's, eq. (11). Shape (parameters, parameters) each.
    parameters : EstimatedParameters
        Base and physical parameters, and why others have no number.
    checks : Checks
        What the guards and the tests of the residual say, and the comparisons that were asked for.
    modal : Modes
        What was said of the modes, where the estimate was loaded or pickled; ask `modes`.
    source : Source or None
        Model and records, for plots and comparisons; None where the estimate was loaded or pickled.
    contents : sequence of str
        What identifies the samples of these records, a text for each channel of each; empty where
        the estimate was saved without.
    """

    model: EstimatedModel
    records: tuple[str, ...]
    fit: EstimatedFit
    covariances: Covariances
    parameters: EstimatedParameters
    checks: Checks = field(default_factory=Checks)
    modal: Modes = field(default_factory=Modes)
    source: EstimateSource | None = field(default=None, repr=False)
    contents: Sequence[str] = field(default=(), repr=False)

    # plot.bode(), plot.fit(), plot.residuals(), plot.parameters(): curves with their intervals
    plot = LazyAccessor("modelgen.runtime.plots.estimate_plots", "EstimatePlots")
    # compare(record, horizon=None): measured signals against the chain under the measured forces
    compare = LazyAccessor("modelgen.runtime.curves.estimate_comparison", "EstimateComparison")

    @property
    def identified_from(self) -> tuple[str, ...]:
        """The contents of the records behind the estimate; where these are unknown, the records' names."""
        return tuple(self.contents) or self.records

    @property
    def params(self) -> Mapping[str, float]:
        """Base parameters identified: name to value."""
        return MappingProxyType({entry.name: entry.value for entry in self.parameters.identified})

    @property
    def bse(self) -> Mapping[str, float]:
        """Standard deviations of `params`."""
        return MappingProxyType({entry.name: entry.std for entry in self.parameters.identified})

    @property
    def relative_std(self) -> Mapping[str, float]:
        """Standard deviations of `params` in % of their magnitude (eq. (12))."""
        return MappingProxyType({entry.name: entry.relative_std for entry in self.parameters.identified})

    @property
    def physical(self) -> Mapping[str, float]:
        """Physical parameters identified: name to value."""
        return MappingProxyType({entry.name: entry.value for entry in self.parameters.physical})

    @property
    def base(self) -> FloatArray:
        """All base parameters (SI) in the model's order, (columns,); NaN for what is not identifiable."""
        return self.parameters.base

    @property
    def not_identifiable(self) -> Mapping[str, str]:
        """Base or physical parameter to the reason why there is no number for it."""
        return self.parameters.not_identifiable

    @property
    def unanswered(self) -> Mapping[str, str]:
        """The same by the parameters of the spec: reasons of composites of them are theirs.

        Of an arm all of them: sums of its parameters are what there is to know.
        """
        if self.model.groupings:
            return self.not_identifiable
        told = [name for name in self.model.roles if name not in self.model.unseen]
        numbers = {*self.params, *self.physical}
        return reasons_of_parameters(self.not_identifiable, self.model.composites, told, numbers)

    @property
    def resid(self) -> FloatArray:
        """Weighted residual, rows stacked, shape (nobs,); in the row's unit where there is only one block.

        Raises
        ------
        DataError
            Where a limit of memory did not let it stay, and of an estimate from a file.
        """
        if self.fit.resid is None:
            what = "was not kept: its rows exceed memory_limit_mb, or the estimate is from a file"
            remedy = "identify again, without the limit or with a larger decimation"
            raise DataError.at("resid", what, remedy)
        return self.fit.resid

    @property
    def nobs(self) -> int:
        """Number of rows of the weighted observation matrix."""
        return sum(row.used for row in self.fit.rows if row.weight > 0.0)

    @property
    def condition_number(self) -> float:
        """Condition number of the weighted observation matrix, its columns scaled to unit length."""
        return self.fit.condition_number

    @property
    def delays(self) -> Mapping[str, float]:
        """Delay in s of every force whose delay was estimated; of elastic arms also of sensors."""
        return self.fit.delays

    @property
    def delay_std(self) -> Mapping[str, float]:
        """Standard deviations of `delays` in s."""
        return self.fit.delay_std

    def cov_params(self, kind: str | None = None) -> FloatArray:
        """Return the covariance of `params`, in SI, shape (parameters, parameters).

        `kind` is None for the one behind `bse`, "noise" for the part of it that the residuals explain,
        "printed" for eq. (11), and "periods" for the spread over periods where every record has some.
        """
        found = self.covariances
        kinds = {None: found.total, "noise": found.noise, "printed": found.printed}
        if self.checks.periods is not None:
            kinds["periods"] = np.array(self.checks.periods.covariance)
        return kinds[kind]

    def conf_int(self, alpha: float = 0.05, physical: bool = False) -> Mapping[str, tuple[float, float]]:
        """Return intervals that hold each of `params` with probability 1 - alpha (normal distribution).

        With `physical` those of `physical`: what base parameters are sums and products of.
        """
        told = self.parameters.physical if physical else self.parameters.identified
        return MappingProxyType({entry.name: entry.interval(alpha) for entry in told})

    def modes(self) -> Modes:
        """Return natural frequencies, damping ratios, time constants and antiresonances, with 95 % intervals.

        Linear about rest. Where the records leave a mode open its notes say which parameters it needs.
        """
        return self._modes

    @cached_property
    def _modes(self) -> Modes:
        # zeros of every actuator, responses of whole records: only for those who ask
        if self.source is None:
            return self.modal
        if self.source.model.is_arm:
            return modes_of_arm(self.source.model, self.params, self.cov_params(), self.source.records)
        modal = modes_of_fit(self.source.model, self.source.known)
        return with_peaks(modal, self.source.model, self.source.records)

    def __getstate__(self) -> dict[str, Any]:
        # records are not pickled: what they show of the modes goes along
        return {**vars(self), "modal": self._modes}

    @property
    def verdict(self) -> Verdict:
        """A word (trust, check, measure again), why, and the one thing to do next."""
        return verdict(self)

    def answer(self) -> str:
        """Return the short answer as plain text: parameters, modes, verdict, what to do next."""
        return answer_text(self)

    def summary(self) -> str:
        """Return the whole estimate as plain text."""
        return summary_text(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate in plain types, without the residual; what is not finite becomes None."""
        return estimate_document(self)

    def to_json(self) -> str:
        """Return `to_dict` as JSON, the same for the same estimate."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False) + "\n"

    @classmethod
    def from_dict(cls, document: Mapping[str, Any], where: str = "estimate") -> Self:
        """Return the estimate that `to_dict` gave a document of; `resid` is not in it.

        Raises
        ------
        DataError
            With one problem per mistake, each naming `where` and the key: one that is missing or unknown, of
            another type or size, or that contradicts another one, as a number changed by hand does.
        """
        from modelgen.runtime.results.saved_estimate import estimate_parts

        return cls(**estimate_parts(document, where))

    @classmethod
    def from_json(cls, text: str, where: str = "estimate") -> Self:
        """Return the estimate that `to_json` gave a text of; raises as `from_dict` does."""
        if not isinstance(text, str):
            raise DataError.at(where, f"is of the type {type(text).__name__}", "give the text of an estimate")
        return cls.from_dict(json_document(text, where, ESTIMATE.remedy), where)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Return the estimate in a file of `modelgen identify -o` or `save`; raises as `from_dict`."""
        return cls.from_json(read_text(path, ESTIMATE), str(path))

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write `to_json` to a file, whole or not at all; an existing one is replaced only if asked to."""
        write_whole(Path(path), self.to_json().encode(), overwrite=overwrite)

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
        return answer_html(self) + details

    def __str__(self) -> str:
        return self.answer()

    def __repr__(self) -> str:
        numbers = ", ".join(f"{entry.name}={entry.value:.6g}" for entry in self.parameters.identified)
        return f"Estimate({self.model.chain}, {self.model.sensor_set}, {self.fit.method}: {numbers})"
