"""A chain's TOML file -> ChainSpec: all checks of what a user writes, every mistake reported at once.

Two passes, so that no mistake hides another. First every table is checked by itself (pydantic, which stays
inside this module): what cannot be read is reported and becomes None. Then the references between tables are
checked on what could be read. If neither pass found a mistake, the draft of the second one is the ChainSpec.
"""

from __future__ import annotations

import hashlib
import json
import keyword
import math
import os
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from fractions import Fraction
from functools import cached_property
from importlib.resources import files
from pathlib import Path, PurePath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from modelgen.errors import Problem, SpecError
from modelgen.units import Measures, Motion, Role, parameter_unit

GROUND = "ground"
MAX_BYTES = (
    1_000_000  # a larger file is refused: no chain needs it, and a wrong file must not fill the memory
)

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
_DERIVED = re.compile(
    r"d\d+_.*|sign_.*|1"
)  # names of the signals that are derived from sensors and actuators
# "type" is a keyword since Python 3.12 only: refused everywhere, so that a spec means the same everywhere
_KEYWORDS = frozenset({*keyword.kwlist, *keyword.softkwlist, "type"})
_LINK_ROLES: tuple[Role, ...] = ("damping", "stiffness", "stiffness3")
_NAMES_LISTED, _NAMES_COMPARED = 12, 200  # in a remedy; comparing more takes longer than it helps

_Friction = Literal["symmetric", "asymmetric"]
_Document = dict[str, Any]


# What the other rooms see --------------------------------------------------------------------------


@dataclass(frozen=True)
class Body:
    """A body with one coordinate; inertia to offset name parameters, actuator names a measured force."""

    name: str
    inertia: str
    viscous: str | None
    coulomb: str | None
    offset: str | None
    actuator: str | None
    friction: _Friction
    motion: Motion


@dataclass(frozen=True)
class Link:
    """A spring of deflection q_first / ratio - q_second; only the second of `bodies` may be "ground"."""

    bodies: tuple[str, str]
    stiffness: str
    damping: str | None
    stiffness3: str | None
    ratio: Fraction


@dataclass(frozen=True)
class Sensor:
    """A measured signal, either of a body or of the deflection between two bodies (the other one is None)."""

    key: str
    body: str | None
    deflection: tuple[str, str] | None
    measures: Measures


@dataclass(frozen=True)
class Parameter:
    """A physical parameter: its role, the bodies it acts on (never the ground) and its SI unit."""

    name: str
    role: Role
    bodies: tuple[str, ...]
    unit: str


