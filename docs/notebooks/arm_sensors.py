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

from modelgen.cli.arms.design_arm import planned_joints
from modelgen.cli.arms.simulate_arm import mounted
from modelgen.errors import ModelgenError
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.planning.arms.fast_excitation import fast_excitation
from modelgen.runtime.planning.arms.predicted_sets import PlannedSet, predicted_sets
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointReference, fourier_reference
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
# A Fourier series of 4 s within the arm's limits, and 3 s of small, fast motion about its modes, each in
# closed loop at 1 kHz; encoders of 5e-6 rad, torques of 0.1 N m (standard deviations). Half of a 95 %
# interval in %, and a dash where there is no number. Slow motion hardly deflects the springs: from
# encoders on one side alone it gives stiffness to some tens of percent, or not at all.

# %%
values = arm.parameter_sets["nominal"]
titles = {name.replace(",", "").replace(" ", "_"): name for name in arm.sensor_sets}
limited = tuple(replace(joint, position_limits=(-2.0, 2.0), speed_limit=3.0) for joint in arm.joints)
arm = replace(arm, joints=limited, sensor_sets={name: arm.sensor_sets[old] for name, old in titles.items()})
sets = {}
for name in arm.sensor_sets:
    ((file, text),) = arm_files(arm, name).items()
    sets[name] = PlannedSet(model_from_text(text, file), mounted(arm, name))
model = sets["motor_and_link_encoders"].model
slow = fourier_reference(model, 4.0, 1000.0)
planned = fast_excitation(model, values, planned_joints(arm), slow.motion.q[:, 0], 3.0)
times = np.arange(3001) / 1000.0
fast = JointReference(JointMotion(*planned.trajectory.at(times), 1000.0), "fast")


def percent(found: object, name: str) -> str:
    """Half of the interval of a parameter, relative to its value."""
    if isinstance(found, ModelgenError) or name not in found.deviations:
        return "–"
    return f"{196.0 * found.deviations[name] / abs(values[name]):.2g}"


wanted = ("K_1", "D_1", "K_2", "D_2", "Ia_1", "Fs_1")
rows = []
for label, reference in (("slow, large", slow), ("fast, small", fast)):
    for name, found in predicted_sets(model, values, sets, [reference]).items():
        rows.append({"motion": label, "sensors": titles[name]} | {n: percent(found, n) for n in wanted})
table = pandas.DataFrame(rows).set_index(["motion", "sensors"])
alone = table.loc[("slow, large", "motor encoders"), "K_1"]
assert alone == "–" or float(alone) > 5.0
assert float(table.loc[("fast, small", "motor encoders"), "K_1"]) < 2.0
assert float(table.loc[("fast, small", "motor and link encoders"), "K_1"]) < 0.02
table

# %% [markdown]
# So: encoders on both sides where a link's encoder fits; a torque sensor does not replace it, but tells
# drive and link apart; encoders on one side alone do for stiffness and inertia if the robot may move close
# to its modes. Take your own arm's file, values, motion and noise in place of these.
