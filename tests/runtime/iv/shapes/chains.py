"""Two bodies on a spring, and a third one behind them; records of the two with a link of any kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.integrate import solve_ivp

from modelgen.array_types import FloatArray
from modelgen.cli.candidates import spec_model
from modelgen.runtime.filter_choice.filter_choice import choose_filter
from modelgen.runtime.iv.companion_simulation import Simulated, simulated_beside
from modelgen.runtime.records.record import Record
from modelgen.spec.load import parse_spec
from tests.runtime.two_mass_records import SMALL, TRUTH, two_mass_records

TWO = """
[chain]
name = "two"
motion = "rotation"
[[bodies]]
name = "m"
inertia = "J_m"
viscous = "F_vm"
coulomb = "F_sm"
actuator = "T"
[[bodies]]
name = "c"
inertia = "J_c"
[[links]]
bodies = ["m", "c"]
stiffness = "K"
damping = "D"
"""
FURTHER = """
[[bodies]]
name = "x"
inertia = "J_x"
[[links]]
bodies = ["c", "x"]
stiffness = "K_x"
damping = "D_x"
"""
BOTH_SEEN = """
[sensors.s]
q_m = { body = "m", measures = "position" }
q_c = { body = "c", measures = "position" }
"""
SHORT = spec_model(parse_spec(TWO + BOTH_SEEN, "two.toml"), "s")
LONG = spec_model(parse_spec(TWO + FURTHER + BOTH_SEEN, "three.toml"), "s")
KNOWN = {"J_m": 2e-3, "F_vm": 0.02, "F_sm": 0.4, "J_c": 6e-3, "K": 1500.0, "D": 0.6}
MASS = {"J_x": 5e-4, "K_x": 400.0, "D_x": 0.03}
FS, NOISE = 2000.0, {"T": 2e-3, "q_m": 3e-6, "q_c": 3e-6}
# How far `there_and_back` goes, in rad.
TRAVEL = 24.0
# Of the motor's position, the deflection and a further state: the force of a link, and the state's rate.
Link = Callable[[float, float, float], tuple[float, float]]


def simulated_alone() -> Simulated:
    record = two_mass_records(noise=0.0)[0].part(0, 2000, "short")
    return simulated_beside(SMALL, TRUTH, record, choose_filter(SMALL, (record,)))


def noisy(signals: Mapping[str, FloatArray], seed: int, name: str, times: float = 1.0) -> Record:
    """Return a record of channels with `times` the noise of all of them."""
    rng = np.random.default_rng([seed, len(name)])
    read = {
        key: signals[key] + times * level * rng.standard_normal(len(signals[key]))
        for key, level in NOISE.items()
    }
    return Record(read, FS, name, name)


def there_and_back(link: Link, times: float) -> Record:
    """Return a motion there and back, a multisine on it, with a link of one's own beside its damper."""
    p, t = KNOWN, np.arange(8000) / FS
    lines = 2.0 * np.pi * np.arange(4.0, 160.0, 3.0)
    phases = np.random.default_rng(5).uniform(0.0, 6.3, len(lines))
    speed, turn, rest = TRAVEL / 2.0, 2.0, 0.01  # rad/s, s; about the turn the speed changes within `rest`

    def torque(at: FloatArray | float) -> FloatArray:
        way = np.tanh((turn - np.asarray(at)) / rest)
        drive = (p["F_vm"] * speed + p["F_sm"]) * way - speed * (p["J_m"] + p["J_c"]) / rest * (1.0 - way**2)
        return np.asarray(drive + 0.35 * np.sum(np.sin(np.multiply.outer(at, lines) + phases), axis=-1))

    def slope(at: float, x: FloatArray) -> list[float]:
        q_m, q_c, v_m, v_c, more = x
        force, rate = link(q_m, q_m - q_c, more)
        force += p["D"] * (v_m - v_c)
        friction = p["F_vm"] * v_m + p["F_sm"] * np.tanh(v_m / 1e-2)
        return [v_m, v_c, (float(torque(at)) - friction - force) / p["J_m"], force / p["J_c"], rate]

    exact = {"rtol": 1e-8, "atol": 1e-10, "max_step": 1e-3}
    x = solve_ivp(slope, (0.0, t[-1]), [0.0, 0.0, speed, speed, 0.0], t_eval=t, **exact).y
    return noisy({"q_m": x[0], "q_c": x[1], "T": torque(t)}, 0, "there and back", times)
