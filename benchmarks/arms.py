"""Derivation of arms: time and operations for known robots, growth to 20 joints, speed of the regressor.

    .venv/bin/python benchmarks/arms.py

Processor time, the best of five; base parameters with their proof. Operations: of the regressor of base
parameters, of inverse and direct dynamics with base parameters.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from modelgen.render.arms.arm_target import arm_target_files
from modelgen.render.arms.arm_writer import arm_module
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from modelgen.symbolic.arms.dynamics.direct_dynamics import direct_dynamics
from modelgen.symbolic.arms.dynamics.inverse_dynamics import inverse_dynamics
from modelgen.symbolic.arms.dynamics.lagrange import newton_minus_lagrange, vanishes
from modelgen.symbolic.arms.expressions.graph import Graph
from tests.symbolic.arms.made_arms import ROBOTS, serial, tx40
from tests.symbolic.arms.pinocchio_arms import pinocchio_model, random_parameters

SAMPLES = 20_000


def main() -> None:
    arms = {name: serial(rows, drive=True) for name, rows in ROBOTS.items()}
    arms["tx40"] = tx40()
    for count in (8, 12, 16, 20):
        rows = [(90 * (-1) ** k, 0.1 * (k % 3), 0, 0.2 * (k % 2)) for k in range(count)]
        arms[f"{count} joints"] = serial(rows, drive=True)
    print(f"{'arm':10} {'joints':>6} {'rows [ms]':>9} {'base [ms]':>9} {'base':>5} {'regressor':>9} "
          f"{'inverse':>7} {'direct':>7} {'Newton = Lagrange [ms]':>22}")  # fmt: skip
    for name, spec in arms.items():
        print(line(name, spec), flush=True)
    print(
        "\nregressor of base parameters on one thread [samples/s]; peer: pinocchio called for every sample;\n"
        "C99: sample by sample"
    )
    for name in ("puma", "tx40", "panda"):
        print(f"{name:10} {speed(arms[name])}", flush=True)


def line(name: str, spec: ArmSpec) -> str:
    rows = arm_rows(spec)
    model = arm_base_model(rows)
    kept = [entry for (_, column), entry in rows.entries.items() if column in model.columns]
    graph = Graph()
    inverse = inverse_dynamics(graph, spec, model.regrouped)
    direct = direct_dynamics(graph, spec, model.regrouped)
    proof = best(lambda: proven(spec), 1)
    return (
        f"{name:10} {len(spec.moving):6} {best(lambda: arm_rows(spec)):9.1f} "
        f"{best(lambda: arm_base_model(rows)):9.0f} {len(model.base):5} {rows.graph.operations(kept):9} "
        f"{graph.operations(list(inverse.values())):7} "
        f"{graph.operations(list(direct.accelerations.values())):7} {proof:22.0f}"
    )


def speed(spec: ArmSpec) -> str:
    """Return samples a second in blocks, with all entries kept, dense, and of pinocchio if it is there."""
    module: dict[str, Any] = {}
    exec(compile(arm_module(arm_base_model(arm_rows(spec))), "module", "exec"), module)
    count, rng = SAMPLES, np.random.default_rng(1)
    signals = {key: rng.standard_normal(count) for key in module["SIGNALS"]}
    out = np.empty((len(module["ENTRIES"]), count))
    found = {
        "blocks": best(lambda: [None for _ in module["entry_blocks"](signals)], 9),
        "entries": best(lambda: module["entries"](signals, out), 9),
        "dense": best(lambda: module["regressor"](signals), 5),
    }
    try:
        import pinocchio as pin
    except ImportError:
        return shown(found, c_speed(spec))
    bare = replace(spec, joints=tuple(j for j in spec.joints if j.kind != "fixed"))
    model = pinocchio_model(bare, random_parameters(bare, rng))
    data, motion = model.createData(), rng.standard_normal((count, 3, model.nv))

    def loop() -> None:
        for q, v, a in motion:
            pin.computeJointTorqueRegressor(model, data, q, v, a)

    found["peer"] = best(loop, 5)
    return shown(found, c_speed(spec)) + f"  blocks over peer {found['peer'] / found['blocks']:.1f}"


def shown(found: dict[str, float], in_c: float | None) -> str:
    rates = {what: 1e3 * SAMPLES / ms for what, ms in found.items()} | ({"C99": in_c} if in_c else {})
    return "  ".join(f"{what} {rate:9.0f}" for what, rate in rates.items())


MAIN = """
#include <stdio.h>
#include <time.h>
#include "{name}.h"
static {name}_signals s[1000];
int main(void) {{
  double e[{name}_ENTRIES], total = 0.0, best = 1e9;
  double *p = (double *)s;
  for (size_t k = 0; k < sizeof s / sizeof(double); k++)
    p[k] = 1e-4 * (double)((k * 2654435761u) % 20000) - 1.0;
  for (int trial = 0; trial < 9; trial++) {{
    clock_t start = clock();
    for (int round = 0; round < 50; round++)
      for (int k = 0; k < 1000; k++) {{ {name}_entries(&s[k], e); total += e[round]; }}
    double took = (double)(clock() - start) / CLOCKS_PER_SEC;
    if (took < best) best = took;
  }}
  printf("%.9g %g", best, total);
  return 0;
}}
"""


def c_speed(spec: ArmSpec) -> float | None:
    """Return samples a second of the entries in C99, sample by sample, or None without a compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        files = arm_target_files(spec, "", "c")
        name = next(iter(files)).partition(".")[0]
        for file, text in {**files, "main.c": MAIN.format(name=name)}.items():
            (Path(folder) / file).write_text(text)
        flags = ["-std=c99", "-O3", "-march=native", "-o", "main", "main.c", f"{name}.c", "-lm"]
        subprocess.run([compiler, *flags], cwd=folder, check=True)
        done = subprocess.run([Path(folder) / "main"], capture_output=True, check=True, text=True)
    return 50_000 / float(done.stdout.split()[0])


def proven(spec: ArmSpec) -> None:
    graph, differences = newton_minus_lagrange(spec)
    assert vanishes(graph, differences, list(spec.lengths))


def best(work: Callable[[], object], times: int = 5) -> float:
    """Return the least processor time [ms]."""
    found = []
    for _ in range(times):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return 1e3 * min(found)


if __name__ == "__main__":
    main()
