"""What a format writes, and what it makes of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from modelgen.runtime.exports.mechanics import Mechanics
from modelgen.runtime.exports.values import Values
from modelgen.runtime.model.model import Model


@dataclass(frozen=True)
class Case:
    """What a format writes: a model as a mechanism, and values of its parameters."""

    model: Model
    mechanics: Mechanics
    values: Values

    @property
    def name(self) -> str:
        """The name of the generated module."""
        return f"{self.model.chain}_{self.model.sensor_set}"


@dataclass(frozen=True)
class Written:
    """What a format made: the contents of files by what is added to the name, and what they cannot say."""

    files: Mapping[str, bytes]
    notes: tuple[str, ...] = ()


def per_sample(case: Case, text: Callable[[Mapping[str, float]], str]) -> dict[str, bytes]:
    """Return a file for the nominal values, and one for every sample."""
    width = len(str(len(case.values.samples)))
    files = {"": text(case.values.nominal).encode()}
    for number, sample in enumerate(case.values.samples, 1):
        files[f"_sample_{number:0{max(width, 3)}d}"] = text(sample).encode()
    return files
