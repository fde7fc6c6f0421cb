"""One way in for all that can be identified: a TOML file is a chain or an arm by its tables."""

from __future__ import annotations

import os
from pathlib import Path

from modelgen.read_file import SPEC, read_text
from modelgen.spec.arms.arm import ArmSpec
from modelgen.spec.arms.load import arm_of
from modelgen.spec.chain import ChainSpec
from modelgen.spec.load import chain_of
from modelgen.spec.spec_file import describes_arm, spec_file


def load_description(path: str | os.PathLike[str]) -> ChainSpec | ArmSpec:
    """Read a TOML file that describes a chain ([chain]) or an arm ([arm]).

    Raises
    ------
    SpecError
        If the file cannot be read or is wrong; one problem for every mistake in it.
    """
    return parse_description(read_text(path, SPEC), str(path), Path(path).parent)


def parse_description(text: str, source: str, folder: Path | None = None) -> ChainSpec | ArmSpec:
    """Read a chain or an arm from TOML text; `folder` is where a URDF is looked for.

    Raises
    ------
    SpecError
        If the text is wrong; one problem for every mistake in it.
    """
    file = spec_file(text, source)
    return arm_of(file, folder) if describes_arm(file.document) else chain_of(file)
