"""Exact stick and slip against an ODE solver that stops at every event: agreement, and ratios of time.

    python benchmarks/stick_slip.py

The emps300 chain (two inertias, an elastic mode, Coulomb friction on the motor) follows a slow triangle under
position and velocity control for 10 s, so that it sticks and slips; 2000 samples a second. The solver is
scipy.integrate.solve_ivp (DOP853, rtol 1e-12) with one terminal event per change between slip and stick, and
begins anew at every corner of the reference. Prints the difference of the positions relative to their peak,
and ratios of processor time, medians of interleaved runs: solver over this package with NumPy alone, and with
numba (extra "fast"). Every run of this package begins with the plant: closed loop, matrices and tables are
made again each time; only numba's machine code is there before.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec

import numpy as np
from scipy.integrate import solve_ivp

from generated import emps300_qm_qc
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.simulation.closed_loop import (
    PositionVelocityController,
    closed_loop,
    default_controller,
)
from modelgen.runtime.simulation.plant import Plant, make_plant
from modelgen.runtime.stick_slip.exact_steps import integrate
from modelgen.runtime.stick_slip.hybrid_system import Trajectory

FS = 2000.0
DURATION_S = 10.0
CORNER_S = 0.5
SPEED = 0.4  # rad/s: slow, so that the motor sticks and slips
FIRST = 1e-12  # a velocity that counts as left behind after an event


def reference(t: np.ndarray) -> np.ndarray:
    """Return a triangle: to and fro at constant speed."""
    corners = np.arange(0.0, DURATION_S + CORNER_S, CORNER_S)
    heights = np.arange(corners.size) % 2 * SPEED * CORNER_S
    return np.interp(t, corners, heights)


def by_solver(plant: Plant, loop: PositionVelocityController) -> tuple[np.ndarray, int]:
    """Return the positions at the samples, shape (N, 2), and the number of events."""
    p = plant.parameters
    J_m, J_c, K, D, F_v, F_s = (p[name] for name in ("J_m", "J_c", "K", "F_vmc", "F_vm", "F_sm"))
    kp, kv = loop.kp, loop.kv

    def free(t: float, x: np.ndarray, piece: tuple[float, float]) -> tuple[float, float]:
        link = K * (x[0] - x[1]) + D * (x[2] - x[3])
        torque = kp * (piece[0] + piece[1] * t - x[0]) - kv * x[2]
        return torque - F_v * x[2] - link, link

    def motion(t: float, x: np.ndarray, mode: int, piece: tuple[float, float]) -> list[float]:
        force, link = free(t, x, piece)
        return [x[2], x[3], (force - mode * F_s) / J_m if mode else 0.0, link / J_c]

    def stops(t: float, x: np.ndarray, mode: int, piece: tuple[float, float]) -> float:
        return float(mode * x[2])

    def breaks(t: float, x: np.ndarray, mode: int, piece: tuple[float, float]) -> float:
        return abs(free(t, x, piece)[0]) - F_s

    stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]
    breaks.terminal, breaks.direction = True, 1  # type: ignore[attr-defined]
    samples = np.arange(round(FS * DURATION_S) + 1) / FS
    found = np.zeros((samples.size, 2))
    t, x, mode, events = 0.0, np.zeros(4), 0, 0
    for corner in np.arange(CORNER_S, DURATION_S + 0.5 * CORNER_S, CORNER_S):
        start, end = reference(np.array([corner - CORNER_S, corner]))
        slope = (end - start) / CORNER_S
        piece = (start - slope * (corner - CORNER_S), slope)
        while t < corner:
            inside = (samples > t) & (samples <= corner)
            result = solve_ivp(
                motion, (t, corner), x, method="DOP853", rtol=1e-12, atol=1e-14, t_eval=samples[inside],
                events=stops if mode else breaks, args=(mode, piece), dense_output=False,
            )  # fmt: skip
            if result.t.size:
                place = np.flatnonzero(inside)[: result.t.size]
                found[place] = result.y[:2].T
            if result.status != 1:
                # the samples end on the corner itself
                t, x = corner, result.y[:, -1].copy()
                continue
            t, x = float(result.t_events[0][0]), result.y_events[0][0].copy()
            events += 1
            force = free(t, x, piece)[0]
            if mode:
                x[2] = 0.0
                mode = 0 if abs(force) <= F_s else int(np.sign(force))
            else:
                mode = int(np.sign(force))
                x[2] = mode * FIRST
    return found, events


def seconds(work: Callable[[], object]) -> float:
    """Return the processor time of one call."""
    start = time.process_time()
    work()
    return time.process_time() - start


def main() -> None:
    """Print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--repeats", type=int, default=3)
    repeats = parser.parse_args().repeats
    model = model_from_module(emps300_qm_qc)
    nodes = np.arange(round(FS * DURATION_S) + 1) / FS
    ways = [False, True] if find_spec("numba") else [False]
    for values in ("table_2", "light"):
        plant = make_plant(model, model.parameter_sets[values])
        loop = default_controller(plant)
        inputs = loop.kp * reference(nodes)[:, None]
        compare(values, plant, loop, inputs, ways, repeats)


def compare(
    values: str,
    plant: Plant,
    loop: PositionVelocityController,
    inputs: np.ndarray,
    ways: list[bool],
    repeats: int,
) -> None:
    """Print agreement and ratios for one set of parameters."""

    def ours(compiled: bool) -> Trajectory:
        return integrate(closed_loop(plant, loop), np.zeros(4), inputs, 1.0 / FS, compiled=compiled)

    solved, events = by_solver(plant, loop)
    for compiled in ways:
        path = ours(compiled)
        error = np.abs(path.states[:, :2] - solved).max() / np.abs(solved).max()
        name = "with numba" if compiled else "NumPy only"
        print(f"{values}, {name}: {len(path.events)} events (solver {events}), ", end="")
        print(f"largest difference of a position {error:.1e} of the peak  (wanted: at most 1e-9)")
    times: dict[bool | None, list[float]] = {None: [], False: [], True: []}
    for _ in range(repeats):
        times[None].append(seconds(partial(by_solver, plant, loop)))
        for compiled in ways:
            times[compiled] += [seconds(partial(ours, compiled)) for _ in range(5)]
    for compiled, wanted in zip(ways, (20, 500), strict=False):
        ratio = statistics.median(times[None]) / statistics.median(times[compiled])
        name = "with numba" if compiled else "NumPy only"
        print(f"{values}, solver / {name}: {ratio:.0f}  (wanted: at least {wanted})")


if __name__ == "__main__":
    main()
