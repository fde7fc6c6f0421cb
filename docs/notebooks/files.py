# %% [markdown]
# # From an instrument's file to a report
#
# A file as a German drive writes it: lines of metadata, a line of units, semicolons, decimal commas,
# milliseconds. And with faults: two samples are missing, and one stands there twice.

# %%
from pathlib import Path
from tempfile import mkdtemp

import modelgen
from modelgen.cli.import_file import describe_file, import_lines
from modelgen.report.page import report_page
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.records.read_record import read
from modelgen.spec.load import catalog_path

spec = modelgen.load_spec(catalog_path("emps300"))
model = model_from_text(modelgen.generate(spec, "qm_ac"), "emps300_qm_ac")
noise = {"q_m": 2e-6, "a_c": 0.5, "Gamma_m": 1e-4}
record = modelgen.simulate(model, spec.parameter_sets["light"], "chirp", duration_s=3.0, noise=noise).record

rows = [
    f"{1e3 * k / record.fs:.1f};{57.29577951 * q:.7f};{a:.4f};{1e3 * torque:.4f}".replace(".", ",")
    for k, (q, a, torque) in enumerate(
        zip(record.signals["q_m"], record.signals["a_c"], record.signals["Gamma_m"], strict=True)
    )
]
rows = [*rows[:60], rows[59], *rows[60:14_000], *rows[14_002:]]
head = [
    "Prüfstand 3;;;",
    "Datum;02.05.2022 15:56:24;;",
    "",
    "Zeit;Motorwinkel;Beschl. Last;Motormoment",
    "ms;°;rad/s²;mNm",
]
path = Path(mkdtemp()) / "Messung 7.csv"
size = path.write_text("\n".join([*head, *rows]), encoding="cp1252")

# %% [markdown]
# `modelgen import` says what it took for what, what is wrong with it, and which column may be which
# channel:

# %%
described = describe_file(path, model)
for line in import_lines(described, None, None)[1:]:
    print(line)

# %% [markdown]
# Its proposal is a file to check. What is wrong stands there as a comment; nothing is mended unless
# somebody removes the `#`:

# %%
print(described["mapping"])

# %%
try:
    read(path, {"q_m": "Motorwinkel", "a_c": "Beschl. Last", "Gamma_m": "Motormoment"})
except modelgen.DataError as error:
    for problem in error.problems:
        print(f"{problem.what}: {problem.remedy}")

# %%
reading = read(
    path,
    {"q_m": "Motorwinkel", "a_c": "Beschl. Last", "Gamma_m": "Motormoment"},
    mend=("duplicates", "gaps"),
)
for text in (*reading.took, *reading.mended):
    print(text)

# %% [markdown]
# From here to the parameters, and to one page that holds everything:

# %%
estimate = modelgen.identify(model, [reading.record])
page = report_page(model, [reading], estimate)
print(f"{len(page) / 1e6:.2f} MB of HTML, no address in it: {'://' not in page}")
estimate

# %%
for name, value in spec.parameter_sets["light"].items():
    assert abs(estimate.params[name] / value - 1) < 0.01, name
