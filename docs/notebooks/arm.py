# %% [markdown]
# # From a URDF to a robot's dynamics
#
# A robot of three joints comes with a URDF from its maker. Its masses are those of the drawing, and of the
# drives it says nothing. From the URDF to numbers with intervals, a check on motion that they have not seen,
# and a page to hand over.

# %%
from pathlib import Path
from tempfile import mkdtemp

from IPython.display import SVG

import modelgen
from modelgen.render.arms.arm_writer import arm_files
from modelgen.report.arm_drawing import arm_section
from modelgen.report.page import report_page
from modelgen.runtime.comparison.arm_forces import compare_forces
from modelgen.runtime.simulation.arms.joint_reference import JointLimits, fourier_reference

folder = Path(mkdtemp())


def link(name, mass, com, inertia):
    """A link with its inertial about the centre of mass: kg, m, kg m^2."""
    x, y, z = inertia
    return f"""<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
        <inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


def joint(name, parent, child, xyz, axis):
    """A joint between two links: where it stands (m) and about what it turns."""
    return f"""<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="{xyz}"/><axis xyz="{axis}"/>
        <limit lower="-2.5" upper="2.5" velocity="3" effort="200"/></joint>"""


(folder / "robot.urdf").write_text(
    f"""<robot name="robot"><link name="base"/>
    {joint("waist", "base", "column", "0 0 0.3", "0 0 1")}
    {link("column", 9.0, "0 0 -0.05", (0.06, 0.06, 0.03))}
    {joint("shoulder", "column", "upper", "0 0.08 0", "0 1 0")}
    {link("upper", 6.0, "0.18 0 0", (0.01, 0.07, 0.07))}
    {joint("elbow", "upper", "fore", "0.4 0 0", "0 1 0")}
    {link("fore", 3.0, "0.12 0.01 0.02", (0.004, 0.02, 0.02))}
    </robot>"""
)
(folder / "robot.toml").write_text('[arm]\nname = "robot"\nurdf = "robot.urdf"\n')
arm = modelgen.load_arm(folder / "robot.toml")
SVG(modelgen.draw_arm(arm))

# %% [markdown]
# `modelgen new robot --urdf robot.urdf` writes such a file with all that a URDF cannot say: gears,
# couplings, friction, payloads.
#
# ## Which numbers a motion can tell
#
# `modelgen show robot.toml` says the same. Nothing lies between the shoulder's and the elbow's axes but a
# length of 0.4 m: what of the forearm cannot be distinguished from the upper arm is added to it, exactly.

# %%
((file, text),) = arm_files(arm, "").items()
(folder / file).write_text(text)
model = modelgen.load_model(folder / file)
print(f"{len(model.parameters)} parameters, {len(model.base_parameters)} of their sums in the rows:")
print("\n".join(f"  {name} = {sum_}" for name, sum_ in model.groupings.items()))

# %% [markdown]
# ## Records
#
# `modelgen design robot.toml --optimise excite.csv` plans a motion. Here a simulation plays the robot, so
# that the right answer is known: drives with rotors and friction that sticks, in closed loop, encoders with
# 2e-5 rad and torques with 0.3 N m of noise. The forearm carries half a kilogram that is not in the URDF.

# %%
truth = dict.fromkeys(model.parameters, 0.0) | dict(arm.parameter_sets["urdf"])
joints = {"waist": (1.2, 4.0, 5.0), "shoulder": (1.5, 5.0, 6.0), "elbow": (0.6, 2.0, 2.5)}
for name, (rotor, viscous, coulomb) in joints.items():
    truth |= {f"Ia_{name}": rotor, f"Fv_{name}": viscous, f"Fs_{name}": coulomb}
extra, reach = 0.5, 0.25
truth["m_elbow"] += extra
truth["mx_elbow"] += extra * reach
for about in ("Iyy_elbow", "Izz_elbow"):
    truth[about] += extra * reach**2
noise = {f"q_{name}": 2e-5 for name in joints} | {f"tau_{name}": 0.3 for name in joints}
limits = {name: JointLimits((-2.0, 2.0), 3.0, 15.0) for name in joints}
record, unseen = (
    modelgen.simulate_arm(
        model, truth, fourier_reference(model, 8.0, 1000.0, limits, seed), noise=noise, seed=seed
    ).record
    for seed in (0, 1)
)

# %% [markdown]
# ## Identify
#
# `modelgen identify run.csv --model models/robot.py --report robot.html`. Noise of the encoders would bias
# least squares: instruments follow, at a cut-off behind which the turns of the joints are short.

# %%
estimate = modelgen.identify(model, record)
print(estimate.answer())

# %% [markdown]
# ## On motion that it has not seen
#
# What the drives reported in another run, next to what the estimate says that this motion needs:

# %%
(check,) = compare_forces(model, estimate.params, [unseen])
for one in check.checks:
    print(f"{one.channel}: {one.fit:.1f} % of what the drive reported is explained")
    assert one.fit > 90.0

# %%
axes = estimate.plot.fit([record])

# %% [markdown]
# ## Against the drawing
#
# The same sums with the masses of the URDF and the rotors as they are: what differs by more than its interval
# is not on the drawing. All that the forearm's half kilogram is in is found.

# %%
rotors = {name: value for name, value in truth.items() if name.startswith("Ia_")}
drawn = model.base_from_physical({**truth, **arm.parameter_sets["urdf"], **rotors})
exact = model.base_from_physical(truth)
differing = set()
for name, on_paper, true in zip(model.base_parameters, drawn, exact, strict=True):
    low, high = estimate.conf_int(0.001)[name]
    assert low <= true <= high, name
    if name.startswith(("Fv", "Fs", "off")):
        continue
    if not low <= on_paper <= high:
        differing.add(name)
    told = "not as drawn" if name in differing else ""
    print(f"{name:14} {estimate.params[name]:8.4f}   drawn {on_paper:8.4f}   {told}")
assert differing == {
    "Izz_waist_R", "Ixx_shoulder_R", "Izz_shoulder_R", "mx_shoulder_R", "Ixx_elbow_R", "Izz_elbow", "mx_elbow"
}  # fmt: skip

# %% [markdown]
# ## One page to hand over
#
# What `--report robot.html` writes: the arm, the numbers, every joint measured and rebuilt, what was checked.

# %%
page = report_page(model, [record], estimate, validations=[check], picture=arm_section(arm))
print(f"{len(page) / 1e6:.2f} MB of HTML, no address in it: {'://' not in page}")
