"""A chain's TOML file -> ChainSpec: all checks of the file, every mistake reported at once.

Two passes, so that no mistake hides another. First every table is checked by itself (`tables`, the only
place that knows pydantic): what cannot be read is reported and becomes None. Then the references between
tables are checked on what could be read (`references`). If neither pass found a mistake, the draft of the
second one is the ChainSpec.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from fractions import Fraction
from importlib.resources import files
from pathlib import Path, PurePath
from typing import Any

from modelgen.documents import Document
from modelgen.errors import SpecError
from modelgen.number_expression import PI
from modelgen.read_file import SPEC, read_text
from modelgen.spec.chain import GROUND, LINK_ROLES, Body, ChainSpec, Friction, Link, Sensor
from modelgen.spec.references import check_references
from modelgen.spec.spec_file import SpecFile, describes_arm, in_file, spec_file
from modelgen.spec.tables import check_tables
from modelgen.spec.units import Motion
from modelgen.spec.words import shown, suggest


def load_spec(path: str | os.PathLike[str]) -> ChainSpec:
    """Read a chain's TOML file.

    Raises
    ------
    SpecError
        If the file cannot be read or is wrong; one problem for every mistake in it.
    """
    return parse_spec(read_text(path, SPEC), PurePath(path).name)


def parse_spec(text: str, source: str) -> ChainSpec:
    """Read a chain from TOML text; `source` is the name of the file that messages speak of.

    Raises
    ------
    SpecError
        If the text is wrong; one problem for every mistake in it.
    """
    file = spec_file(text, source)
    if describes_arm(file.document):
        what = "describes an arm, and what was asked for takes chains only"
        raise SpecError.at(
            f"{file.source}: arm", what, "give a chain's file, or use modelgen show or load_arm"
        )
    return chain_of(file)


def chain_of(file: SpecFile) -> ChainSpec:
    """Return the chain that a file describes; the errors are those of `parse_spec`."""
    document = file.document
    problems = check_tables(document)
    spec = _draft(document, file.source, file.sha256)
    problems += check_references(document, spec)
    if problems:
        raise in_file(file.source, problems)
    return spec


def catalog_names() -> tuple[str, ...]:
    """Return the names of the example chains that come with modelgen."""
    return tuple(sorted(path.stem for path in _catalog().glob("*.toml")))


def catalog_arms() -> tuple[str, ...]:
    """Return the names of the example arms that come with modelgen."""
    return tuple(sorted(path.stem for path in (_catalog() / "arms").glob("*.toml")))


def catalog_path(name: str) -> Path:
    """Return the TOML file of an example, a chain or an arm; SpecError if there is none of that name."""
    if name in catalog_names():
        return _catalog() / f"{name}.toml"
    if name in catalog_arms():
        return _catalog() / "arms" / f"{name}.toml"
    remedy = suggest(name, (*catalog_names(), *catalog_arms()), "examples")
    raise SpecError.at(shown(name), "is not in the catalogue", remedy)


def _catalog() -> Path:
    return Path(str(files("modelgen") / "catalog"))


def _draft(document: Document, source: str, sha256: str) -> ChainSpec:
    """Build the spec from what is readable; None or an empty tuple stands for what is not."""
    chain: Any = document.get("chain") or {}
    motion: Motion = chain.get("motion") or "rotation"
    sets, sensor_sets = document.get("parameters") or {}, document.get("sensors") or {}
    return ChainSpec(
        name=chain.get("name"),
        title=chain.get("title") or chain.get("name"),
        motion=motion,
        bodies=tuple(_draft_body(table or {}, motion) for table in document.get("bodies") or ()),
        links=_draft_links(document, motion),
        known=_draft_values(document.get("known")),
        parameter_sets={name: _draft_values(values) for name, values in sets.items()},
        sensor_sets={
            name: tuple(_draft_sensor(key, table or {}) for key, table in (sensors or {}).items())
            for name, sensors in sensor_sets.items()
        },
        source=source,
        sha256=sha256,
    )


def _draft_body(table: Document, motion: Motion) -> Body:
    keys = ("name", "inertia", "viscous", "coulomb", "offset", "actuator")
    names: Document = {key: table.get(key) for key in keys}
    friction: Friction = table.get("friction") or "symmetric"
    return Body(**names, friction=friction, motion=table.get("motion") or motion)


def _draft_links(document: Document, motion: Motion) -> tuple[Link, ...]:
    bodies = [table or {} for table in document.get("bodies") or ()]
    motions = {str(table.get("name")): table.get("motion") or motion for table in bodies}
    return tuple(_draft_link(table or {}, motions) for table in document.get("links") or ())


def _draft_link(table: Document, motions: Mapping[str, Motion]) -> Link:
    bodies: Any = tuple(table.get("bodies") or ())
    ratio = _exact(table.get("ratio") or 1)
    if table.get("lead"):  # m of travel a turn: what turns by 2 pi rad moves the other end by one lead
        per_radian = _exact(table["lead"]) / (2 * PI)
        ratio = per_radian if bodies and motions.get(bodies[0]) == "translation" else 1 / per_radian
    if bodies and bodies[0] == GROUND and ratio == 1:
        bodies = bodies[::-1]
    names: Document = {role: table.get(role) for role in LINK_ROLES}
    return Link(bodies, **names, ratio=ratio)


def _exact(value: float | Fraction) -> Fraction:
    return Fraction(str(value))  # the decimal that was written, not its nearest binary


def _draft_sensor(key: str, table: Document) -> Sensor:
    deflection: Any = tuple(table.get("deflection") or ()) or None
    measures: Any = table.get("measures")
    return Sensor(key, table.get("body"), deflection, measures)


def _draft_values(table: Document | None) -> dict[str, float]:
    return {name: float(value) for name, value in (table or {}).items() if value is not None}
