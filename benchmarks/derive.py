"""What deriving and writing a model costs: ratios measured in one run, after imports.

    python benchmarks/derive.py

Prints (a) the rows of 100 bodies against compile() of the module text they lead to, (b) growth exponents of
derivation and rendering in the number of bodies, (c) the derivation of 50 bodies against SymPy's
LagrangesMethod on the same equations, and (d) the elimination of up to four neighbouring bodies.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import sympy as sp
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

from modelgen.render.view import model_view
from modelgen.render.writer import render
from modelgen.spec.chain import ChainSpec
from modelgen.spec.load import parse_spec
from modelgen.symbolic.base_parameters import base_model
from modelgen.symbolic.equations.newton import motion_equations
from modelgen.symbolic.equations.row import IdentificationRows
from modelgen.symbolic.rows import identification_rows


def chain(bodies: int, sensed: range | list[int] | None = None) -> ChainSpec:
    """Return a chain with friction on every body and damping in every link, positions sensed."""
    lines = ["[chain]", 'name = "c"', 'motion = "rotation"']
    for i in range(bodies):
        lines += ["[[bodies]]", f'name = "b{i}"', f'inertia = "J{i}"', f'viscous = "F{i}"']
        lines += ['actuator = "G"'] if i == 0 else []
    for i in range(bodies - 1):
        lines += ["[[links]]", f'bodies = ["b{i}", "b{i + 1}"]', f'stiffness = "K{i}"', f'damping = "D{i}"']
    lines += ["[sensors.s]"]
    lines += [f'q{i} = {{ body = "b{i}", measures = "position" }}' for i in sensed or range(bodies)]
    return parse_spec("\n".join(lines), "c.toml")


def rows_of(spec: ChainSpec) -> IdentificationRows:
    """Derive the rows of a chain: what (a) to (c) time."""
    return identification_rows(motion_equations(spec), "s")


def seconds(work: Callable[[], object], repeats: int) -> float:
    """Return the median time of a call."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def lagrange(bodies: int) -> Callable[[], object]:
    """Return the derivation of the same linear chain by sympy.physics.mechanics."""
    q = [dynamicsymbols(f"q{i}") for i in range(bodies)]
    t = dynamicsymbols._t
    J, F, K, D = (sp.symbols(f"{name}0:{bodies}") for name in "JFKD")
    kinetic = sum(J[i] * q[i].diff(t) ** 2 for i in range(bodies)) / 2
    potential = sum(K[i] * (q[i] - q[i + 1]) ** 2 for i in range(bodies - 1)) / 2
    rayleigh = sum(F[i] * q[i].diff(t) ** 2 for i in range(bodies)) / 2
    rayleigh += sum(D[i] * (q[i].diff(t) - q[i + 1].diff(t)) ** 2 for i in range(bodies - 1)) / 2

    def derive() -> object:
        equations = LagrangesMethod(kinetic - potential, q).form_lagranges_equations()
        return equations + sp.Matrix([rayleigh.diff(v.diff(t)) for v in q])

    return derive


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument(
        "--largest", type=int, default=10_000, help="bodies of the longest chain, at least 300"
    )
    largest = parser.parse_args().largest

    spec = chain(100)
    text = render(model_view(base_model(rows_of(spec))))
    pairs = [
        (seconds(lambda: rows_of(spec), 1), seconds(lambda: compile(text, "m.py", "exec"), 1))
        for _ in range(21)
    ]
    ratio = statistics.median(rows / compiled for rows, compiled in pairs)
    print(f"(a) rows of 100 bodies / compile() of the module text: {ratio:.2f}  (wanted: at most 1)")

    sizes = [n for n in (100, 300, 1000, 3000, 10_000) if n <= max(largest, 300)]
    specs = [chain_of(n) for n in sizes]
    rows_times = [seconds(lambda spec=spec: rows_of(spec), 5) for spec in specs]
    grown = exponent(sizes, rows_times)
    print(f"(b) derivation, {sizes[0]} to {sizes[-1]} bodies: exponent {grown:.2f}  (wanted: at most 1.15)")
    few = [n for n in sizes if n <= 1000]
    models = [base_model(rows_of(chain_of(n))) for n in few]
    texts = [seconds(lambda model=model: render(model_view(model)), 3) for model in models]
    print(f"    rendering, {few[0]} to {few[-1]} bodies: exponent {exponent(few, texts):.2f}")

    fifty = chain(50)
    ours, theirs = seconds(lambda: rows_of(fifty), 21), seconds(lagrange(50), 1)
    print(f"(c) LagrangesMethod / rows, 50 bodies: {theirs / ours:.0f}  (wanted: at least 1000)")

    for unseen in (1, 2, 3, 4):
        one = seconds(lambda n=unseen: rows_of(chain(n + 1, [0])), 1)
        two = seconds(lambda n=unseen: rows_of(chain(n + 2, [0, n + 1])), 1)
        print(
            f"(d) {unseen} unseen neighbours: {one:.2f} s at the end of a chain, {two:.2f} s inside  (10 s)"
        )


def chain_of(bodies: int) -> ChainSpec:
    """Return a long chain; the reader's limit on the size of a file does not concern the derivation."""
    import modelgen.spec.load

    modelgen.spec.load.SPEC = replace(modelgen.spec.load.SPEC, largest=10**9)
    return chain(bodies)


def exponent(sizes: list[int], times: list[float]) -> float:
    """Return the slope of log time over log size, by least squares."""
    x, y = [math.log(n) for n in sizes], [math.log(t) for t in times]
    mean_x, mean_y = statistics.mean(x), statistics.mean(y)
    covariance = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True))
    return covariance / sum((a - mean_x) ** 2 for a in x)


if __name__ == "__main__":
    main()
