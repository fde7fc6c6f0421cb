"""identify --report of several sensor sets: one page with their answer, and what each says alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from modelgen.cli.result_pages.printed_parts import intervals_of, parts_of

if TYPE_CHECKING:
    from modelgen.runtime.joining.joint_estimate import JointEstimate
    from modelgen.runtime.simulation.validation import Validation


def joint_page(
    joint: JointEstimate,
    options: Mapping[str, str],
    loops: Sequence[Validation] = (),
    unmade: Mapping[str, str] | None = None,
) -> str:
    """Return the page of an answer from several sensor sets: the answer, and what each set says.

    `loops` are the records in closed loop, simulated with the answer; `unmade` says why a part is lacking.
    """
    from modelgen.cli.tables import table
    from modelgen.report.result_page import result_page

    sources = {"together": joint.estimate, **joint.parts}
    names = [entry.name for entry in joint.estimate.parameters.identified]
    rows = [(name, *(_interval_text(one, name) for one in sources.values())) for name in names]
    columns = ("parameter", *(f">{title}" for title in sources))
    printed = [
        joint.estimate.answer(),
        table("Values with 95 % intervals, all sensor sets and each alone", columns, rows),
        *([] if joint.agreement is None else [joint.agreement.sentence]),
        *(part for title, one in joint.parts.items() for part in (_heading(title), one.answer())),
        *(f"Sensors {title}: no part in the answer: {why}" for title, why in joint.failed.items()),
        *(f"Closed loop: {why}" for part, why in (unmade or {}).items() if part == "loop"),
    ]
    return result_page(
        str(joint.estimate.model),
        "modelgen identify",
        parts_of(printed),
        options,
        intervals_of(sources),
        loops,
    )


def _heading(title: str) -> Any:
    from rich.text import Text

    return Text(f"Sensors {title} alone", style="bold")


def _interval_text(estimate: Any, name: str) -> str:
    from modelgen.runtime.results.answer import plus_minus

    entries = (*estimate.parameters.identified, *estimate.parameters.physical)
    return next((plus_minus(entry) for entry in entries if entry.name == name), "-")
