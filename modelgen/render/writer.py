"""Modules as text and as files: generate, write, and compare with what is already there."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, NamedTuple

from modelgen.atomic_write import check_place, make_folder, place_within, write_whole
from modelgen.errors import Problem, RenderError
from modelgen.generated_module.allow_list import REMEDY
from modelgen.generated_module.module_check import has_header, module_problems, module_text, seal
from modelgen.read_file import GENERATED, read_bytes, read_text
from modelgen.render.environment import environment
from modelgen.render.view import ModelView, model_view
from modelgen.spec.load import ChainSpec
from modelgen.symbolic.pipeline import build


class Drift(NamedTuple):
    """A module in a folder that is not what its spec generates."""

    path: Path
    state: Literal["missing", "different", "left over"]


def render(view: ModelView) -> str:
    """Return the text of a module, with its digest in the header.

    Raises
    ------
    RenderError
        If the text is not one that modelgen would execute (`modelgen.generated_module.module_check`): it is
        never written.
    """
    fields = {field.name: getattr(view, field.name) for field in dataclasses.fields(view)}
    text = environment().get_template("module.py.j2").render(fields)
    return sealed_module(text, f"module {view.chain}_{view.sensor_set}")


def sealed_module(text: str, name: str) -> str:
    """Return the text of a module with its digest.

    Raises
    ------
    RenderError
        If it is not one that modelgen would execute; `name` says which it is.
    """
    text = seal(text)
    problems = module_problems(text)
    if problems:
        remedies = {REMEDY: "report what it was made from: modelgen must not write such a module"}
        raise RenderError(
            *(Problem(f"{name}, {p.where}", p.what, remedies.get(p.remedy, p.remedy)) for p in problems)
        )
    return text


def generate(spec: ChainSpec, sensor_set: str) -> str:
    """Return the text of the module for one sensor set of a chain.

    Parameters
    ----------
    spec : ChainSpec
        The chain, see `modelgen.load_spec`.
    sensor_set : str
        Name of a table ``[sensors.NAME]`` of the spec.

    Returns
    -------
    str
        Source of a NumPy-only module; the same spec gives the same bytes.
    """
    return render(model_view(build(spec, sensor_set)))


def module_name(spec: ChainSpec, sensor_set: str) -> str:
    """Return the name of the module of a sensor set, without .py."""
    return f"{spec.name}_{sensor_set}"


def write_modules(
    spec: ChainSpec, sensor_sets: Iterable[str], folder: Path, overwrite: bool = False
) -> list[Path]:
    """Write one module per sensor set; derive them all before the first file is touched.

    Raises
    ------
    RenderError
        If a file of that name exists that modelgen did not write, unless it may be overwritten.
    ModelgenError
        If the place is a link or no regular file, or the folder cannot be made or written.
    """
    texts = {
        place_within(folder, f"{module_name(spec, name)}.py"): generate(spec, name) for name in sensor_sets
    }
    for path in texts:
        check_place(path)
        if not overwrite and path.exists() and not _is_generated(path):
            raise RenderError.at(
                str(path),
                "exists and was not written by modelgen",
                "move it away or choose another folder with -o",
            )
    make_folder(folder)
    for path, text in texts.items():
        write_whole(path, text.encode(), overwrite=True)
    return list(texts)


def _is_generated(path: Path) -> bool:
    try:
        return has_header(module_text(read_text(path, GENERATED)))
    except RenderError:
        return False


def _is_of_chain(path: Path, chain: str) -> bool:
    text = read_bytes(path, GENERATED).decode("utf-8", errors="replace")
    return f'\nCHAIN = "{chain}"\n' in text or f"\nCHAIN = '{chain}'\n" in text


def check_modules(spec: ChainSpec, sensor_sets: Iterable[str], folder: Path) -> list[Drift]:
    """Compare a folder with what the spec generates; modules of sensor sets that are gone are left over."""
    drifts = []
    for name in sensor_sets:
        path = folder / f"{module_name(spec, name)}.py"
        if not path.is_file():
            drifts.append(Drift(path, "missing"))
        elif read_bytes(path, GENERATED) != generate(spec, name).encode():
            drifts.append(Drift(path, "different"))
    expected = {f"{module_name(spec, name)}.py" for name in spec.sensor_sets}
    for path in sorted(folder.glob(f"{spec.name}_*.py")):
        if path.name not in expected and path.is_file() and _is_of_chain(path, spec.name):
            drifts.append(Drift(path, "left over"))
    return drifts