@dataclass(frozen=True)
class ChainSpec:
    """A chain as its user described it, free of contradictions.

    Attributes
    ----------
    known
        Value (SI) of every parameter that is not to be estimated.
    parameter_sets, sensor_sets
        By name of the set; the sensors of a set in the order of the file.
    source
        Name of the file, without its folder.
    sha256
        Hash of the file's bytes, 64 hexadecimal digits.
    """

    name: str
    title: str
    motion: Motion
    bodies: tuple[Body, ...]
    links: tuple[Link, ...]
    known: Mapping[str, float] = field(hash=False)
    parameter_sets: Mapping[str, Mapping[str, float]] = field(hash=False)
    sensor_sets: Mapping[str, tuple[Sensor, ...]] = field(hash=False)
    source: str
    sha256: str

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All physical parameters, known ones too: body by body, then link by link.

        For the two-body chain this is the order of Pham 2002, eq. (6). A name that several elements share
        appears once, with the bodies of all of them.
        """
        uses: dict[str, list[Parameter]] = {}
        for _, parameter in _elements(self):
            uses.setdefault(parameter.name, []).append(parameter)
        return tuple(
            Parameter(
                name, same[0].role, tuple(dict.fromkeys(b for p in same for b in p.bodies)), same[0].unit
            )
            for name, same in uses.items()
        )


def _elements(spec: ChainSpec) -> Iterator[tuple[str, Parameter]]:
    """Yield (path of the key, parameter it names) in the fixed order, every use of a shared name."""
    motions = {body.name: body.motion for body in spec.bodies}
    for index, body in enumerate(spec.bodies):
        for role, name in _body_parameters(body):
            unit = parameter_unit(body.motion, role)
            yield f"bodies[{index}].{role}", Parameter(name, role, (body.name,), unit)
    for index, link in enumerate(spec.links):
        ends = tuple(name for name in link.bodies if name in motions)
        motion = motions[ends[-1]] if ends else spec.motion  # the deflection is one of the second body
        for role in _LINK_ROLES:
            name = getattr(link, role)
            if name is not None:
                yield f"links[{index}].{role}", Parameter(name, role, ends, parameter_unit(motion, role))


def _body_parameters(body: Body) -> Iterator[tuple[Role, str]]:
    named: list[tuple[Role, str | None]] = [("inertia", body.inertia)]
    for suffix in ("_plus", "_minus") if body.friction == "asymmetric" else ("",):
        named += [("viscous", body.viscous and body.viscous + suffix)]
        named += [("coulomb", body.coulomb and body.coulomb + suffix)]
    named += [("offset", body.offset)]
    return ((role, name) for role, name in named if name is not None)


# Reading -------------------------------------------------------------------------------------------


def load_spec(path: str | os.PathLike[str]) -> ChainSpec:
    """Read a chain's TOML file.

    Raises
    ------
    SpecError
        If the file cannot be read or is wrong; one problem for every mistake in it.
    """
    where, file = os.fspath(path), Path(path)
    if file.is_dir():
        raise SpecError.at(where, "is a folder", "name the TOML file in it")
    if not file.is_file():
        raise SpecError.at(
            where, "is not a file that exists", "check the path, or start one with modelgen new"
        )
    try:
        with file.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
        _check_size(content, where)
        text = content.decode()
    except OSError as error:
        raise SpecError.at(where, f"cannot be read ({error.strerror})", "check its permissions") from None
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise SpecError.at(f"{where}: line {line}", "is not UTF-8 text", "save the file as UTF-8") from None
    return parse_spec(text, file.name)


def parse_spec(text: str, source: str) -> ChainSpec:
    """Read a chain from TOML text; `source` is the name of the file that messages speak of.

    Raises
    ------
    SpecError
        If the text is wrong; one problem for every mistake in it.
    """
    source = PurePath(source).name
    if not source.isprintable():  # it becomes part of a comment in generated modules
        raise SpecError.at(ascii(source), "has a file name with control characters", "rename the file")
    content = text.encode(errors="surrogatepass")
    _check_size(content, source)
    document = _parse_toml(text, source)
    problems = _check_tables(document)
    spec = _draft(document, source, hashlib.sha256(content).hexdigest())
    problems += _check_references(document, spec)
    if problems:
        raise SpecError(*(Problem(f"{source}: {p.where}", p.what, p.remedy) for p in problems))
    return spec


def catalog_names() -> tuple[str, ...]:
    """Return the names of the example chains that come with modelgen."""
    return tuple(sorted(path.stem for path in _catalog().glob("*.toml")))


def catalog_path(name: str) -> Path:
    """Return the TOML file of an example chain; SpecError if there is none of that name."""
    if name not in catalog_names():
        remedy = _suggest(name, catalog_names(), "examples")
        raise SpecError.at(_shown(name), "is not a chain of the catalogue", remedy)
    return _catalog() / f"{name}.toml"


def _catalog() -> Path:
    return Path(str(files("modelgen") / "catalog"))


def _check_size(content: bytes, where: str) -> None:
    if len(content) > MAX_BYTES:
        raise SpecError.at(where, "is larger than 1 MB", "check that this is a chain's TOML file")


def _parse_toml(text: str, source: str) -> _Document:
    try:
        return tomllib.loads(text.removeprefix("\ufeff"))
    except tomllib.TOMLDecodeError as error:
        found = re.fullmatch(r"(.*) \(at (.*)\)", str(error), re.DOTALL)
        what, place = found.groups() if found else (str(error), "TOML")
        remedy = "correct the TOML there; text needs quotes, and a key or table is written once only"
        raise SpecError.at(f"{source}: {place}", f"is not valid TOML ({what})", remedy) from None
    except RecursionError:
        raise SpecError.at(
            source, "nests lists or tables too deeply", "use the tables of the format"
        ) from None
    except ValueError:  # Python refuses to read such integers
        raise SpecError.at(source, "holds a number of thousands of digits", "shorten the number") from None


def _draft(document: _Document, source: str, sha256: str) -> ChainSpec:
    """Build the spec from what is readable; None or an empty tuple stands for what is not."""
    chain: Any = document.get("chain") or {}
    motion: Motion = chain.get("motion") or "rotation"
    sets, sensor_sets = document.get("parameters") or {}, document.get("sensors") or {}
    return ChainSpec(
        name=chain.get("name"),
        title=chain.get("title") or chain.get("name"),
        motion=motion,
        bodies=tuple(_draft_body(table or {}, motion) for table in document.get("bodies") or ()),
        links=tuple(_draft_link(table or {}) for table in document.get("links") or ()),
        known=_draft_values(document.get("known")),
        parameter_sets={name: _draft_values(values) for name, values in sets.items()},
        sensor_sets={
            name: tuple(_draft_sensor(key, table or {}) for key, table in (sensors or {}).items())
            for name, sensors in sensor_sets.items()
        },
        source=source,
        sha256=sha256,
    )


def _draft_body(table: _Document, motion: Motion) -> Body:
    keys = ("name", "inertia", "viscous", "coulomb", "offset", "actuator")
    names: _Document = {key: table.get(key) for key in keys}
    friction: _Friction = table.get("friction") or "symmetric"
    return Body(**names, friction=friction, motion=table.get("motion") or motion)


def _draft_link(table: _Document) -> Link:
    bodies: Any = tuple(table.get("bodies") or ())
    ratio = Fraction(str(table.get("ratio") or 1))  # the decimal that was written, not its nearest binary
    if bodies and bodies[0] == GROUND and ratio == 1:
        bodies = bodies[::-1]
    names: _Document = {role: table.get(role) for role in _LINK_ROLES}
    return Link(bodies, **names, ratio=ratio)


def _draft_sensor(key: str, table: _Document) -> Sensor:
    deflection: Any = tuple(table.get("deflection") or ()) or None
    measures: Any = table.get("measures")
    return Sensor(key, table.get("body"), deflection, measures)


def _draft_values(table: _Document | None) -> dict[str, float]:
    return {name: float(value) for name, value in (table or {}).items() if value is not None}


# First pass: every table by itself -----------------------------------------------------------------


def _identifier_problem(text: str) -> tuple[str, str] | None:
    if not _IDENTIFIER.fullmatch(text):
        return f"{_shown(text)} is not a name", "use a letter, then letters, digits or _ (ASCII, 64 at most)"
    if text in _KEYWORDS:
        return f"{_shown(text)} is a word of the Python language", f"choose another name, such as {text}_1"
    return None


def _name(text: str) -> str:
    problem = _identifier_problem(text)
    if problem:
        raise _explained(*problem)
    return text


def _title(text: str) -> str:
    if not text.strip():
        raise _explained("is empty", "write a title, or leave the key out to use the name")
    if len(text) > 200:
        raise _explained(f"has {len(text)} characters", "shorten it to 200")
    odd = next((c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")), None)
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


def _explained(what: str, remedy: str) -> PydanticCustomError:
    """Return an error that the reference checks need not know of: the value can still be referred to."""
    return PydanticCustomError("explained", "", {"what": what, "remedy": remedy})


_Name = Annotated[str, AfterValidator(_name)]
_Number = Annotated[float, Field(allow_inf_nan=False)]
_Pair = Annotated[list[str], BeforeValidator(_pair)]
_MotionKey = Annotated[Motion | None, Field(description='motion = "rotation"')]


class _Table(BaseModel):
    """A table of the file; the description of a key is how it is written."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class _ChainTable(_Table):
    name: _Name = Field(description='name = "my_axis"')
    title: Annotated[str, AfterValidator(_title)] | None = Field(None, description='title = "My axis"')
    motion: Motion = Field(description='motion = "rotation"')


