"""Keyword options that a function takes as one typed table, `**options: Unpack[...]`, with their defaults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar, cast

Options = TypeVar("Options", bound=Mapping[str, object])


def with_defaults(function: str, given: Options, kind: type[Options], defaults: Options) -> Options:
    """Return the options that exist, with their defaults replaced by what the caller passed.

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
    return cast(Options, {**dict.fromkeys(kind.__annotations__), **defaults, **given})
