"""Two bodies on a spring, and a third one behind them."""

from __future__ import annotations

from modelgen.cli.candidates import spec_model
from modelgen.spec.load import parse_spec

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
