"""What `modelgen design` says of a trajectory: plain values, and tables."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.text import Text

from modelgen.cli.arms.design_elastic import prediction_tables
from modelgen.cli.tables import Description, table
from modelgen.runtime.planning.arms.exciting_trajectory import ExcitingTrajectory
from modelgen.runtime.planning.arms.fast_excitation import FastExcitation
from modelgen.spec.arms.arm import ArmSpec


def trajectory_described(arm: ArmSpec, found: ExcitingTrajectory, criterion: str) -> Description:
    """Return a trajectory as plain values."""
    bounds, moving = found.bounds, {joint.name: joint for joint in arm.moving}
    return {
        "arm": arm.name,
        "criterion": criterion,
        "period_s": found.trajectory.period_s,
        "harmonics": found.trajectory.harmonics,
        "condition_number": found.condition,
        "information": found.information,
        "searches": [{"start": a, "end": b} for a, b in found.costs],
        "joints": [
            {
                "name": name,
                "unit": "rad" if moving[name].kind == "revolute" else "m",
                "position": [float(bounds.lower[k]), float(bounds.upper[k])],
                "position_limits": list(moving[name].position_limits or ()),
                "speed": float(bounds.speed[k]),
                "speed_limit": moving[name].speed_limit,
                "acceleration": float(bounds.acceleration[k]),
                "acceleration_limit": moving[name].acceleration_limit,
                "offset": float(found.trajectory.offsets[k]),
                "sines": found.trajectory.sines[k].tolist(),
                "cosines": found.trajectory.cosines[k].tolist(),
            }
            for k, name in enumerate(found.joints)
        ],
        "boxes": [{"box": box.text, "clearance_m": room} for box, room in found.boxes],
    }


def fast_described(second: FastExcitation, path: Path | None) -> Description:
    """Return the second stage as plain values."""
    bounds = second.bounds
    return {
        "band_hz": list(second.band_hz),
        "written": None if path is None else str(path),
        "position": (0.5 * (bounds.upper - bounds.lower)).tolist(),
        "speed": bounds.speed.tolist(),
        "acceleration": bounds.acceleration.tolist(),
    }


def trajectory_tables(described: Description) -> Group:
    """Lay out a trajectory, and of an elastic arm its second stage and what sensor sets would find."""
    period, count = described["period_s"], described["harmonics"]
    head = (
        f"Exciting trajectory of {described['arm']}: {period:g} s, {count} harmonics of {1 / period:.4g} Hz "
        f"(up to {count / period:.4g} Hz), beginning and ending at rest"
    )
    rows = []
    for joint in described["joints"]:
        (low, high), (least, most), unit = joint["position"], joint["position_limits"], joint["unit"]
        rows.append(
            (
                joint["name"],
                f"{low:.3f} to {high:.3f} {unit} (of {least:.3f} to {most:.3f})",
                _of(joint["speed"], joint["speed_limit"], f"{unit}/s"),
                _of(joint["acceleration"], joint["acceleration_limit"], f"{unit}/s^2"),
            )
        )
    columns = ("joint", "position", "speed", "acceleration")
    ends = sorted(search["end"] for search in described["searches"] if search["end"] is not None)
    tried, sign = len(described["searches"]), 1 if described["criterion"] == "condition" else -1
    what = "condition numbers" if sign > 0 else "mean singular values"
    lines = [
        f"condition number of the base regressor {described['condition_number']:.3g}",
        f"{len(ends)} of {tried} searches found one, with {what} of "
        f"{exp(sign * ends[0]):.3g} to {exp(sign * ends[-1]):.3g}",
        "none of these bounds is exceeded at any time, between samples neither",
    ]
    lines += [f"{one['box']}: kept, by {one['clearance_m']:.3g} m at least" for one in described["boxes"]]
    if "written" in described:
        written, fs = described["written"], described["fs_hz"]
        lines.append(
            f"wrote {written}: t, q, d1_q, d2_q of one period at {fs:g} Hz; bring the arm to its first row"
        )
    else:
        lines.append("--optimise FILE.csv writes it")
    title = "What the joints never exceed (and their limits)"
    parts: list[Any] = [Text(head), Text(""), table(title, columns, rows), Text(""), *map(Text, lines)]
    if "fast" in described:
        fast = described["fast"]
        parts += [Text(""), Text(_fast_line(described["joints"], fast)), Text("")]
        parts += [prediction_tables(described["predicted"])]
    return Group(*parts)


def _fast_line(joints: Sequence[Description], fast: Description) -> str:
    """Return what the second stage is."""
    sizes = zip(joints, fast["position"], fast["speed"], strict=True)
    moves = ", ".join(
        f"{one['name']} {size:.2g} {one['unit']} at {speed:.2g} {one['unit']}/s" for one, size, speed in sizes
    )
    low, high = fast["band_hz"]
    kept = f"wrote {fast['written']}" if fast["written"] else "--optimise FILE.csv writes it, FILE_fast.csv"
    return f"Second stage, {low:.3g} to {high:.3g} Hz about the modes, to either side {moves}; {kept}"


def _of(value: float, limit: float | None, unit: str) -> str:
    return f"{value:.3g} {unit}" + ("" if limit is None else f" (of {limit:.3g})")
