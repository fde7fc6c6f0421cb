# %% [markdown]
# # Which sensors do I need for my robot?
#
# A robot whose joints are elastic (harmonic drives, long shafts, belts) has a motor and a link on either
# side of a spring. Sensors may be on one side, on both, or measure the torque between. What each set finds
# is algebra; how well it finds it is told here by identifying what the sensors would read along a planned
# motion, before anything is built.

# %%
from dataclasses import replace

import numpy as np
import pandas

from modelgen.errors import ModelgenError
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.planning.arms.elastic_motion import elastic_motion, predicted_estimates
from modelgen.spec.arms.load import load_arm
from modelgen.spec.load import catalog_path
from modelgen.symbolic.arms.arm_sensor_sets import arm_overview, with_usual_sets

arm = with_usual_sets(load_arm(catalog_path("elastic_two_link")))
print(arm.title)

# %% [markdown]
# ## What each set can find
#
# *by springs* counts the links, or motors, that no sensor sees: there the other side and the spring say where
# they are, and readings are differentiated up to four times.

# %%
pandas.DataFrame(
    [
        {
            "sensors": one.name,
            "rows": len(one.model.rows.names) - len(one.model.rows.estimated) if one.model else "none",
            "by springs": len(one.model.rows.estimated) if one.model else "–",
            "base parameters": len(one.model.base) if one.model else 0,
            "lost": ", ".join(name.split(" ")[0] for name in one.lost) or "–",
        }
        for one in arm_overview(arm, arm.sensor_sets)
    ]
).set_index("sensors")

# %% [markdown]
# ## How well, in slow and in fast motion
#
# Encoders of 5e-6 rad, torques of 0.1 N m (standard deviations), 1 kHz, 12 s. Half of a 95 % interval in %,
# and a dash where there is no number. Slow motion hardly deflects the springs: from encoders on one side
# alone it gives stiffness to some tens of percent, or not at all.

# %%
values = arm.parameter_sets["nominal"]
sets = {name.replace(",", "").replace(" ", "_"): sensors for name, sensors in arm.sensor_sets.items()}
arm = replace(arm, sensor_sets=sets)
models = {}
for name in arm.sensor_sets:
    ((file, text),) = arm_files(arm, name).items()
    models[name] = model_from_text(text, file)
times = np.arange(0.0, 12.0, 1e-3)


def motion(highest_hz: float) -> dict[str, np.ndarray]:
    """Sums of five sines for every joint, the fastest of `highest_hz`."""
    rng = np.random.default_rng(1)
    parts = [(0.5 / k, 2.0 * np.pi * highest_hz * k / 5.0) for k in range(1, 6)]
    return {
        joint.name: sum(size * np.sin(w * times + rng.uniform(0.0, 6.0)) for size, w in parts)
        for joint in arm.moving
    }


def percent(found: object, name: str) -> str:
    """Half of the interval of a parameter, relative to its value."""
    if isinstance(found, ModelgenError) or name not in found.params:
        return "–"
    return f"{196.0 * found.bse[name] / abs(values[name]):.2g}"


wanted = ("K_1", "D_1", "K_2", "D_2", "Ia_1", "Fs_1")
rows = []
for label, highest_hz in (("slow, to 0.8 Hz", 0.8), ("fast, to 6 Hz", 6.0)):
    moved = elastic_motion(models["motor_and_link_encoders"], values, motion(highest_hz), 1000.0)
    for name, found in predicted_estimates([*models.values()], moved).items():
        rows.append(
            {"motion": label, "sensors": name.replace("_", " ")} | {n: percent(found, n) for n in wanted}
        )
table = pandas.DataFrame(rows).set_index(["motion", "sensors"])
slow = table.loc[("slow, to 0.8 Hz", "motor encoders"), "K_1"]
assert slow == "–" or float(slow) > 5.0
assert float(table.loc[("fast, to 6 Hz", "motor encoders"), "K_1"]) < 0.2
table

# %% [markdown]
# So: encoders on both sides where a link's encoder fits; a torque sensor does not replace it, but tells
# drive and link apart; encoders on one side alone do for stiffness and inertia if the robot may move close
# to its modes. Take your own arm's file, values, motion and noise in place of these.
