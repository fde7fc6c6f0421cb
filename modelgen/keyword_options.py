"""Keyword options that a function takes as one typed table, `**options: Unpack[...]`, with their defaults."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral
from typing import Any, TypeVar, cast

from modelgen.errors import DataError

Options = TypeVar("Options", bound=Mapping[str, object])


def with_defaults(function: str, given: Options, kind: type[Options], defaults: Options) -> Options:
    """Return the options that exist, with their defaults replaced by what the caller passed.

    Of an option that takes several texts a single one is meant as such, and not as its letters.

    Parameters
    ----------
    function : str
        Name of the function that was called, for the message.
    given : mapping of str to object
        The keyword arguments.
    kind : type
        The table: its fields are the options that exist.
    defaults : mapping of str to object
        Defaults; options without any are None.

    Raises
    ------
    TypeError
        For an option that does not exist, as Python raises it for an unknown keyword argument.
    """
    unknown = next((name for name in given if name not in kind.__annotations__), None)
    if unknown is not None:
        raise TypeError(f"{function}() got an unexpected keyword argument {unknown!r}")
    texts = [name for name, of in kind.__annotations__.items() if "Sequence[str]" in str(of)]
    alone = {name: texts_of(given[name]) for name in texts if given.get(name) is not None}
    return cast(Options, {**dict.fromkeys(kind.__annotations__), **defaults, **given, **alone})


def texts_of(given: Any) -> Any:
    """Return a single text as a sequence of one, and not of its letters; anything else as it is."""
    return (given,) if isinstance(given, str) else given


def check_named_values(where: str, values: object) -> None:
    """Refuse what is no mapping of names to numbers.

    Raises
    ------
    DataError
    """
    if not isinstance(values, Mapping):
        remedy = 'give a mapping, such as {"J": 0.02}, in SI'
        raise DataError.at(where, f"is of the type {type(values).__name__}", remedy)


def refuse_other(name: str, value: object, kind: type, module: str = "modelgen") -> None:
    """Refuse a value that is neither absent nor of this class, which is found in a module.

    Raises
    ------
    DataError
    """
    if value is not None and not isinstance(value, kind):
        remedy = f"give a {module}.{kind.__name__}"
        raise DataError.at(name, f"is of the type {type(value).__name__}", remedy)


def check_seed(seed: object) -> None:
    """Refuse what is no seed of random numbers.

    Raises
    ------
    DataError
    """
    if isinstance(seed, bool) or not isinstance(seed, Integral) or int(seed) < 0:
        raise DataError.at("seed", f"is {seed!r}", "give a whole number, 0 or more")
