# %% [markdown]
# # Records longer than memory
#
# A record may be a folder of `.npy` files, one a channel. It is read in stretches; what is kept of it is a
# triangle a few columns wide. The estimate is that of the whole record.

# %%
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from modelgen.runtime.identification.identify_stream import identify_stream

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
# Nothing else is needed: cut-off, order and decimation are chosen from the record (of a longer one, from
# stretches), and a chunk of it for every core is all that is ever in memory. How many samples are read at a
# time, and by how many threads, changes memory and speed, never the estimate:

# %%
source = open_npy(paths, fs=record.fs, name="long")
streamed = {chunk: identify_stream(model, [source], chunk_samples=chunk) for chunk in (5_000, 20_000)}
for chunk, estimate in streamed.items():
    print(f"{chunk} samples at a time:", ", ".join(f"{k} {v:.6g}" for k, v in estimate.params.items()))
small, large = streamed.values()
assert all(abs(small.params[k] - large.params[k]) < 1e-8 * large.bse[k] for k in true)

# %% [markdown]
# The same estimate as from memory, with the same intervals:

# %%
whole = modelgen.identify(model, [record])
for name, value in true.items():
    print(
        f"{name:5} streamed {large.params[name]:.6g} ± {large.bse[name]:.2g}, "
        f"in memory {whole.params[name]:.6g} ± {whole.bse[name]:.2g}, true {value:g}"
    )
    assert abs(large.params[name] - whole.params[name]) < 1e-3 * whole.bse[name]

# %% [markdown]
# `modelgen fleet` does this for many records of many machines, on the workers of a dask cluster.
