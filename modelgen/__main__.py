"""`python -m modelgen` and the script `modelgen` are the command line."""

from __future__ import annotations

import sys

from modelgen.cli.standard_streams import usable_streams


def run() -> None:
    """Run the command line; Ctrl-C while it is still being imported ends it as it does later."""
    with usable_streams():
        try:
            from modelgen.cli.main import main

            main()
        except KeyboardInterrupt:
            print("interrupted", file=sys.stderr)
            sys.exit(130)


if __name__ == "__main__":
    run()
