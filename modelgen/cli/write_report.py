"""identify --report: one HTML page from an estimate, with all sensor sets of the chain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modelgen.cli.arguments import compared_sensor_sets, load_chain_or_arm
from modelgen.errors import ModelgenError
from modelgen.report.arm_drawing import arm_section
from modelgen.report.page import report_page
from modelgen.report.unmade import Unmade
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.chain import ChainSpec
from modelgen.spec.description import load_description
from modelgen.spec.load import catalog_path

if TYPE_CHECKING:
    from modelgen.cli.sensor_sets.identified import Identified
    from modelgen.runtime.model.model import Model
    from modelgen.runtime.simulation.validation import Validation


def report_text(
    found: Identified,
    module: Path,
    options: Mapping[str, Any],
    spec: str | None,
    controller: Path | None,
) -> str:
    """Return the report as the text of one HTML page.

    `spec` names the chain, which is otherwise looked for by its name and hash; with a `controller` the
    records' closed loop is simulated and laid over what was measured. What cannot be made has a sentence in
    its place.
    """
    given = {name: str(value) for name, value in options.items() if value not in (None, (), [])}
    unmade = Unmade()
    loops: tuple[Validation, ...] = ()
    if controller:
        loops = unmade.attempt("loop", lambda: closed_loops(found, controller), loops)
    if found.joint is not None:
        from modelgen.cli.sensor_sets.joint_page import joint_page

        return joint_page(found.joint, given, loops, unmade)
    (model,), readings, estimate = found.models.values(), found.readings, found.estimate
    described = load_chain_or_arm(spec) if spec else _spec_of(model, module)
    sets: Sequence[Mapping[str, Any]] = ()
    picture = None
    if isinstance(described, ChainSpec):
        chain = described
        sets = unmade.attempt("sensors", lambda: sensor_set_rows(chain), ())
    elif described is not None:
        picture = arm_section(described)
    return report_page(model, readings, estimate, given, sets, loops, unmade, picture)


def check_inputs(spec: str | None, controller: Path | None, arm: bool) -> None:
    """Read what a report is to be made with, before the work; raises as `report_text` would after it."""
    from modelgen.runtime.simulation.arms.joint_controller import load_joint_controller
    from modelgen.runtime.simulation.controller_file import load_controller

    if spec:
        load_chain_or_arm(spec)
    if controller and arm:
        load_joint_controller(controller)
    elif controller:
        load_controller(controller)


def closed_loops(found: Identified, controller: Path) -> tuple[Validation, ...]:
    """Return the records' closed loops, measured and simulated with the parameters of the answer."""
    from modelgen.runtime.simulation.arms.joint_controller import load_joint_controller
    from modelgen.runtime.simulation.arms.validate_arm import validate_arm
    from modelgen.runtime.simulation.controller_file import load_controller
    from modelgen.runtime.simulation.validate import parameters_of, validate

    loops: list[Validation] = []
    for _, model, records, _ in found.alone():
        parameters, used = parameters_of(found.estimate, model), found.estimate.identified_from
        if model.is_arm:
            loops += validate_arm(model, parameters, records, load_joint_controller(controller), used=used)
        else:
            loop, drive = load_controller(controller)
            loops += validate(model, parameters, records, loop, drive=drive, used=used)
    return tuple(loops)


def sensor_set_rows(chain: ChainSpec) -> list[dict[str, str]]:
    """Return one row of texts a sensor set: name, rows, order, identifiable, lost."""
    rows = []
    for summary in compared_sensor_sets(chain, None):
        row = {"name": summary.name, "rows": "none", "order": "", "identifiable": summary.reason}
        if summary.model is not None:
            derived = summary.model.rows.rows
            row["rows"] = ", ".join(entry.name + "'" * entry.differentiated for entry in derived)
            row["order"] = str(max(entry.order for entry in derived))
            row["identifiable"] = ", ".join(summary.model.identifiable) or "none"
        rows.append({**row, "lost": ", ".join(summary.lost) or "–"})
    return rows


def _spec_of(model: Model, module: Path) -> ChainSpec | ArmSpec | None:
    """Return what a module was generated from, if its file is near or in the catalogue, unchanged."""
    candidates = [folder / f"{model.chain}.toml" for folder in (module.parent, module.parent.parent, Path())]
    with suppress(ModelgenError):
        candidates.append(catalog_path(model.chain))
    for path in candidates:
        try:
            chain = load_description(path)
        except (ModelgenError, OSError):
            continue
        if chain.sha256 == model.spec_sha256:
            return chain
    return None
