"""The pictures of the gallery, drawn anew into docs/; needs chromium and matplotlib.

    python benchmarks/gallery.py [--plots]

--plots draws those of docs/gallery.md's own code alone, in light and dark; these need no chromium.

The paper's bench, lightly damped, with encoder and accelerometer: identified from a chirp and a trapezoid,
simulated in closed loop, for comparison.
"""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageChops

from modelgen.cli.figure import forces_figure, write_picture
from modelgen.cli.write_report import sensor_set_rows
from modelgen.render.writer import generate
from modelgen.report.arm_drawing import draw_arm
from modelgen.report.page import report_page
from modelgen.runtime.curves.rebuilt import rebuild
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.simulate import record_with_reference, simulate
from modelgen.runtime.simulation.validate import validate
from modelgen.spec.arms.load import load_arm
from modelgen.spec.load import catalog_path, load_spec

DOCS = Path(__file__).resolve().parents[1] / "docs"
NOISE = {"q_m": 2e-6, "a_c": 0.5, "Gamma_m": 1e-4}
LOOP = PositionVelocityController(0.02, 5e-4)
WIDTH, HEIGHT = 1300, 8000
# what of the page is shown: picture, dark or light, first heading and the one that is no longer shown
SHOTS = (
    ("report-light", False, "answer", "forces"),
    ("report-dark", True, "frequency", "loop"),
    ("report-loop", False, "loop", "parameters"),
    ("report-equations", False, "equations", "provenance"),
)


def draw_plots() -> None:
    """Run the Python of docs/gallery.md, and write the axes after each block to the picture below it."""
    from matplotlib import style

    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```\n(?:\n!\[[^\]]*\]\(plot-(\w+)-light)?", page, re.M | re.S)
    for ground in ("light", "dark"):
        names: dict[str, Any] = {}
        with style.context("dark_background" if ground == "dark" else "default"):
            for code, name in blocks:
                exec(code, names)
                if not name:
                    continue
                drawn = io.BytesIO()
                np.ravel(names["axes"])[0].figure.savefig(drawn, dpi=90, format="png")
                path = DOCS / f"plot-{name}-{ground}.png"
                Image.open(drawn).convert("RGB").quantize(48).save(path, optimize=True)
                print(path.name)


def main() -> None:
    draw_plots()
    if "--plots" in sys.argv:
        return
    spec = load_spec(catalog_path("emps300"))
    model = model_from_text(generate(spec, "qm_ac"), "emps300_qm_ac")
    records = [
        record_with_reference(
            simulate(
                model,
                spec.parameter_sets["light"],
                kind,
                noise=NOISE,
                seed=seed,
                controller=LOOP,
                duration_s=3.0,
            )
        )
        for seed, kind in enumerate(("chirp", "trapezoid"))
    ]
    estimate = identify(model, records)
    (DOCS / "arm.svg").write_text(draw_arm(load_arm(catalog_path("scara"))), encoding="utf-8")
    rows = [row for row in rebuild(model, records, estimate)[0] if row.has_force]
    write_picture(forces_figure(rows), DOCS / "forces.svg", overwrite=True)
    loops = validate(model, estimate.physical, records[1:], LOOP)
    page = report_page(model, records, estimate, {}, sensor_set_rows(spec), loops)
    for name, dark, first, after in SHOTS:
        shoot(page, dark, first, after, DOCS / f"{name}.png")
        print(f"{name}.png: from {first} to {after}")


def shoot(page: str, dark: bool, first: str, after: str, path: Path) -> None:
    """Write a picture of the sections of a report from `first` up to `after`."""
    chromium = shutil.which("chromium")
    if chromium is None:
        raise SystemExit("chromium is not installed")
    hidden = [f"section:has(~ #{first})", f"#{after}", f"#{after} ~ section", "header"]
    style = (
        f"<style>{', '.join(hidden)} {{ display: none; }} ::-webkit-scrollbar {{ display: none; }}</style>"
    )
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "page.html"
        opened = page.replace("</head>", f"{style}</head>").replace("<details>", "<details open>")
        source.write_text(opened, encoding="utf-8")
        command = [
            chromium,
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            f"--window-size={WIDTH},{HEIGHT}",
            f"--screenshot={folder}/shot.png",
            *(["--force-dark-mode", "--blink-settings=preferredColorScheme=0"] if dark else []),
            source.as_uri(),
        ]
        subprocess.run(command, capture_output=True, check=True, timeout=120)
        shot = Image.open(f"{folder}/shot.png").convert("RGB")
    paper = Image.new("RGB", shot.size, shot.getpixel((2, shot.height - 2)))
    used = ImageChops.difference(shot, paper).getbbox() or (0, 0, *shot.size)
    cut = shot.crop((0, 0, WIDTH, used[3] + 30))
    cut.quantize(64).save(path, optimize=True)


if __name__ == "__main__":
    main()
