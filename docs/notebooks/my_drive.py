# %% [markdown]
# # My drive in twenty minutes
#
# A motor turns a load through a 10:1 gear and a shaft that gives way. Both have an encoder; the drive writes
# a log. Nobody knows the load's inertia, nor why it rings. From the log to numbers, and to a verdict on them.
#
# The drive, in fifteen lines of TOML:

# %%
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from IPython.display import SVG

import modelgen
from modelgen.cli.import_file import describe_file, import_lines
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.records.mapping_file import load_mapping
from modelgen.runtime.records.read_record import read_record

folder = Path(mkdtemp())
(folder / "drive.toml").write_text("""
chain = { name = "drive", title = "Motor, gear, shaft, load", motion = "rotation" }
bodies = [
    { name = "m", inertia = "J_m", viscous = "F_vm", coulomb = "F_sm", actuator = "T" },
    { name = "load", inertia = "J_l", viscous = "F_vl" },
]
links = [{ bodies = ["m", "load"], stiffness = "K", damping = "D", ratio = 10 }]

[sensors.encoders]
q_m = { body = "m", measures = "position" }
q_load = { body = "load", measures = "position" }
""")
spec = modelgen.load_spec(folder / "drive.toml")
model = model_from_text(modelgen.generate(spec, "encoders"), "drive_encoders")
SVG(modelgen.draw_chain(spec))

# %% [markdown]
# ## The log
#
# Here a simulation plays the drive, so that the right answer is known at the end. What it writes is what a
# drive writes: lines of metadata, semicolons, decimal commas, milliseconds, degrees. The torque reaches the
# log half a millisecond late, and the load's encoder counts the other way round.

# %%
truth = {"J_m": 4e-4, "F_vm": 2e-3, "F_sm": 0.06, "J_l": 0.05, "F_vl": 0.08, "K": 900.0, "D": 0.6}
FS_HZ, LATE = 2000.0, 1  # samples
noise = {"q_m": 2e-5, "q_load": 2e-6, "T": 1e-3}


def log(kind, seed):
    """Write the log of one experiment and return its path."""
    done = modelgen.simulate(model, truth, kind, fs=FS_HZ, duration_s=6.0, noise=noise, seed=seed).record
    q_m, q_load, torque = (done.signals[key] for key in ("q_m", "q_load", "T"))
    torque = np.r_[np.repeat(torque[0], LATE), torque[:-LATE]]
    rows = zip(
        np.arange(done.n) * 1e3 / FS_HZ,
        np.degrees(q_m),
        -np.degrees(q_load),
        torque,
        0.98 * torque,
        strict=True,
    )
    lines = [";".join(f"{value:.7g}" for value in row).replace(".", ",") for row in rows]
    head = [
        "Antrieb 4711;;;;",
        "Firmware 3.2;;;;",
        "",
        "Zeit;Pos Motor;Pos Load;T_ist;T_soll",
        "ms;°;°;Nm;Nm",
    ]
    path = folder / f"{kind}.csv"
    path.write_text("\n".join([*head, *lines]), encoding="cp1252")
    return path


logs = [log(kind, seed) for seed, kind in enumerate(("chirp", "trapezoid"))]
print("\n".join(logs[0].read_text(encoding="cp1252").splitlines()[:8]))

# %% [markdown]
# ## Import
#
# `modelgen import chirp.csv --model drive_encoders.py` says what it took for what, and writes a proposal to
# be checked. From the trapezoid it sees that the load's encoder counts backwards; of the two torques it takes
# the one that was measured.

# %%
described = describe_file(logs[1], model)
for line in import_lines(described, None, None)[1:]:
    print(line)

# %%
(folder / "map.toml").write_text(described["mapping"], encoding="utf-8")
mapping = load_mapping(folder / "map.toml")
records = [
    read_record(path, mapping.columns, mapping.scales, time=mapping.time, time_unit=mapping.time_unit)
    for path in logs
]

# %% [markdown]
# ## Identify
#
# `modelgen identify chirp.csv trapezoid.csv --model drive_encoders.py --map-file map.toml`, with a page that
# holds everything where `--report report.html` asks for it. The late torque needs no option: the delay is
# estimated with the rest.

# %%
estimate = modelgen.identify(model, records)
print(estimate.answer())

# %% [markdown]
# ## Look
#
# Every row as measured, and as the identified numbers rebuild it:

# %%
axes = estimate.plot.fit(records)

# %% [markdown]
# ## Verdict
#
# The program's own, and then the one that only a simulation allows: the delay was found, and every number
# lies where its interval says.

# %%
print(f"{estimate.verdict.word}: {'; '.join(estimate.verdict.reasons)}")

# %%
for name, value in truth.items():
    low, high = estimate.conf_int(0.001)[name]
    print(f"{name:5} true {value:8.5g}   found {estimate.params[name]:8.5g}   99.9 % {low:.5g} to {high:.5g}")
    assert low <= value <= high, name
delay = estimate.delays["T"]
print(f"torque late by {1e3 * delay:.3f} ms")
assert abs(delay * FS_HZ - LATE) < 0.1
assert described["mapping"].count("negate = true") == 1
assert mapping.columns["T"] == "T_ist"
