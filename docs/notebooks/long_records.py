# %% [markdown]
# # Records longer than memory
#
# A record may be a folder of `.npy` files, one a channel. It is read in stretches and never loaded whole.

# %%
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import modelgen
from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.model.model import model_from_text
from modelgen.spec.load import catalog_path

spec = modelgen.load_spec(catalog_path("emps300"))
model = model_from_text(modelgen.generate(spec, "qm_ac"), "emps300_qm_ac")
true = spec.parameter_sets["light"]
noise = {"q_m": 2e-6, "a_c": 0.5, "Gamma_m": 1e-4}
record = modelgen.simulate(model, true, "chirp", duration_s=20.0, noise=noise).record
print(f"{record.n} samples at {record.fs:g} Hz")

# %%
folder = Path(mkdtemp())
paths = {}
for channel, samples in record.signals.items():
    paths[channel] = folder / f"{channel}.npy"
    np.save(paths[channel], samples)

# %% [markdown]
# Channels go where a record goes: filters are chosen, intervals and checks are made as always. What is in
# memory are the rows at the samples kept.

# %%
source = open_npy(paths, fs=record.fs, name="long")
read = modelgen.identify(model, source)
print(read.summary())

# %% [markdown]
# The estimate is that of the record in memory:

# %%
whole = modelgen.identify(model, record)
for name, value in true.items():
    print(
        f"{name:5} from files {read.params[name]:.6g} ± {read.bse[name]:.2g}, "
        f"in memory {whole.params[name]:.6g} ± {whole.bse[name]:.2g}, true {value:g}"
    )
assert read.params == whole.params
assert read.bse == whole.bse

# %% [markdown]
# `modelgen fleet` does the same for each of many machines, on the workers of a dask cluster, and tests
# whether the machines differ.
