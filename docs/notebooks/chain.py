# %% [markdown]
# # From a chain to its parameters
#
# A motor drives a load through a flexible coupling: ten lines of TOML, and the equations that can be
# identified follow from them.

# %%
from pathlib import Path
from tempfile import mkdtemp

import modelgen

folder = Path(mkdtemp())
(folder / "axis.toml").write_text("""
chain = { name = "axis", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "torque" },
    { name = "c", inertia = "J_c" },
]
links = [{ bodies = ["m", "c"], stiffness = "K", damping = "D" }]

[sensors.encoder_and_accelerometer]
q_m = { body = "m", measures = "position" }
a_c = { body = "c", measures = "acceleration" }

[parameters.bench]
J_m = 1e-5
F_vm = 2e-5
F_sm = 5e-3
J_c = 7e-7
K = 0.4
D = 4e-5
""")
spec = modelgen.load_spec(folder / "axis.toml")

# %% [markdown]
# What these sensors give: rows of the equations, differentiated until every coordinate in them is measured,
# and the parameters that they determine. A prime is one differentiation.

# %%
base = modelgen.build(spec, "encoder_and_accelerometer")
for row in base.rows.rows:
    print(row.name + "'" * row.differentiated)
print("identifiable:", ", ".join(base.identifiable))

# %% [markdown]
# The model is a module that needs NumPy alone:

# %%
path = folder / "axis_encoder_and_accelerometer.py"
path.write_text(modelgen.generate(spec, "encoder_and_accelerometer"))
model = modelgen.load_model(path)
print(path.read_text()[:300])

# %% [markdown]
# A record. On a bench you would measure one; here the chain is simulated in closed loop, with stick and
# slip in the motor and noise on every channel (rad, rad/s², N m rms).

# %%
noise = {"q_m": 2e-6, "a_c": 0.5, "torque": 1e-4}
records = [
    modelgen.simulate(
        model, spec.parameter_sets["bench"], kind, duration_s=4.0, noise=noise, seed=seed
    ).record
    for seed, kind in enumerate(("chirp", "trapezoid"))
]

# %%
estimate = modelgen.identify(model, records)
estimate

# %% [markdown]
# Against the truth, in standard deviations as they are claimed:

# %%
for name, true in spec.parameter_sets["bench"].items():
    value, std = estimate.params[name], estimate.bse[name]
    print(f"{name:5} {value:.6g}, {100 * (value - true) / true:+.3f} %, {(value - true) / std:+.2f} sd")
    assert abs(value - true) < 4 * std

# %% [markdown]
# And the torque, measured and rebuilt from the other channels by the identified parameters:

# %%
estimate.plot.fit(records)
