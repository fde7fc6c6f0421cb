"""An arm's TOML file, and the URDF that it may name -> ArmSpec: every mistake of both reported at once."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from modelgen.errors import Problem, SpecError
from modelgen.read_file import SPEC, URDF, read_text
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.arms.draft import draft_arm
from modelgen.spec.arms.references import check_arm, check_size
from modelgen.spec.arms.tables import FORM
from modelgen.spec.arms.urdf.read_urdf import described_arm
from modelgen.spec.spec_file import SpecFile, describes_arm, in_file, spec_file
from modelgen.spec.table_checks import mistakes_of


def load_arm(path: str | os.PathLike[str]) -> ArmSpec:
    """Read an arm's TOML file; a URDF that it names is looked for in the same folder.

    Raises
    ------
    SpecError
        If a file cannot be read or is wrong; one problem for every mistake in it.
    """
    return parse_arm(read_text(path, SPEC), str(path), Path(path).parent)


def parse_arm(text: str, source: str, folder: Path | None = None) -> ArmSpec:
    """Read an arm from TOML text; `folder` is where a URDF is looked for, none where there is no such place.

    Raises
    ------
    SpecError
        If the text is wrong; one problem for every mistake in it.
    """
    file = spec_file(text, source)
    if not describes_arm(file.document):
        what = "is missing, and what was asked for takes arms only"
        raise SpecError.at(f"{file.source}: arm", what, "write [arm]; load_spec reads chains")
    return arm_of(file, folder)


def arm_of(file: SpecFile, folder: Path | None) -> ArmSpec:
    """Return the arm that a file describes; the errors are those of `parse_arm`."""
    document = file.document
    problems = mistakes_of(document, FORM)
    urdf = (document.get("arm") or {}).get("urdf")
    described, sha256 = None, file.sha256
    if urdf is not None:
        fixed = {
            str(table.get("name"))
            for table in document.get("joints") or ()
            if table is not None and table.get("type") == "fixed"
        }
        content = _urdf_text(file, folder, urdf, problems)
        described, found = described_arm(content, Path(urdf).name, fixed)
        sha256 = hashlib.sha256(f"{sha256}{content}".encode()).hexdigest()
        if found:  # what the tables say of joints that were not read is no mistake
            raise SpecError(*in_file(file.source, problems).problems, *found)
    too_many = [*check_size(document, described)]
    if too_many:
        raise in_file(file.source, [*problems, *too_many])
    spec = draft_arm(document, file.source, sha256, described)
    problems += check_arm(document, spec, described)
    if problems:
        raise in_file(file.source, problems)
    return spec


def _urdf_text(file: SpecFile, folder: Path | None, urdf: str, problems: list[Problem]) -> str:
    if folder is None:
        what = "names a file, and this text is in no folder"
        raise in_file(file.source, [*problems, Problem("arm.urdf", what, "use load_arm")])
    try:
        return read_text(folder / urdf, URDF)
    except SpecError as error:
        raise SpecError(*in_file(file.source, problems).problems, *error.problems) from error
