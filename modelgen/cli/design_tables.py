"""Predictions, their confirmation and optimised excitations of `modelgen design`, as values and as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

from rich.console import Group
from rich.text import Text

from modelgen.cli.tables import table
from modelgen.runtime.planning.monte_carlo import Spread, misorders, worst_spread
from modelgen.runtime.planning.sensor_set_ranking import Prediction


def describe(prediction: Prediction) -> dict[str, Any]:
    """Return a prediction as plain values."""
    return {
        "sensor_set": prediction.sensor_set,
        "channels": list(prediction.channels),
        "price": prediction.price,
        "worst_percent": prediction.worst,
        "condition_number": prediction.condition_number,
        "missing": list(prediction.missing),
        "reason": prediction.reason,
        "parameters": {
            p.name: {"std_percent": p.std, "bias_percent": p.bias, "error_percent": p.error}
            for p in prediction.precisions
        },
    }


def describe_monte_carlo(found: Mapping[str, Sequence[Spread]], experiments: int) -> dict[str, Any]:
    """Return the spreads of every set, in the predicted order, and what they make of it, as plain values."""
    found_order = misorders([*found], {name: worst_spread(spreads) for name, spreads in found.items()})
    return {
        "experiments": experiments,
        "sets": {
            name: [{**asdict(s), "error": s.error, "uncertainty": s.uncertainty} for s in spreads]
            for name, spreads in found.items()
        },
        "wrong_order": [list(pair) for pair in found_order.wrong],
        "ties": [list(pair) for pair in found_order.ties],
    }


def design_tables(described: Mapping[str, Any]) -> Group:
    """Lay out what was predicted, confirmed and optimised."""
    names = list(dict.fromkeys(name for entry in described["sets"] for name in entry["parameters"]))
    columns = ("sensors", ">price", ">worst %", *(f">{name} %" for name in names))
    rows, notes = [], []
    for entry in described["sets"]:
        errors = [entry["parameters"].get(name, {}).get("error_percent") for name in names]
        shown = ["-" if error is None else f"{error:.3g}" for error in errors]
        rows.append((entry["sensor_set"], f"{entry['price']:g}", f"{entry['worst_percent']:.3g}", *shown))
        notes += [Text(f"{entry['sensor_set']}: {entry['reason']}")] if entry["reason"] else []
        notes += [
            Text(f"{entry['sensor_set']}: {cure}") for cure in described["cures"].get(entry["sensor_set"], ())
        ]
    notes += [Text(f"{name}: {reason}") for name, reason in described["refused"].items()]
    title = f"Predicted relative errors ({described['method']}), most precise first"
    wanted = f"{described['wanted_percent']:g} %"
    cheapest = described["cheapest"]
    verdict = f"cheapest within {wanted}: {cheapest}" if cheapest else f"no set reaches {wanted}"
    ranking = table(title, columns, rows)
    # a set is known by its name: numbers may wrap before it is cut
    ranking.columns[0].min_width = max(len(entry["sensor_set"]) for entry in described["sets"])
    parts: list[Any] = [ranking, Text(""), Text(verdict), *notes]
    if "monte_carlo" in described:
        parts += [Text(""), *_confirmed(described["monte_carlo"])]
    if "excitation" in described:
        parts += [Text(""), *_optimised(described["excitation"])]
    return Group(*parts)


def _confirmed(found: Mapping[str, Any]) -> list[Any]:
    columns = ["sensors", "parameter", ">std %", ">predicted", ">bias %", ">predicted", ">error %", ">+-"]
    keys = ("std", "predicted_std", "bias", "predicted_bias", "error", "uncertainty")
    rows = [
        (name, s["name"], *(f"{s[key]:.3g}" if isfinite(s[key]) else "-" for key in keys))
        for name, spreads in found["sets"].items()
        for s in spreads
    ]
    title = f"Monte Carlo: {found['experiments']} experiments, identified one by one"
    parts: list[Any] = [table(title, columns, rows)]
    if len(found["sets"]) > 1:
        wrong, ties = (
            ", ".join(" and ".join(pair) for pair in found[key]) for key in ("wrong_order", "ties")
        )
        parts.append(
            Text(f"in the wrong order: {wrong or 'none'}; cannot be distinguished: {ties or 'none'}")
        )
    return parts


def _optimised(found: Mapping[str, Any]) -> list[Any]:
    rows = [
        (name, f"{e['pair_percent']:.3g}", f"{e['optimised_percent']:.3g}")
        for name, e in found["parameters"].items()
    ]
    limits = ", ".join(
        f"{key} {found['reached'][key]:.4g} of {value:.4g}" for key, value in found["limits"].items()
    )
    line = f"largest error {found['worst_percent']:.3g} % instead of {found['pair_worst_percent']:.3g} %"
    return [
        table(
            f"Optimised excitation against chirp and trapezoid ({found['method']})",
            ("parameter", ">pair %", ">optimised %"),
            rows,
        ),
        Text(f"{line}: {found['gain']:.2f} times better"),
        Text(f"peaks within the limits: {limits}"),
        *(Text(f"wrote {path}") for path in found["written"]),
    ]
