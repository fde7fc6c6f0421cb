"""The report of a million samples: its size, and how long a browser needs to show it.

    python benchmarks/report.py

The limits are 5 MB and 3 s. The time is that of a whole headless Chromium: start, parse, run the script,
write the page out again, stop; and that of an empty page, both the median of interleaved runs. The
processor's time is the same on a machine that has other work to do.
"""

from __future__ import annotations

import resource
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

from modelgen.render.writer import generate
from modelgen.report.page import report_page
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, load_spec

SAMPLES = 1_000_000
RUNS = 5
NOISE = {"q_m": 2e-6, "a_c": 0.5, "Gamma_m": 1e-4}


def main() -> None:
    spec = load_spec(catalog_path("emps300"))
    model = model_from_text(generate(spec, "qm_ac"), "emps300_qm_ac")
    record = simulate(
        model, spec.parameter_sets["light"], "chirp", fs=5000.0, duration_s=SAMPLES / 5000.0, noise=NOISE
    ).record
    for decimation in (None, 1):
        # intervals would ask for more fits, and change nothing on the page's size
        estimate = identify(model, [record], **values_of(decimation=decimation, drift_check=False))
        started = time.perf_counter()
        page = report_page(model, [record], estimate)
        made = time.perf_counter() - started
        kept = estimate.fit.filtering.decimation[0]
        print(f"{record.n} samples, every {kept}: {len(page.encode()) / 1e6:.2f} MB, made in {made:.1f} s")
        show(page)


def show(page: str) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        print("  chromium is not installed; no time to print")
        return
    with tempfile.TemporaryDirectory() as folder:
        pages = {"report": page, "empty page": "<!DOCTYPE html><title>empty</title>"}
        seconds: dict[str, list[float]] = {name: [] for name in pages}
        processor: dict[str, list[float]] = {name: [] for name in pages}
        for _ in range(RUNS):
            for name, text in pages.items():
                path = Path(folder) / f"{name.split()[0]}.html"
                path.write_text(text, encoding="utf-8")
                command = [
                    chromium,
                    "--headless=new",
                    "--no-sandbox",
                    "--disable-gpu",
                    "--dump-dom",
                    path.as_uri(),
                ]
                started, used = time.perf_counter(), children_s()
                subprocess.run(command, capture_output=True, check=True, timeout=120)
                seconds[name].append(time.perf_counter() - started)
                processor[name].append(children_s() - used)
    for name, found in seconds.items():
        both = f"{statistics.median(found):.2f} s, processor {statistics.median(processor[name]):.2f} s"
        print(f"  chromium, {name}: {both}")


def children_s() -> float:
    """Return the processor's time of all programs that were started and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
