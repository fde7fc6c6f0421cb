"""TOML and JSON -> plain values: of bounded depth and size, all mistakes in one form of message.

Both parsers call themselves for every list in a list, and Python refuses integers of thousands of digits; a
key of ten thousand parts takes TOML's parser minutes. The text is scanned before it is parsed.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, fields, is_dataclass
from pathlib import PurePath
from typing import Any

from modelgen.errors import DataError, ModelgenError, Problem, shortened

DEEPEST = 32  # lists and tables in one another, and parts of a dotted key; nothing modelgen reads has ten
MOST_TOML_TABLES = 30_000  # and lists: the parser takes seconds for more
MOST_TABLES, MOST_ITEMS = 500_000, 2_000_000  # in JSON, which is packed denser than what it becomes
INTEGERS = range(-(2**63), 2**63)  # what TOML promises to hold
TOML_MARKS, JSON_MARKS = re.compile(r"[\[\]{}\"'#.]"), re.compile(r"[\[\]{}\"]")
STRINGS = re.compile(
    r'''"""(?:[^"\\]|\\.|"(?!""))*+"{3,5}|"(?!"")[^"\\]*+(?:\\.[^"\\]*+)*+"|'''
    r"""'''(?:[^']|'(?!''))*+'{3,5}|'(?!'')[^']*+'""",
    re.DOTALL,
)
#: what a line holds that TOML refuses -> what to do
TOML_REMEDIES = (
    (r"\r(?!$)", "save the file with line ends of Unix or Windows (LF, CR LF)"),
    ("[=,[{]\\s*[\u201c\u201d\u201e\u2018\u2019\u00ab]", 'write straight quotes, "like these"'),
    ("=\\s*[\u2212\u2013]", "write minus as the hyphen of the keyboard, -"),
    (r"=\s*[-+]?[0-9]+,[0-9]", "write decimals with a point, 0.5"),
)
#: a table of one kind of file alone -> what the file is
KINDS = {
    "bodies": "the description of a chain",
    "joints": "the description of an arm",
    "records": "a project (modelgen run)",
    "channels": "a mapping of columns (--map-file)",
    "controller": "a controller (--controller)",
}
SEPARATORS = frozenset("=,\n[]{}#")

Document = dict[str, Any]


def toml_document(
    text: str, where: str, tables: Collection[str], error: type[ModelgenError] = DataError
) -> Document:
    """Return what a TOML text says, in a file with some of these tables.

    Raises
    ------
    ModelgenError
        Of the given sort: when the text is no TOML, nests too deeply, holds integers beyond 64 bits, or is
        that of another kind of file.
    """
    _check_depth(text, TOML_MARKS, where, error)
    if text.count("[") + text.count("{") > MOST_TOML_TABLES:
        raise error.at(where, f"holds more than {MOST_TOML_TABLES} tables or lists", "check what the file is")
    try:
        document = tomllib.loads(text.removeprefix("\ufeff"))
    except tomllib.TOMLDecodeError as reason:
        found = re.fullmatch(r"(.*) \(at (.*)\)", str(reason), re.DOTALL)
        what, place = found.groups() if found else (str(reason), "TOML")
        if PurePath(where).suffix not in ("", ".toml"):
            raise error.at(where, f"is no TOML ({what}, {place})", "give a .toml file") from None
        raise error.at(f"{where}: {place}", f"is not valid TOML ({what})", _remedy(text, place)) from None
    except RecursionError:
        raise _too_deep(where, error) from None
    except ValueError:
        raise _too_long(where, error) from None
    _check_integers(document, where, error)
    kind = next((KINDS[key] for key in document if key in KINDS), None)
    if kind is not None and not document.keys() & set(tables):
        raise error.at(where, f"is {kind}", f"give a file that has one of {', '.join(tables)}")
    return document


def _remedy(text: str, place: str) -> str:
    """Return what to do about a line that is no TOML; what keyboards and word processors write is named."""
    number = re.match(r"line (\d+)", place)
    line = text.split("\n")[int(number[1]) - 1] if number else ""
    return next(
        (remedy for mark, remedy in TOML_REMEDIES if re.search(mark, line)),
        "correct the TOML there; text needs quotes, and a key or table is written once only",
    )


