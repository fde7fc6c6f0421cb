"""`modelgen demo`: the paper end to end."""

from __future__ import annotations

from pathlib import Path

from modelgen.cli.options import Json
from modelgen.cli.output import print_json


def demo(as_json: Json = False) -> None:
    """Show the paper end to end: derive, simulate, identify.

    Modules, two records and the figures go to the folder modelgen_demo.
    """
    from modelgen.cli.demo.run import run_demo
    from modelgen.cli.demo.tables import demo_tables
    from modelgen.cli.tables import console

    found = run_demo(Path("modelgen_demo"))
    if as_json:
        print_json(found)
    else:
        console().print(demo_tables(found))
