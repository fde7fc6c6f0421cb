"""Tables of a file, each by itself, with pydantic: kinds of keys, and mistakes in the terms of mechanics.

The only place that speaks to pydantic's errors; what tables there are is said by `tables` for chains and by
`arms.tables` for arms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from modelgen.documents import Document
from modelgen.errors import Problem, nearest
from modelgen.generated_module.literals import hidden_character
from modelgen.magnitudes import FACTOR_REMEDY, REMEDY, is_usable
from modelgen.number_expression import Misread, exact_number
from modelgen.spec.words import identifier_problem, path, shown, suggest


class Table(BaseModel):
    """A table of the file; the description of a key is how it is written."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


@dataclass(frozen=True)
class FileForm:
    """The tables of a file: the whole, and others by the first key and length of a path into them."""

    file: type[Table]
    tables: Mapping[tuple[str, int], type[Table]]

    def keys(self, loc: tuple[int | str, ...]) -> dict[str, FieldInfo]:
        """Return the keys that are allowed where the last key of `loc` stands."""
        return self.tables.get((str(loc[0]), len(loc)), self.file).model_fields


def explained(what: str, remedy: str) -> PydanticCustomError:
    """Return an error that the reference checks need not know of: the value can still be referred to."""
    return PydanticCustomError("explained", "", {"what": what, "remedy": remedy})


def misread(what: str, remedy: str) -> PydanticCustomError:
    """Return an error of a value that cannot be used: None takes its place."""
    return PydanticCustomError("misread", "", {"what": what, "remedy": remedy})


def unreadable(expected: str) -> PydanticCustomError:
    """Return an error of a value that should be something else: None takes its place."""
    return PydanticCustomError("unreadable", "", {"expected": expected})


def _name(text: str) -> str:
    problem = identifier_problem(text)
    if problem:
        raise explained(*problem)
    return text


def _title(text: str) -> str:
    if not text.strip():
        raise explained("is empty", "write a title, or leave the key out to use the name")
    if len(text) > 200:
        raise explained(f"has {len(text)} characters", "shorten it to 200")
    odd = hidden_character(text)
    if odd is not None:  # a line break or an invisible mark would change the generated module's text
        raise explained(f"holds the control character U+{ord(odd):04X}", "write one line of visible text")
    return text


def _nonzero(value: float) -> float:
    if value == 0:
        raise unreadable("a number other than 0")
    if not is_usable(value):
        raise explained(f"is {value:g}", FACTOR_REMEDY)
    return value


def _usable(value: float) -> float:
    if not is_usable(value):
        raise explained(f"is {value:g}", REMEDY)
    return value


def _expression(value: object) -> object:
    """Return the value of a text such as "2*pi/0.01"; anything else as it is."""
    if not isinstance(value, str):
        return value
    try:
        number = exact_number(value)
    except Misread as found:
        raise misread(f"is {shown(value)}, which {found.what}", found.remedy) from None
    if not is_usable(number):
        raise misread(f"is {shown(value)}, a number that cannot be used", REMEDY)
    return float(number)


Name = Annotated[str, AfterValidator(_name)]
Title = Annotated[str, AfterValidator(_title)]
Number = Annotated[float, Field(allow_inf_nan=False), AfterValidator(_usable), BeforeValidator(_expression)]
NonzeroNumber = Annotated[
    float, Field(allow_inf_nan=False), AfterValidator(_nonzero), BeforeValidator(_expression)
]

_EXPECTED = {
    "string_type": "text in quotes",
    "float_type": "a number",
    "finite_number": "a finite number",
    "list_type": "a list of tables",
    "dict_type": "a table",
    "model_type": "a table",
    "bool_type": "true or false",
}


def mistakes_of(document: Document, form: FileForm) -> list[Problem]:
    """Report the mistakes of single tables; what is missing or unreadable becomes None in `document`."""
    try:
        form.file.model_validate(document)
    except ValidationError as error:
        mistakes = error.errors(include_url=False)
        for mistake in mistakes:
            if mistake["type"] not in ("extra_forbidden", "explained"):
                table: Any = document
                for key in mistake["loc"][:-1]:
                    table = table[key]
                table[mistake["loc"][-1]] = None
        misspelt = [_meant(m["loc"], form) for m in mistakes if m["type"] == "extra_forbidden"]
        return [_explain(m, form) for m in mistakes if m["type"] != "missing" or m["loc"] not in misspelt]
    return []


def _meant(loc: tuple[int | str, ...], form: FileForm) -> tuple[int | str, ...]:
    """Return the path that a misspelt key was meant to have."""
    return (*loc[:-1], nearest(str(loc[-1]), form.keys(loc)) or loc[-1])


def _explain(mistake: ErrorDetails, form: FileForm) -> Problem:
    """Put what pydantic found into words."""
    loc, kind, context = mistake["loc"], mistake["type"], mistake.get("ctx", {})
    where, key = path(*loc), str(loc[-1])
    keys = form.keys(loc)
    if kind in ("explained", "misread"):
        return Problem(where, context["what"], context["remedy"])
    if kind == "extra_forbidden":
        return Problem(where, "is not a key of this table", suggest(key, keys, "keys"))
    if kind == "missing":
        return Problem(where, "is missing", f"write {keys[key].description}")
    if key in keys or kind not in ("float_type", "finite_number"):
        example = (keys.get(key) or form.file.model_fields[str(loc[0])]).description
    else:  # [known] and [parameters] hold the user's own names
        example = f"{path(key)} = 0.1"
    expected = context.get("expected") or _EXPECTED[kind]
    if kind == "literal_error":
        expected = expected.replace("'", '"')
    return Problem(
        where, f"must be {expected}, not {shown(mistake['input'])}", f"write for example {example}"
    )