class _BodyTable(_Table):
    name: _Name = Field(description='name = "m"')
    inertia: _Name = Field(description='inertia = "J_m"')
    viscous: _Name | None = Field(None, description='viscous = "F_vm"')
    coulomb: _Name | None = Field(None, description='coulomb = "F_sm"')
    offset: _Name | None = Field(None, description='offset = "O_m"')
    actuator: _Name | None = Field(None, description='actuator = "Gamma_m"')
    friction: _Friction | None = Field(None, description='friction = "asymmetric"')
    motion: Motion | None = Field(None, description='motion = "translation"')


class _LinkTable(_Table):
    bodies: _Pair = Field(description='bodies = ["m", "c"]')
    stiffness: _Name = Field(description='stiffness = "K"')
    damping: _Name | None = Field(None, description='damping = "F_vmc"')
    stiffness3: _Name | None = Field(None, description='stiffness3 = "K3"')
    ratio: Annotated[_Number, AfterValidator(_ratio)] | None = Field(None, description="ratio = 10.0")


class _SensorTable(_Table):
    body: str | None = Field(None, description='body = "m"')
    deflection: _Pair | None = Field(None, description='deflection = ["m", "c"]')
    measures: Measures = Field(description='measures = "position"')


class _File(_Table):
    chain: _ChainTable = Field(description="a table [chain]")
    bodies: list[_BodyTable] = Field(description="a table [[bodies]] for every body")
    links: list[_LinkTable] | None = Field(None, description="a table [[links]] for every link")
    known: dict[str, _Number] | None = Field(None, description="a table [known]")
    parameters: dict[str, dict[str, _Number]] | None = Field(None, description="a table [parameters.nominal]")
    sensors: dict[str, dict[str, _SensorTable]] | None = Field(
        None, description='a table [sensors.qm] with q_m = { body = "m", measures = "position" }'
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
    ("bodies", 3): _BodyTable,
    ("links", 3): _LinkTable,
    ("sensors", 4): _SensorTable,
}


