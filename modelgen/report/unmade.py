"""Parts of a report that could not be made: a sentence in their place, and the rest of the page as it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from modelgen.errors import ModelgenError

T = TypeVar("T")
U = TypeVar("U")


class Unmade(dict[str, str]):
    """Maps the id of a section to why it could not be made."""

    def attempt(self, section: str, make: Callable[[], T], otherwise: U) -> T | U:
        """Return what `make` gives; `otherwise` where it refuses or its numbers fail, and keep the reason."""
        try:
            return make()
        except ModelgenError as error:
            self[section] = f"Not made: {'; '.join(str(problem) for problem in error.problems)}."
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            self[section] = f"Not made: its numbers fail ({error})."
        return otherwise
