"""First pass over a spec: every table by itself, with pydantic, with messages in the terms of mechanics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from modelgen.documents import Document
from modelgen.errors import Problem, nearest
from modelgen.generated_module.literals import hidden_character
from modelgen.magnitudes import REMEDY, is_usable
from modelgen.spec.chain import Friction
from modelgen.spec.number_expression import Misread, exact_number
from modelgen.spec.units import Measures, Motion
from modelgen.spec.words import identifier_problem, path, shown, suggest


def _name(text: str) -> str:
    problem = identifier_problem(text)
    if problem:
        raise _explained(*problem)
    return text


def _title(text: str) -> str:
    if not text.strip():
        raise _explained("is empty", "write a title, or leave the key out to use the name")
    if len(text) > 200:
        raise _explained(f"has {len(text)} characters", "shorten it to 200")
    odd = hidden_character(text)
    if odd is not None:  # a line break or an invisible mark would change the generated module's text
        raise _explained(f"holds the control character U+{ord(odd):04X}", "write one line of visible text")
    return text


def _pair(value: object) -> object:
    if not (isinstance(value, list) and len(value) == 2 and all(isinstance(item, str) for item in value)):
        raise PydanticCustomError("unreadable", "", {"expected": "a list of two names"})
    return value


def _ratio(value: float) -> float:
    if value == 0:
        raise PydanticCustomError("unreadable", "", {"expected": "a number other than 0"})
    return value


def _usable(value: float) -> float:
    if not is_usable(value):
        raise _explained(f"is {value:g}", REMEDY)
    return value


def _expression(value: object) -> object:
    """Return the value of a text such as "2*pi/0.01"; anything else as it is."""
    if not isinstance(value, str):
        return value
    try:
        number = exact_number(value)
    except Misread as found:
        context = {"what": f"is {shown(value)}, which {found.what}", "remedy": found.remedy}
        raise PydanticCustomError("misread", "", context) from None
    if not is_usable(number):
        context = {"what": f"is {shown(value)}, a number that cannot be used", "remedy": REMEDY}
        raise PydanticCustomError("misread", "", context)
    return float(number)


def _explained(what: str, remedy: str) -> PydanticCustomError:
    """Return an error that the reference checks need not know of: the value can still be referred to."""
    return PydanticCustomError("explained", "", {"what": what, "remedy": remedy})


_Name = Annotated[str, AfterValidator(_name)]
_Number = Annotated[float, Field(allow_inf_nan=False), AfterValidator(_usable), BeforeValidator(_expression)]
_Pair = Annotated[list[str], BeforeValidator(_pair)]


class _Table(BaseModel):
    """A table of the file; the description of a key is how it is written."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class _ChainTable(_Table):
    name: _Name = Field(description='name = "my_axis"')
    title: Annotated[str, AfterValidator(_title)] | None = Field(None, description='title = "My axis"')
    motion: Motion = Field(description='motion = "rotation"')


class BodyTable(_Table):
    """A table [[bodies]]."""

    name: _Name = Field(description='name = "m"')
    inertia: _Name = Field(description='inertia = "J_m"')
    viscous: _Name | None = Field(None, description='viscous = "F_vm"')
    coulomb: _Name | None = Field(None, description='coulomb = "F_sm"')
    offset: _Name | None = Field(None, description='offset = "O_m"')
    actuator: _Name | None = Field(None, description='actuator = "Gamma_m"')
    friction: Friction | None = Field(None, description='friction = "asymmetric"')
    motion: Motion | None = Field(None, description='motion = "translation"')


class LinkTable(_Table):
    """A table [[links]]."""

    bodies: _Pair = Field(description='bodies = ["m", "c"]')
    stiffness: _Name = Field(description='stiffness = "K"')
    damping: _Name | None = Field(None, description='damping = "F_vmc"')
    stiffness3: _Name | None = Field(None, description='stiffness3 = "K3"')
    ratio: Annotated[_Number, AfterValidator(_ratio)] | None = Field(None, description="ratio = 10.0")
    lead: Annotated[_Number, AfterValidator(_ratio)] | None = Field(None, description="lead = 0.01")


