# %% [markdown]
# # Any sensor set
#
# Which parameters are lost when a sensor is left out? The answer is algebra, and needs no record.

# %%
import pandas

import modelgen
from modelgen.spec.load import catalog_path
from modelgen.symbolic.sensor_set_overview import every_subset, overview

spec = modelgen.load_spec(catalog_path("three_mass"))
print(spec.title)
print("bodies:", ", ".join(body.name for body in spec.bodies))

# %% [markdown]
# Every subset of position and acceleration sensors; those of one and two are shown. *order* is the highest
# derivative of a coordinate that its rows need: each costs a factor of frequency in noise.

# %%
every = every_subset(spec)
sets = overview(every, list(every.sensor_sets))
table = pandas.DataFrame(
    [
        {
            "sensors": entry.name,
            "rows": "none" if entry.model is None else len(entry.model.rows.rows),
            "order": None if entry.model is None else max(row.order for row in entry.model.rows.rows),
            "lost": ", ".join(entry.lost) or "–",
        }
        for entry in sets
    ]
).set_index("sensors")
table[table.index.str.count(" ") < 2]

# %% [markdown]
# A sensor more never loses a parameter:

# %%
lost = {frozenset(entry.name.split()): set(entry.lost) for entry in sets}
pairs = [(small, large) for small in lost for large in lost if small < large]
assert all(lost[large] <= lost[small] for small, large in pairs)
print(f"{len(lost)} sensor sets, {len(pairs)} pairs of which one holds the other")

# %% [markdown]
# With one encoder on the motor alone, the coordinates without a sensor are eliminated. The rows that are
# left are linear in composites of the parameters, and the physical ones follow from these:

# %%
base = modelgen.build(modelgen.load_spec(catalog_path("emps300")), "qm_qc")
fewer = modelgen.build(every_subset(base.rows.spec), "q_m")
for title, found in (("two encoders", base), ("one encoder", fewer)):
    print(title)
    for row in found.rows.rows:
        print(f"  row {row.name}, differentiated {row.differentiated} times, order {row.order}")
    print("  base parameters:", ", ".join(parameter.name for parameter in found.base))
    print("  identifiable:", ", ".join(found.identifiable))
