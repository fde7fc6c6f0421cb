# %% [markdown]
# # A robot with springs in its joints
#
# Two joints with harmonic drives, a motor in front of each and an encoder on both sides. From the arm's file
# to its stiffness, its modes over the workspace, and a verdict on all of it.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import modelgen
from modelgen.cli.arms.design_arm import planned_joints
from modelgen.render.arms.arm_writer import arm_files
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.modes.arm_modes import arm_modes
from modelgen.runtime.planning.arms.fast_excitation import fast_excitation
from modelgen.runtime.simulation.arms.joint_motion import JointMotion
from modelgen.runtime.simulation.arms.joint_reference import JointLimits, JointReference, fourier_reference
from modelgen.runtime.simulation.arms.simulate_arm import record_with_joint_references
from modelgen.runtime.simulation.arms.validate_arm import validate_arm
from modelgen.spec.arms.load import parse_arm

arm = parse_arm(
    """
[arm]
name = "soft"
title = "Two joints with harmonic drives"
gravity = [0, 0, -9.81]
drive = ["rotor_inertia", "viscous", "coulomb", "stiffness", "damping"]

[[joints]]
name = "1"
alpha = 90
gear = 100
position_limits = [-150, 150]
speed_limit = "180 deg/s"

[[joints]]
name = "2"
d = 0.4
gear = 80
position_limits = [-150, 150]
speed_limit = "180 deg/s"

[known] # the links are symmetric
my_1 = 0
my_2 = 0

[parameters.guess]
Ixx_1 = 0
Ixy_1 = 0
Ixz_1 = 0
Iyy_1 = 0.16
Iyz_1 = 0
Izz_1 = 0.16
mx_1 = 0.6
mz_1 = 0
m_1 = 3
Ia_1 = 0.5
Fv_1 = 3
Fs_1 = 2
K_1 = 4000
D_1 = 2
Ixx_2 = 0
Ixy_2 = 0
Ixz_2 = 0
Iyy_2 = 0.1
Iyz_2 = 0
Izz_2 = 0.1
mx_2 = 0.35
mz_2 = 0
m_2 = 1.8
Ia_2 = 0.2
Fv_2 = 1.5
Fs_2 = 1
K_2 = 1500
D_2 = 0.8
""",
    "soft.toml",
)
((name, text),) = arm_files(arm, "encoders").items()
model = model_from_text(text, name)
guess = dict(model.parameter_sets["guess"])
print(name, "has the rows", ", ".join(row.name for row in model.rows))

# %% [markdown]
# ## Two motions
#
# Gravity and friction show in large, slow motion. Springs are known by how far they deflect and how the links
# swing: that takes a small, fast motion about the modes, which follow from rough values. (`modelgen design
# soft.toml` plans both, keeps clear of obstacles, and says beforehand what each sensor set would give.)

# %%
limits = {joint.name: JointLimits(joint.position_limits, joint.speed_limit, 20.0) for joint in arm.moving}
slow = fourier_reference(model, 10.0, 1000.0, limits)
begin = slow.motion.q[:, 0]
planned = fast_excitation(model, guess, planned_joints(arm), begin, 5.0)
times = np.arange(5001) / 1000.0
fast = JointReference(JointMotion(*planned.trajectory.at(times), 1000.0), "fast")
print(f"fast: {planned.band_hz[0]:.1f} to {planned.band_hz[1]:.1f} Hz")

# %% [markdown]
# ## The experiment
#
# A simulation plays the robot, which is not what was guessed: motors with friction that sticks and slips,
# springs, links, PD control at the motors' encoders.

# %%
truth = {**guess, "K_1": 4600.0, "K_2": 1350.0, "D_1": 3.0, "Fs_1": 2.6, "mx_2": 0.42, "Izz_2": 0.13}
noise = {"qm_1": 1e-4, "qm_2": 1e-4, "q_1": 2e-6, "q_2": 2e-6, "tau_1": 2e-3, "tau_2": 1e-3}
records = []
for number, reference in enumerate((slow, fast)):
    done = modelgen.simulate_arm(model, truth, reference, noise=noise, seed=number)
    records.append(replace(record_with_joint_references(done), name=reference.name))
deflection = done.true["qm_1"] / 100.0 - done.true["q_1"]
figure, axes = plt.subplots(figsize=(8, 2.5))
axes.plot(times, 1e3 * deflection)
axes.set(xlabel="t [s]", ylabel="spring of joint 1 [mrad]", xlim=(0, 5))
figure.tight_layout()

# %% [markdown]
# ## The answer
#
# Stiffness and damping beside what the rigid arm has; the rotor's inertia is apart from the link's. Below
# them the modes over the postures of the records: with motors that are free, and with motors held.

# %%
estimate = modelgen.identify(model, records)
for one in ("K_1", "K_2", "D_1", "D_2"):
    assert abs(estimate.params[one] - truth[one]) < 4.0 * estimate.bse[one], one
assert estimate.bse["K_1"] < 1e-3 * truth["K_1"]
print(estimate)

# %% [markdown]
# ## Modes over the workspace
#
# With the covariance of the parameters; here over the angle of the second joint.

# %%
angles = np.radians(np.linspace(-150.0, 150.0, 31))
postures = np.vstack((np.zeros(31), angles))
modes = arm_modes(model, estimate.params, estimate.cov_params(), postures)
figure, axes = plt.subplots(figsize=(8, 3))
for side, style in (("free", "-"), ("held", "--")):
    for k in range(2):
        hertz = [getattr(posture, side)[k].frequency_hz for posture in modes.postures]
        axes.plot(
            np.degrees(angles), [one.value for one in hertz], style, label=f"mode {k + 1}, motors {side}"
        )
        axes.fill_between(np.degrees(angles), [h.low for h in hertz], [h.high for h in hertz], alpha=0.3)
axes.set(xlabel="angle of joint 2 [degrees]", ylabel="Hz, 95 %")
axes.legend(ncols=2, fontsize="small")
figure.tight_layout()

# %% [markdown]
# ## Does it hold?
#
# The loop is closed once more, with the estimate in place of the robot.

# %%
checked = validate_arm(model, estimate.params, records, modelgen.JointController())
for one in checked:
    print(
        one.record, {check.channel: round(check.fit, 2) for check in one.checks if check.kind == "position"}
    )
assert min(check.fit for one in checked for check in one.checks if check.kind == "position") > 97.0
