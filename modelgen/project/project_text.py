"""Tables of a project -> the text of its file, which `load_project` reads as the same tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from datetime import date as Date
from typing import Any

from modelgen.documents import toml_string
from modelgen.project.tables import ProjectTable, RecordsTable

HEADING = (
    "# What is identified from what, and how, for: modelgen run THIS_FILE",
    "# Paths start at this file. docs/how-to/monitor.md describes every key.",
)


def project_text(table: ProjectTable) -> str:
    """Return the text of a project file; keys that have their default are left out."""
    lines = [*HEADING, ""]
    plain = {name: getattr(table, name) for name in ("name", "spec", "sensors", "model")}
    lines += [f"{name} = {_value(value)}" for name, value in plain.items() if value is not None]
    for name in ("known", "data", "identify", "output"):
        part = getattr(table, name)
        entries = dict(part) if isinstance(part, Mapping) else _changed(part)
        if entries:
            lines += ["", f"[{name}]", *(f"{_key(key)} = {_value(one)}" for key, one in entries.items())]
    for group in table.records:
        lines += ["", "[[records]]", *_records(group)]
    return "\n".join(lines) + "\n"


def _records(group: RecordsTable) -> list[str]:
    shown = {name: getattr(group, name) for name in ("date", "files", "tags", "sensors", "payloads")}
    return [f"{name} = {_value(value)}" for name, value in shown.items() if value]


def _changed(part: Any) -> dict[str, Any]:
    """Return the fields of a table that have not their default."""
    default = type(part)()
    values = {one.name: getattr(part, one.name) for one in fields(part)}
    return {name: value for name, value in values.items() if value != getattr(default, name)}


def _key(text: str) -> str:
    plain = text.isascii() and text.replace("_", "").replace("-", "").isalnum()
    return text if plain else toml_string(text)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return toml_string(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, Date):
        return value.isoformat()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items()) + " }"
    return "[" + ", ".join(_value(one) for one in value) + "]"
