"""Model, readings and estimate -> the text of one HTML page.

The page carries everything it shows. Its policy allows the one script that is this program's own, by its
hash, and no connection at all: a name in the data that looks like a script remains text.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

import modelgen
from modelgen.report.chain_drawing import chain_section
from modelgen.report.html import rendered
from modelgen.report.mathml import row_equations, symbol
from modelgen.report.plots import (
    autocorrelation_plot,
    correlation_plot,
    filter_reach_ms,
    response_plots,
    singular_value_plot,
    whiteness,
    zoomable,
)
from modelgen.report.scan_plot import scan_plots
from modelgen.report.unmade import Unmade
from modelgen.runtime.curves.rebuilt import Rebuilt, autocorrelation, rebuild, used_records
from modelgen.runtime.curves.responses import moving_forces, responses
from modelgen.runtime.curves.subject import model_of
from modelgen.runtime.model.model import Model
from modelgen.runtime.modes.modes import posture_ranges
from modelgen.runtime.parameters.grouped_reasons import grouped_reasons
from modelgen.runtime.parameters.parameter import Parameter
from modelgen.runtime.records.read_record import Reading
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.answer import asked_for
from modelgen.runtime.results.check_tables import check_tables
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.results.summary import INTERVAL_KINDS
from modelgen.runtime.simulation.validation import Validation

Description = dict[str, Any]


def report_page(
    model: Model,
    readings: Sequence[Reading | Record],
    estimate: Estimate,
    options: Mapping[str, str] | None = None,
    sensor_sets: Sequence[Mapping[str, Any]] = (),
    validations: Sequence[Validation] = (),
    unmade: Mapping[str, str] | None = None,
    picture: str | None = None,
) -> str:
    """Return the report as HTML; the same inputs give the same bytes.

    Parameters
    ----------
    model : Model
    readings : sequence of Reading or Record
        What the estimate was identified from, in that order.
    estimate : Estimate
    options : mapping of str to str, optional
        What the user asked for, listed as it is given.
    sensor_sets : sequence of mapping, optional
        The chain's sensor sets side by side: name, rows, order, identifiable, lost, as texts.
    validations : sequence of Validation, optional
        Closed loops, measured and simulated.
    unmade : mapping of str to str, optional
        Ids of sections that could not be made, with a sentence to stand in their place.
    picture : str, optional
        That of an arm, see `modelgen.report.arm_drawing.arm_section`; a chain's is made from its model.
    """
    left = Unmade(unmade or {})
    records = [item.record if isinstance(item, Reading) else item for item in readings]
    model = model_of(estimate, model)
    rows, singular = rebuild(model, records, estimate)
    return rendered(
        "report.html.j2",
        zoomable(rows, validations),
        title=str(estimate.model),
        picture=Markup(left.attempt("chain", lambda: _picture(model, picture), "")),
        estimate=estimate,
        model=model,
        verdict=estimate.verdict,
        asked=asked_for(estimate),
        refused=grouped_reasons(estimate.unanswered),
        modes=estimate.modes(),
        ranges=posture_ranges(estimate.modes()),
        row_plots=len(rows),
        equations=row_equations(model),
        symbols={name: symbol(name) for name in (*model.base_parameters, *model.parameters)},
        interval=estimate.conf_int(),
        physical=_physical_rows(estimate),
        interval_kind=INTERVAL_KINDS[estimate.fit.covariance_kind],
        sensor_sets=sensor_sets,
        residuals=left.attempt("residuals", lambda: _residuals(model, rows, estimate, records), []),
        checks=check_tables(estimate.checks),
        scans=left.attempt("checks", lambda: scan_plots(estimate.checks.scan), []),
        frequency=()
        if model.is_arm  # it depends on the posture
        else left.attempt("frequency", lambda: _frequency(model, records, estimate), []),
        correlation=left.attempt("conditioning", lambda: correlation_plot(estimate), None),
        singular=left.attempt("conditioning", lambda: singular_value_plot(singular), None),
        unmade=left,
        singular_values=[f"{value:.4g}" for value in singular],
        readings=[_reading(item) for item in readings],
        validations=validations,
        provenance=_provenance(model, estimate, options or {}),
    )


def _picture(model: Model, given: str | None) -> str:
    """Return the picture, or the sentence that says why there is none."""
    if given is not None:
        return given
    if model.is_arm:
        return "<p>The arm's file was not at hand to draw it: give it with --spec.</p>"
    return chain_section(model)


def _physical_rows(estimate: Estimate) -> Sequence[Parameter]:
    """Return the physical parameters, unless they would repeat the base parameters."""
    if all(entry.name in estimate.params for entry in estimate.parameters.physical):
        return ()
    return estimate.parameters.physical


def _residuals(
    model: Model, rows: Sequence[Rebuilt], estimate: Estimate, records: Sequence[Record]
) -> list[Description]:
    fs_of = {record.name: record.fs for record in used_records(model, records, estimate)}
    found = []
    for row in rows:
        residual = row.residual
        correlation = autocorrelation(residual, row.step_s)
        if correlation is None:
            continue
        found.append(
            {
                "name": f"{row.record}, row {row.row}",
                "plot": autocorrelation_plot(row, correlation),
                "outside": whiteness(correlation),
                "reach_ms": filter_reach_ms(estimate, fs_of[row.record]),
            }
        )
    return found


def _frequency(model: Model, records: Sequence[Record], estimate: Estimate) -> list[Description]:
    return [
        {
            "name": f"{pair.title}: {pair.modelled.label}",
            "notes": pair.modelled.notes,
            "plots": response_plots(pair, estimate),
        }
        for record in records
        if moving_forces(model, record)
        for pair in responses(model, record, estimate)
    ]


def _reading(item: Reading | Record) -> Description:
    record = item.record if isinstance(item, Reading) else item
    said = item if isinstance(item, Reading) else None
    return {
        "name": record.name,
        "tag": record.tag,
        "fs": record.fs,
        "n": record.n,
        "duration_s": record.duration_s,
        "channels": list(record.signals),
        "took": list(said.took) if said else [],
        "findings": [finding.what for finding in said.findings] if said else [],
        "mended": list(said.mended) if said else [],
    }


def _provenance(model: Model, estimate: Estimate, options: Mapping[str, str]) -> list[tuple[str, str]]:
    import scipy

    filtering = estimate.fit.filtering
    return [
        ("chain", f"{estimate.model.chain}: {model.title}"),
        ("sensor set", estimate.model.sensor_set),
        ("SHA-256 of the spec", model.spec_sha256),
        ("modelgen", modelgen.__version__),
        ("Python, NumPy, SciPy", f"{platform.python_version()}, {np.__version__}, {scipy.__version__}"),
        ("method", f"{estimate.fit.method}: {estimate.fit.method_title}"),
        ("filter order, cut-off", f"{filtering.filter_order}, {filtering.cutoff_hz:.6g} Hz"),
        ("cut-off of directions", f"{filtering.direction_cutoff_hz:.6g} Hz"),
        ("decimation", ", ".join(str(factor) for factor in filtering.decimation)),
        *((name, text) for name, text in options.items()),
    ]
