"""`estimate.plot`: curves of an estimate with their 95 % intervals. Each method returns its axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any

from modelgen.errors import DataError
from modelgen.runtime.curves.rebuilt import Rebuilt, autocorrelation, rebuild, used_records
from modelgen.runtime.curves.responses import responses
from modelgen.runtime.curves.subject import model_of, records_of
from modelgen.runtime.model.model import Model
from modelgen.runtime.plots.axes import VERBATIM, drawn, panels
from modelgen.runtime.plots.parameter_plots import chosen_names, draw_parameter, named_estimates
from modelgen.runtime.plots.response_plots import HEIGHTS, draw_measured, draw_modelled, label_axes
from modelgen.runtime.plots.row_plots import draw_autocorrelation, draw_residual, draw_row
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate

AnyModel = Model | ModuleType | None


class EstimatePlots:
    """Plots of an estimate.

    The model and the records are those that it was made from. An estimate that was loaded or came from
    another process holds neither: `model` and `records` are to be given then.
    """

    def __init__(self, estimate: Estimate) -> None:
        self._estimate = estimate

    def bode(
        self,
        record: Record | None = None,
        output: str | None = None,
        input: str | None = None,
        axes: Any = None,
        model: AnyModel = None,
    ) -> Any:
        """Draw the measured and modelled frequency response over the frequency in Hz.

        The band of the model is what the covariance of the estimate makes of it. Coulomb friction and cubic
        springs enter with what they are at the record's amplitude (harmonic balance), and the legend says so.

        Parameters
        ----------
        record : Record, optional
            By default the first of those identified from.
        output, input : str, optional
            Sensor and actuator; by default the first of each that the record has.
        axes : sequence of three Axes, optional
            For magnitude, phase and coherence; by default those of a new figure.
        model : Model or module, optional

        Returns
        -------
        array of Axes

        Raises
        ------
        DataError
            When a name is unknown, model or records are to be given, or matplotlib is not installed.
        """
        known = model_of(self._estimate, model)
        record = records_of(self._estimate, record)[0]
        keys = [s.key for s in known.sensors if s.key in record.signals]
        wanted = output if output is not None else next(iter(keys), None)
        if wanted is None:
            raise DataError.at(record.name, "has no sensor of the model", "give a record with its channels")
        pair = responses(known, record, self._estimate, [wanted], input)[0]
        axes = panels(axes, 3, HEIGHTS)
        draw_measured(axes, pair.measured)
        draw_modelled(axes, pair.modelled)
        label_axes(axes, pair.title, pair.modelled.unit)
        axes[0].legend(frameon=False, fontsize=8)
        if pair.modelled.notes:
            axes[0].set_title("; ".join(pair.modelled.notes), loc="right", fontsize=7, **VERBATIM)
        return drawn(axes)

    def fit(
        self, records: Record | Sequence[Record] | None = None, axes: Any = None, model: AnyModel = None
    ) -> Any:
        """Draw every row on every record over time in s: measured, rebuilt by the estimate, their difference.

        Parameters
        ----------
        records : Record or sequence of Record, optional
            Of the names that the estimate was made from; by default those records.
        axes : Axes or sequence of Axes, optional
            One a row and record; by default those of a new figure.
        model : Model or module, optional

        Returns
        -------
        Axes, or array of Axes

        Raises
        ------
        DataError
            When records or model are to be given, or matplotlib is not installed.
        """
        rows = self._rows(records, model)
        axes = panels(axes, len(rows), sharex=False)
        for axis, row in zip(axes, rows, strict=True):
            draw_row(axis, row)
        axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, fontsize=8)
        return drawn(axes)

    def residuals(
        self, records: Record | Sequence[Record] | None = None, axes: Any = None, model: AnyModel = None
    ) -> Any:
        """Draw what the fit leaves of every row over time in s, and its autocorrelation over the lag in ms.

        The band is the 99 % bound of a white residual; filtering alone correlates neighbours. Parameters,
        result and errors as those of `fit`, with two axes a row and record.
        """
        rows = self._rows(records, model)
        axes = panels(axes, 2 * len(rows), sharex=False, columns=2)
        for place, row in enumerate(rows):
            draw_residual(axes[2 * place], row)
            draw_autocorrelation(axes[2 * place + 1], autocorrelation(row.residual, row.step_s))
        return drawn(axes)

    def parameters(
        self,
        others: Estimate | Sequence[Estimate] | Mapping[str, Estimate] = (),
        names: Sequence[str] | None = None,
        axes: Any = None,
        alpha: float = 0.05,
    ) -> Any:
        """Draw parameters with their intervals, those of several estimates side by side, in their units.

        Parameters
        ----------
        others : Estimate, sequence of Estimate, or mapping of name to Estimate
            To be compared with this one.
        names : sequence of str, optional
            Parameters; by default the physical ones, or the base ones where there are none.
        axes : Axes or sequence of Axes, optional
            One a parameter; by default those of a new figure.
        alpha : float
            The intervals hold the truth with probability 1 - alpha.

        Returns
        -------
        Axes, or array of Axes

        Raises
        ------
        DataError
            For a name that no estimate has, another number of axes, or without matplotlib.
        """
        if not 0.0 < alpha < 1.0:
            raise DataError.at("alpha", f"is {alpha!r}", "give a probability, 0.05 for 95 % intervals")
        estimates = named_estimates(self._estimate, others)
        wanted = chosen_names(estimates, names)
        heights = [0.25 + 0.12 * len(estimates)] * len(wanted)
        axes = panels(axes, len(wanted), heights, sharex=False)
        for axis, name in zip(axes, wanted, strict=True):
            draw_parameter(axis, name, estimates, alpha)
        axes[0].set_title(f"{100.0 * (1.0 - alpha):g} % intervals", loc="left", fontsize=10)
        return drawn(axes)

    def _rows(self, records: Record | Sequence[Record] | None, model: AnyModel) -> list[Rebuilt]:
        known, given = model_of(self._estimate, model), records_of(self._estimate, records)
        used = used_records(known, given, self._estimate)
        if not used:
            names = ", ".join(self._estimate.records)
            what = f"are none of those that it was identified from: {names}"
            raise DataError.at("records", what, "give these; bode and compare take any")
        return rebuild(known, used, self._estimate)[0]