class _SensorTable(_Table):
    body: str | None = Field(None, description='body = "m"')
    deflection: _Pair | None = Field(None, description='deflection = ["m", "c"]')
    measures: Measures = Field(description='measures = "position"')


class FileTable(_Table):
    """The whole file."""

    chain: _ChainTable = Field(description="[chain]")
    bodies: list[BodyTable] = Field(description="[[bodies]] for every body")
    links: list[LinkTable] | None = Field(None, description="[[links]] for every link")
    known: dict[str, _Number] | None = Field(None, description="[known]")
    parameters: dict[str, dict[str, _Number]] | None = Field(None, description="[parameters.nominal]")
    sensors: dict[str, dict[str, _SensorTable]] | None = Field(
        None, description='[sensors.qm] with q_m = { body = "m", measures = "position" }'
    )


_EXPECTED = {
    "string_type": "text in quotes",
    "float_type": "a number",
    "finite_number": "a finite number",
    "list_type": "a list of tables",
    "dict_type": "a table",
    "model_type": "a table",
}


_TABLES: dict[tuple[str, int], type[_Table]] = {  # by the first key and the length of a path into the table
    ("chain", 2): _ChainTable,
    ("bodies", 3): BodyTable,
    ("links", 3): LinkTable,
    ("sensors", 4): _SensorTable,
}


def check_tables(document: Document) -> list[Problem]:
    """Report the mistakes of single tables, and set in `document` to None what is missing or unreadable.

    Numbers that are written as text ("2*pi/0.01") are replaced by their exact value.
    """
    problems = _mistakes(document)
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


def _mistakes(document: Document) -> list[Problem]:
    try:
        FileTable.model_validate(document)
    except ValidationError as error:
        mistakes = error.errors(include_url=False)
        for mistake in mistakes:
            if mistake["type"] not in ("extra_forbidden", "explained"):
                table: Any = document
                for key in mistake["loc"][:-1]:
                    table = table[key]
                table[mistake["loc"][-1]] = None
        misspelt = [_meant(mistake["loc"]) for mistake in mistakes if mistake["type"] == "extra_forbidden"]
        return [_explain(m) for m in mistakes if m["type"] != "missing" or m["loc"] not in misspelt]
    return []


def _keys(loc: tuple[int | str, ...]) -> dict[str, FieldInfo]:
    """Return the keys that are allowed where the last key of `loc` stands."""
    return _TABLES.get((str(loc[0]), len(loc)), FileTable).model_fields


def _meant(loc: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Return the path that a misspelt key was meant to have."""
    return (*loc[:-1], nearest(str(loc[-1]), _keys(loc)) or loc[-1])


def _explain(mistake: ErrorDetails) -> Problem:
    """Put what pydantic found into words."""
    loc, kind, context = mistake["loc"], mistake["type"], mistake.get("ctx", {})
    where, key = path(*loc), str(loc[-1])
    keys = _keys(loc)
    if kind in ("explained", "misread"):
        return Problem(where, context["what"], context["remedy"])
    if kind == "extra_forbidden":
        return Problem(where, "is not a key of this table", suggest(key, keys, "keys"))
    if kind == "missing":
        return Problem(where, "is missing", f"write {keys[key].description}")
    if key in keys or kind not in ("float_type", "finite_number"):
        example = (keys.get(key) or FileTable.model_fields[str(loc[0])]).description
    else:  # [known] and [parameters] hold the user's own names
        example = f"{path(key)} = 0.1"
    expected = context.get("expected") or _EXPECTED[kind]
    if kind == "literal_error":
        expected = expected.replace("'", '"')
    return Problem(
        where, f"must be {expected}, not {shown(mistake['input'])}", f"write for example {example}"
    )
