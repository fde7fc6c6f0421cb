"""`python -m modelgen` is the command line."""

from __future__ import annotations

from modelgen.cli import main

if __name__ == "__main__":
    main()
