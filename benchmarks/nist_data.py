"""The linear regressions of the NIST StRD, in decimals as NIST prints them, and their exact solution."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
FILE = Path(__file__).with_name("nist_strd.toml")


@dataclass(frozen=True)
class Problem:
    """One regression: exact rows of the regressor and measurements, with what NIST certifies."""

    name: str
    rows: tuple[tuple[Fraction, ...], ...]
    measured: tuple[Fraction, ...]
    coefficients: tuple[Fraction, ...]
    deviations: tuple[Fraction, ...]

    @property
    def W(self) -> FloatArray:
        """The regressor, correctly rounded: shape (r, c)."""
        return np.array([[float(value) for value in row] for row in self.rows])

    @property
    def Y(self) -> FloatArray:
        """The measurements, shape (r,)."""
        return np.array([float(value) for value in self.measured])


def problems() -> tuple[Problem, ...]:
    """Return all regressions of the file."""
    return tuple(_problem(name, table) for name, table in tomllib.loads(FILE.read_text()).items())


def _problem(name: str, table: dict[str, object]) -> Problem:
    lines = [[Fraction(cell) for cell in line.split()] for line in str(table["data"]).split("\n")]
    powers = table.get("powers")
    return Problem(
        name,
        tuple(
            tuple(line[1] ** power for power in powers)
            if isinstance(powers, list)
            else (Fraction(1), *line[1:])
            for line in lines
        ),
        tuple(line[0] for line in lines),
        tuple(map(Fraction, str(table["coefficients"]).split())),
        tuple(map(Fraction, str(table["deviations"]).split())),
    )


def exact_solution(problem: Problem) -> tuple[list[Fraction], list[Fraction]]:
    """Return the coefficients and their variances by the normal equations in exact fractions."""
    columns = list(zip(*problem.rows, strict=True))
    c = len(columns)
    system = [
        [sum((a * b for a, b in zip(left, right, strict=True)), Fraction(0)) for right in columns]
        + [sum((a * b for a, b in zip(left, problem.measured, strict=True)), Fraction(0))]
        + [Fraction(int(i == j)) for j in range(c)]
        for i, left in enumerate(columns)
    ]
    for i in range(c):  # positive definite: no pivoting needed
        system[i] = [value / system[i][i] for value in system[i]]
        for j in range(c):
            if j != i:
                factor = system[j][i]
                system[j] = [a - factor * b for a, b in zip(system[j], system[i], strict=True)]
    x = [row[c] for row in system]
    residual = [
        y - sum((a * b for a, b in zip(row, x, strict=True)), Fraction(0))
        for row, y in zip(problem.rows, problem.measured, strict=True)
    ]
    variance = sum((e * e for e in residual), Fraction(0)) / (len(residual) - c)
    return x, [variance * system[i][c + 1 + i] for i in range(c)]
