"""First pass over a chain's file: every table by itself, with messages in the terms of mechanics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated

from pydantic import BeforeValidator, Field

from modelgen.documents import Document
from modelgen.errors import Problem
from modelgen.number_expression import exact_number
from modelgen.spec.chain import Friction
from modelgen.spec.table_checks import (
    FileForm,
    Name,
    NonzeroNumber,
    Number,
    Table,
    Title,
    mistakes_of,
    unreadable,
)
from modelgen.spec.units import Measures, Motion


def _pair(value: object) -> object:
    if not (isinstance(value, list) and len(value) == 2 and all(isinstance(item, str) for item in value)):
        raise unreadable("a list of two names")
    return value


_Pair = Annotated[list[str], BeforeValidator(_pair)]


class _ChainTable(Table):
    name: Name = Field(description='name = "my_axis"')
    title: Title | None = Field(None, description='title = "My axis"')
    motion: Motion = Field(description='motion = "rotation"')


class BodyTable(Table):
    """A table [[bodies]]."""

    name: Name = Field(description='name = "m"')
    inertia: Name = Field(description='inertia = "J_m"')
    viscous: Name | None = Field(None, description='viscous = "F_vm"')
    coulomb: Name | None = Field(None, description='coulomb = "F_sm"')
    offset: Name | None = Field(None, description='offset = "O_m"')
    actuator: Name | None = Field(None, description='actuator = "Gamma_m"')
    friction: Friction | None = Field(None, description='friction = "asymmetric"')
    motion: Motion | None = Field(None, description='motion = "translation"')


class LinkTable(Table):
    """A table [[links]]."""

    bodies: _Pair = Field(description='bodies = ["m", "c"]')
    stiffness: Name = Field(description='stiffness = "K"')
    damping: Name | None = Field(None, description='damping = "F_vmc"')
    stiffness3: Name | None = Field(None, description='stiffness3 = "K3"')
    ratio: NonzeroNumber | None = Field(None, description="ratio = 10.0")
    lead: NonzeroNumber | None = Field(None, description="lead = 0.01")


class _SensorTable(Table):
    body: str | None = Field(None, description='body = "m"')
    deflection: _Pair | None = Field(None, description='deflection = ["m", "c"]')
    measures: Measures = Field(description='measures = "position"')


class FileTable(Table):
    """The whole file."""

    chain: _ChainTable = Field(description="[chain]")
    bodies: list[BodyTable] = Field(description="[[bodies]] for every body")
    links: list[LinkTable] | None = Field(None, description="[[links]] for every link")
    known: dict[str, Number] | None = Field(None, description="[known]")
    parameters: dict[str, dict[str, Number]] | None = Field(None, description="[parameters.nominal]")
    sensors: dict[str, dict[str, _SensorTable]] | None = Field(
        None, description='[sensors.qm] with q_m = { body = "m", measures = "position" }'
    )


_FORM = FileForm(
    FileTable,
    {
        ("chain", 2): _ChainTable,
        ("bodies", 3): BodyTable,
        ("links", 3): LinkTable,
        ("sensors", 4): _SensorTable,
    },
)


def check_tables(document: Document) -> list[Problem]:
    """Report the mistakes of single tables, and set in `document` to None what is missing or unreadable.

    Numbers that are written as text ("2*pi/0.01") are replaced by their exact value.
    """
    problems = mistakes_of(document, _FORM)
    for table, keys in _tables_of_numbers(document):
        for key in keys:
            if isinstance(table.get(key), str):
                table[key] = exact_number(table[key])
    return problems


def _tables_of_numbers(document: Document) -> Iterator[tuple[Document, Iterable[str]]]:
    """Yield every readable table that holds numbers, and which of its keys do."""
    for link in document.get("links") or ():
        if link is not None:
            yield link, ("ratio", "lead")
    for values in (document.get("known"), *(document.get("parameters") or {}).values()):
        if values is not None:
            yield values, list(values)