def toml_string(text: str) -> str:
    """Return a TOML string of any text; JSON's escapes are TOML's."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def json_document(text: str, where: str, remedy: str) -> Any:
    """Return what a JSON text says, with no NaN or infinity in it; the errors are those of TOML."""
    if text.count("{") + text.count("[") > MOST_TABLES or text.count(",") > MOST_ITEMS:
        raise DataError.at(where, f"holds more than {MOST_TABLES} tables or {MOST_ITEMS} values", remedy)
    _check_depth(text, JSON_MARKS, where, DataError)
    try:
        document = json.loads(
            text.removeprefix("\ufeff"),
            parse_constant=_refuse_constant,
            parse_int=_integer,
            object_pairs_hook=_object,
        )
    except json.JSONDecodeError as reason:
        place = f"{where}: line {reason.lineno} column {reason.colno}"
        raise DataError.at(place, f"is no JSON: {reason.msg}", remedy) from None
    except RecursionError:
        raise _too_deep(where, DataError) from None
    except ValueError as reason:
        if isinstance(reason, _NotTaken):
            raise DataError.at(where, f"holds {reason}", remedy) from None
        raise _too_long(where, DataError) from None
    return document


class _NotTaken(ValueError):
    """What JSON does not have (NaN, Infinity, an integer beyond 64 bits), or leaves open: a key twice."""


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise _NotTaken(f"the key {shortened(key)} twice")
        found[key] = value
    return found


def _refuse_constant(word: str) -> float:
    raise _NotTaken(f"{word}, which is no number in JSON")


def _integer(digits: str) -> int:
    if len(digits) > 20 or int(digits) not in INTEGERS:
        raise _NotTaken(f"{digits[:20]}..., an integer beyond 64 bits")
    return int(digits)


def plain_json(value: Any) -> Any:
    """Return a value in JSON's types: dataclasses as tables, null for a number that is not finite."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain_json(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain_json(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_json(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _too_deep(where: str, error: type[ModelgenError]) -> ModelgenError:
    return error.at(where, "nests lists or tables too deeply", "use the tables of the format")


def _too_long(where: str, error: type[ModelgenError]) -> ModelgenError:
    return error.at(where, "holds a number of thousands of digits", "shorten the number")


def _check_depth(text: str, marks: re.Pattern[str], where: str, error: type[ModelgenError]) -> None:
    """Refuse brackets in brackets, and keys of many parts, without reading what they hold."""
    depth = parts = place = dot = 0
    while found := marks.search(text, place):
        mark, place = found.group(), found.end()
        if mark == "#":
            place = text.find("\n", place)
        elif mark in "\"'":
            string = STRINGS.match(text, found.start())
            place = string.end() if string else -1
        elif mark == ".":
            # a number or a date has one dot, and something between them
            parts = parts + 1 if not SEPARATORS & set(text[dot : place - 1]) else 1
            dot = place
        else:
            depth = max(depth + (mark in "[{") - (mark in "]}"), 0)
        if depth > DEEPEST or parts > DEEPEST:
            raise _too_deep(where, error)
        if place < 0:  # the end of the text, or a string without one, which the parser refuses
            return


def _check_integers(document: Any, where: str, error: type[ModelgenError]) -> None:
    problems = [
        Problem(f"{where}: {path}", "is an integer beyond 64 bits", "shorten the number")
        for path, value in leaves(document)
        if isinstance(value, int) and value not in INTEGERS
    ]
    error.raise_any(problems)


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every value that is no list, table or dataclass, with its path."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {one.name: getattr(value, one.name) for one in fields(value)}
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, f"{path}.{key}" if path else str(key))
    elif isinstance(value, (list, tuple)):
        for index, item in enumerate(value):
            yield from leaves(item, f"{path}[{index}]")
    else:
        yield path, value
