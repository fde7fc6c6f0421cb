"""Parameters of a chain that are known in addition to those of its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from modelgen.errors import Problem, SpecError
from modelgen.spec.chain import ChainSpec
from modelgen.spec.references import check_value_table


def with_known(chain: ChainSpec, values: Mapping[str, float], where: str) -> ChainSpec:
    """Return the chain with these values (SI) known as well, in place of those in its table [known].

    Raises
    ------
    SpecError
        With one problem per name that is no parameter, and per value that nature does not have; `where` is
        the file that they stand in.
    """
    roles = {parameter.name: parameter.role for parameter in chain.parameters}
    problems = list(check_value_table(("known",), values, roles))
    if problems:
        raise SpecError(*(Problem(f"{where}: {one.where}", one.what, one.remedy) for one in problems))
    return replace(chain, known={**chain.known, **values})
