"""What `modelgen demo` prints: the paper's tables next to the estimates."""

from __future__ import annotations

from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from modelgen.cli.tables import table

HEAD = """\
Pham, Poignet, Gautier (ICRA 2002): Tables 1 and 2 as printed, and what is
found on a simulated bench with these values: closed loop at {fs_hz:g} Hz, a chirp
({low:g} to {high:g} Hz) and a trapezoid, {seconds}.
Noise (rms, SI): {noise};
not the paper's: its deviations differ.

2 sd      two standard deviations
error     from the printed value, which is the bench's true one
default   what modelgen identify does
pham2002  the paper to the letter, with its cut-off omega_H, every {decimation}th sample"""


def demo_tables(found: dict[str, Any]) -> Group:
    """Lay out what `run_demo` found."""
    low, high = found["chirp_band_hz"]
    noise = ", ".join(f"{key} {std:g}" for key, std in found["noise"].items())
    decimation = found["tables"][0]["filters"]["pham2002"]["decimation"][0]
    head = HEAD.format(
        **{**found, "noise": noise},
        low=low,
        high=high,
        seconds=f"{found['duration_s']:g} s each",
        decimation=decimation,
    )
    parts: list[Table | Text] = [Text(head)]
    for entry in found["tables"]:
        parts += [Text(""), _comparison(entry), Text(""), _errors(entry)]
    tail = [f"wrote {path}" for path in (*found["modules"], *found["records"], *found["figures"])]
    if not any(path.endswith(".png") for path in found["figures"]):
        tail.append("no figures 3 and 4: matplotlib is missing; get it with: pip install matplotlib")
    tail.append(f"\nTry: modelgen identify {' '.join(found['records'])} --model {found['modules'][-1]}")
    return Group(*parts, Text(""), *(Text(line) for line in tail))


def _comparison(entry: dict[str, Any]) -> Table:
    columns = ("parameter", "unit", ">printed", ">2 sd", ">sd %", ">default", ">2 sd", ">sd %")
    rows = [
        [row["parameter"], row["unit"], *_numbers(row["printed"]), *_numbers(row["methods"]["default"])]
        for row in entry["rows"]
    ]
    title = f"Table {entry['table']}: sensors {entry['sensor_set']}, omega_H {entry['cutoff_rad_s']:g} rad/s"
    return table(title, columns, rows)


def _errors(entry: dict[str, Any]) -> Table:
    """Lay out the errors of both methods; a table of its own, as terminals have 80 columns."""
    columns = ("parameter", ">default", ">error %", ">pham2002", ">error %")
    rows = []
    for row in entry["rows"]:
        found = [row["methods"][name] for name in ("default", "pham2002")]
        cells = [cell for one in found for cell in (f"{one['value']:.2e}", f"{one['error_percent']:z.2f}")]
        rows.append([row["parameter"], *cells])
    return table("", columns, rows)


def _numbers(found: dict[str, float]) -> list[str]:
    """Return value, two standard deviations and the relative one in the paper's digits."""
    return [f"{found['value']:.2e}", f"{found['two_std']:.2e}", f"{found['relative_std_percent']:.4f}"]
