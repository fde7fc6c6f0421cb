"""The picture at the top of the README, drawn anew into docs/; needs chromium and matplotlib.

    python benchmarks/overview.py

What the program does in one look: a chain, a record, what is found, and the model against the measurement.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import tempfile
from html import escape
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from modelgen.cli.demo.bench import FS_HZ, bench
from modelgen.render.writer import generate
from modelgen.report.chain_drawing import draw_chain
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import model_from_text
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, load_spec

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "overview.png"
WIDTH, HEIGHT = 1240, 630
STYLE = """
body { margin: 18px; font: 15px/1.4 system-ui, "DejaVu Sans", sans-serif; color: #1b1f24; background: #fff; }
main { display: grid; grid-template-columns: 1fr 1fr; gap: 14px 28px; }
h2 { font-size: 17px; margin: 0 0 6px; } h2 b { color: #0b5cad; margin-right: 8px; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; width: 100%; }
td, th { text-align: right; padding: 3px 8px; border-bottom: 1px solid #d5dae0; font-weight: 400; }
td:first-child, th:first-child { text-align: left; font-weight: 600; }
th { color: #5b6673; } svg { width: 100%; }
"""
CHIRP_S, TRAPEZOID_S = (4.0, 4.1), (0.0, 1.0)


def main() -> None:
    spec = load_spec(catalog_path("emps300"))
    model = model_from_text(generate(spec, "qm_ac"), "emps300_qm_ac")
    true = spec.parameter_sets["table_2"]
    experiments = bench(model, true)
    estimate = identify(model, [experiment.record for experiment in experiments])
    chirp, trapezoid = experiments
    loop = {"fs": FS_HZ, "controller": trapezoid.controller}
    simulated = simulate(model, estimate.physical, trapezoid.excitation, **loop).true["Gamma_m"]
    measured = chirp.record.signals
    panels = [
        ("Describe the chain and its sensors", draw_chain(spec, "qm_ac")),
        (
            "Record a motion",
            plot(CHIRP_S, {"a_c in rad/s²": measured["a_c"], "Γ_m in N m": measured["Gamma_m"]}),
        ),
        ("Get its parameters, with intervals", table(estimate)),
        (
            "Believe them: torque measured and simulated",
            torque(trapezoid.record.signals["Gamma_m"], simulated),
        ),
    ]
    cells = "".join(
        f"<section><h2><b>{k}</b>{escape(title)}</h2>{body}</section>"
        for k, (title, body) in enumerate(panels, 1)
    )
    shoot(f"<!DOCTYPE html><meta charset=utf-8><style>{STYLE}</style><main>{cells}</main>")
    print(f"wrote {PICTURE}")


def table(estimate: Estimate) -> str:
    """Return value and 95 % interval of every parameter as HTML."""
    rows = [
        f"<tr><td>{name}</td><td>{value:.5g}</td><td>{low:.5g} … {high:.5g}</td><td>{escape(unit)}</td></tr>"
        for (name, value), (low, high), unit in zip(
            estimate.params.items(),
            estimate.conf_int().values(),
            (entry.unit for entry in estimate.parameters.identified),
            strict=True,
        )
    ]
    head = "<tr><th>parameter<th>value<th>95 % interval<th>unit</tr>"
    return f"<table>{head}{''.join(rows)}</table>"


def plot(window_s: tuple[float, float], signals: dict[str, np.ndarray]) -> str:
    """Return the signals within a window, one above the other, as SVG."""
    figure = Figure(figsize=(6.0, 2.7), layout="constrained")
    start, stop = (round(edge * FS_HZ) for edge in window_s)
    axes = figure.subplots(len(signals), 1, sharex=True)
    for axis, (label, samples) in zip(axes, signals.items(), strict=True):
        axis.plot(np.arange(start, stop) / FS_HZ, samples[start:stop], color="#0b5cad", linewidth=1.0)
        axis.set_ylabel(label)
        axis.margins(x=0.0)
    axes[-1].set_xlabel("time in s")
    return svg(figure)


def torque(measured: np.ndarray, simulated: np.ndarray) -> str:
    """Return both torques under the trapezoid as SVG."""
    figure = Figure(figsize=(6.0, 2.7), layout="constrained")
    axis = figure.subplots()
    start, stop = (round(edge * FS_HZ) for edge in TRAPEZOID_S)
    time_s = np.arange(start, stop) / FS_HZ
    axis.plot(time_s, measured[start:stop], color="#9aa5b1", linewidth=4.0, label="measured")
    axis.plot(time_s, simulated[start:stop], color="#c2410c", linewidth=1.2, label="simulated")
    axis.set(xlabel="time in s", ylabel="Γ_m in N m")
    axis.margins(x=0.0)
    axis.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    return svg(figure)


def svg(figure: Figure) -> str:
    """Return a figure as an element of a page."""
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    return drawn.getvalue().partition("<svg")[1] + drawn.getvalue().partition("<svg")[2]


def shoot(page: str) -> None:
    """Write the picture of a page."""
    chromium = shutil.which("chromium")
    if chromium is None:
        raise SystemExit("chromium is not installed")
    with tempfile.TemporaryDirectory() as folder:
        source, shot = Path(folder) / "page.html", Path(folder) / "shot.png"
        source.write_text(page, encoding="utf-8")
        command = [chromium, "--headless=new", "--no-sandbox", "--disable-gpu", f"--screenshot={shot}"]
        command += [f"--window-size={WIDTH},{HEIGHT}", "--hide-scrollbars", source.as_uri()]
        subprocess.run(command, capture_output=True, check=True, timeout=120)
        Image.open(shot).convert("RGB").quantize(128).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