def _check_tables(document: _Document) -> list[Problem]:
    """Report the mistakes of single tables, and set in `document` to None what is missing or unreadable."""
    try:
        _File.model_validate(document)
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
    return _TABLES.get((str(loc[0]), len(loc)), _File).model_fields


def _meant(loc: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Return the path that a misspelt key was meant to have."""
    return (*loc[:-1], _nearest(str(loc[-1]), _keys(loc)) or loc[-1])


def _explain(mistake: ErrorDetails) -> Problem:
    """Put what pydantic found into words."""
    loc, kind, context = mistake["loc"], mistake["type"], mistake.get("ctx", {})
    where, key = _path(*loc), str(loc[-1])
    keys = _keys(loc)
    if kind == "explained":
        return Problem(where, context["what"], context["remedy"])
    if kind == "extra_forbidden":
        return Problem(where, "is not a key of this table", _suggest(key, keys, "keys"))
    if kind == "missing":
        return Problem(where, "is missing", f"write {keys[key].description}")
    if key in keys or kind not in ("float_type", "finite_number"):
        example = (keys.get(key) or _File.model_fields[str(loc[0])]).description
    else:  # [known] and [parameters] hold the user's own names
        example = f"{key} = 0.1"
    expected = context.get("expected") or _EXPECTED[kind]
    if kind == "literal_error":
        expected = expected.replace("'", '"')
    return Problem(
        where, f"must be {expected}, not {_shown(mistake['input'])}", f"write for example {example}"
    )


def _path(*keys: str | int) -> str:
    """Write a key's path as TOML does: bodies[0].inertia, sensors."my set".q_m."""
    text = ""
    for key in keys:
        bare = isinstance(key, int) or re.fullmatch(r"[A-Za-z0-9_-]{1,64}", key)
        text += f"[{key}]" if isinstance(key, int) else f".{key if bare else _shown(key)}"
    return text.removeprefix(".")


def _shown(value: object) -> str:
    """Name a value of a TOML file in a message: short, on one line, without invisible characters."""
    if isinstance(value, str | bool):
        text = json.dumps(value, ensure_ascii=not str(value).isprintable())
        return text if len(text) <= 60 else f'{text[:56]}..."'
    if isinstance(value, int | float):
        return "a huge number" if 1e300 < abs(value) < math.inf else str(value)
    if isinstance(value, list):
        return "a list"
    return "a table" if isinstance(value, dict) else "a date or time"


def _suggest(name: str, names: Iterable[str], kind: str) -> str:
    """Return the remedy for a misspelt name: the nearest of the right ones, or their list."""
    known = list(names)
    close = _nearest(name, known)
    if close is not None:
        return f'did you mean "{close}"?'
    more = ", ..." if len(known) > _NAMES_LISTED else ""
    return (
        f"the {kind} are {', '.join(known[:_NAMES_LISTED])}{more}" if known else f"there are no {kind} here"
    )


def _nearest(name: str, names: Iterable[str]) -> str | None:
    return next(iter(get_close_matches(name[:64], list(names)[:_NAMES_COMPARED], n=1)), None)


# Second pass: references between tables ------------------------------------------------------------


def _check_references(document: _Document, spec: ChainSpec) -> list[Problem]:
    """Report contradictions between tables; silent where an unreadable table may hold what is missed."""
    tables = [*(document["bodies"] or [None]), *(document.get("links") or [])]
    misplaced = any(isinstance(document[key], list) for key in document.keys() - _File.model_fields.keys())
    lists = "links" not in document or document["links"] is not None
    complete = lists and not misplaced and None not in tables and None not in [b.name for b in spec.bodies]
    bodies = {body.name: body.motion for body in spec.bodies} if complete else None
    return [
        *_check_bodies(document, spec),
        *_check_links(document, spec, bodies),
        *_check_shared_names(document, spec),
        *_check_sensors(document, spec, bodies),
        *_check_values(document, _roles(spec, tables) if complete else None),
    ]


def _roles(spec: ChainSpec, tables: list[_Document]) -> dict[str, Role | None] | None:
    """Role of every parameter; None for all if a name is missing, None for a name under a misspelt key."""
    keys = ("inertia", "viscous", "coulomb", "offset", "friction", *_LINK_ROLES)
    if any(table.get(key, "") is None for table in tables for key in keys):
        return None
    allowed = _BodyTable.model_fields.keys() | _LinkTable.model_fields.keys()
    misspelt = [v for table in tables for k, v in table.items() if k not in allowed and isinstance(v, str)]
    return {**dict.fromkeys(misspelt), **{parameter.name: parameter.role for _, parameter in _elements(spec)}}


def _check_bodies(document: _Document, spec: ChainSpec) -> Iterator[Problem]:
    if document["bodies"] == []:
        yield Problem("bodies", "is empty", "write a table [[bodies]] for every body")
    first: dict[tuple[str, str | None], str] = {}
    for index, body in enumerate(spec.bodies):
        where = f"bodies[{index}]"
        if body.name == GROUND:
            yield Problem(f"{where}.name", '"ground" is what does not move', "choose another name")
        for key, name in (("name", body.name), ("actuator", body.actuator)):
            other = first.setdefault((key, name), where)
            if name is not None and other != where:
                yield Problem(
                    f"{where}.{key}", f'"{name}" is the {key} of {other} already', "rename one of them"
                )
        if body.actuator is not None:
            yield from _check_derived(f"{where}.actuator", body.actuator)


def _check_links(
    document: _Document, spec: ChainSpec, bodies: Mapping[str, Motion] | None
) -> Iterator[Problem]:
    for index, link in enumerate(spec.links):
        where, table = f"links[{index}]", document["links"][index] or {}
        yield from _check_pair(f"{where}.bodies", link.bodies, bodies)
        if link.bodies[:1] == (GROUND,) and link.bodies[1] != GROUND:
            right = f'write ["{link.bodies[1]}", "ground"] and the ratio of {link.bodies[1]}'
            yield Problem(f"{where}.bodies", '"ground" is first in a link with a ratio', right)
        if (
            "ratio" not in table
            and bodies
            and len({bodies[end] for end in link.bodies if end in bodies}) == 2
        ):
            remedy = "add ratio, the motion of the first body that moves the second by one unit"
            yield Problem(where, "joins a rotation and a translation without a ratio", remedy)
    if bodies is not None:
        yield from _check_connected(spec)


def _check_pair(
    where: str, pair: tuple[str, ...] | None, bodies: Mapping[str, Motion] | None
) -> Iterator[Problem]:
    if pair and len(set(pair)) == 1:
        yield Problem(where, f"joins {_shown(pair[0])} with itself", "name two different bodies")
    for name in dict.fromkeys(pair or ()):
        if bodies is not None and name not in bodies and name != GROUND:
            yield Problem(where, f"{_shown(name)} is not a body", _suggest(name, bodies, "bodies"))


def _check_connected(spec: ChainSpec) -> Iterator[Problem]:
    neighbours: dict[str, list[str]] = {body.name: [] for body in spec.bodies}
    for link in spec.links:
        ends = [name for name in link.bodies if name in neighbours]
        if not link.bodies or not {*link.bodies} <= {*ends, GROUND}:
            return  # reported already, and it may be the link that is missed here
        for name in ends:
            neighbours[name] += ends
    parts: list[list[str]] = []
    unseen = dict.fromkeys(neighbours)
    while unseen:
        part = [next(iter(unseen))]
        del unseen[part[0]]
        for name in part:  # grows while it is walked
            for neighbour in neighbours[name]:
                if neighbour in unseen:
                    del unseen[neighbour]
                    part.append(neighbour)
        parts.append(part)
    if len(parts) > 1:
        names = " and ".join(", ".join(part) for part in parts)
        yield Problem(
            "links", f"leave {len(parts)} parts unconnected: {names}", "join them, or write a file for each"
        )


def _check_shared_names(document: _Document, spec: ChainSpec) -> Iterator[Problem]:
    """A parameter's name may be shared by elements of the same role and unit, and by nothing else."""
    tables = [document.get("chain"), *(document["bodies"] or ())]
    units_known = all(table is not None and table.get("motion", "") is not None for table in tables)
    first: dict[str, tuple[str, Parameter]] = {}
    wrong: dict[str, None] = {}
    for where, parameter in _elements(spec):
        place, other = first.setdefault(parameter.name, (where, parameter))
        what = ""
        if parameter.role != other.role:
            what = f"is a {other.role} in {place} and a {parameter.role} here"
        elif parameter.unit != other.unit and units_known:
            what = f"is in {other.unit} in {place} and in {parameter.unit} here"
        if what and where not in wrong:
            wrong[where] = None
            yield Problem(where, f'"{parameter.name}" {what}', "give the two parameters different names")
    for index, body in enumerate(spec.bodies):
        if body.actuator in first:
            what = f'"{body.actuator}" is the parameter {first[body.actuator][0]} too'
            yield Problem(f"bodies[{index}].actuator", what, "rename one of them")


def _check_sensors(
    document: _Document, spec: ChainSpec, bodies: Mapping[str, Motion] | None
) -> Iterator[Problem]:
    taken = {parameter.name: where for where, parameter in _elements(spec)}
    taken.update(
        {body.actuator: f"bodies[{i}].actuator" for i, body in enumerate(spec.bodies) if body.actuator}
    )
    for name, sensors in spec.sensor_sets.items():
        tables = document["sensors"][name]
        yield from _check_name(_path("sensors", name), name)
        if tables == {}:
            yield Problem(
                _path("sensors", name),
                "is empty",
                'add a sensor: q_m = { body = "m", measures = "position" }',
            )
        for sensor in sensors:
            where = _path("sensors", name, sensor.key)
            yield from _check_name(where, sensor.key)
            yield from _check_derived(where, sensor.key)
            if sensor.key in taken:
                yield Problem(
                    where, f'"{sensor.key}" is the name in {taken[sensor.key]} too', "rename one of them"
                )
            if tables[sensor.key] is not None:
                yield from _check_sensor(where, sensor, tables[sensor.key], spec, bodies)


def _check_sensor(
    where: str, sensor: Sensor, table: _Document, spec: ChainSpec, bodies: Mapping[str, Motion] | None
) -> Iterator[Problem]:
    if {"body", "deflection"} <= table.keys():
        yield Problem(where, "has both body and deflection", "keep one of them")
    if table.keys() <= {"measures"}:
        yield Problem(where, "has neither body nor deflection", 'add body = "m"')
    if sensor.body is not None and bodies is not None and sensor.body not in bodies:
        yield Problem(
            f"{where}.body", f"{_shown(sensor.body)} is not a body", _suggest(sensor.body, bodies, "bodies")
        )
    pair = sensor.deflection or ()
    yield from _check_pair(f"{where}.deflection", pair, bodies)
    if GROUND in pair:
        yield Problem(f"{where}.deflection", '"ground" does not move', "use body = with the other one's name")
    linked = any(link.bodies == pair for link in spec.links)  # then the ratio makes one unit of the two
    if bodies and not linked and len({bodies[name] for name in pair if name in bodies}) == 2:
        remedy = "name the bodies as a link with a ratio does, or use a sensor for each"
        yield Problem(f"{where}.deflection", "subtracts a translation from a rotation", remedy)


def _check_values(document: _Document, roles: Mapping[str, Role | None] | None) -> Iterator[Problem]:
    yield from _check_value_table(("known",), document.get("known"), roles)
    for name, values in (document.get("parameters") or {}).items():
        yield from _check_name(_path("parameters", name), name)
        yield from _check_value_table(("parameters", name), values, roles)


def _check_value_table(
    place: tuple[str, ...], values: Mapping[str, float | None] | None, roles: Mapping[str, Role | None] | None
) -> Iterator[Problem]:
    if values is None or roles is None:
        return
    for name, value in values.items():
        where, role = _path(*place, name), roles.get(name)
        if name not in roles:
            split = f"{name}_plus" in roles
            remedy = f"write {name}_plus and {name}_minus" if split else _suggest(name, roles, "parameters")
            yield Problem(where, "is not a parameter of the chain", remedy)
        if value is None or role in (None, "offset", "stiffness3"):
            continue
        if value < 0 or (value == 0 and role == "inertia"):
            limit = "greater than 0" if role == "inertia" else "0 or greater"
            yield Problem(where, f"is {_shown(value)}, but {role} must be {limit}", "correct the value")


def _check_name(where: str, text: str) -> Iterator[Problem]:
    problem = _identifier_problem(text)
    if problem:
        yield Problem(where, *problem)


def _check_derived(where: str, name: str) -> Iterator[Problem]:
    if _DERIVED.fullmatch(name):
        yield Problem(
            where, f'"{name}" is kept for a derived signal', "do not begin with sign_ or d1_, d2_, ..."
        )
