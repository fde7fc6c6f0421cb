"""Examples below the help of every command; each of them is run by a test."""

from __future__ import annotations

EXAMPLES: dict[str, tuple[str, ...]] = {
    "demo": ("modelgen demo",),
    "new": ("modelgen new axis",),
    "show": ("modelgen show axis.toml", "modelgen show emps300 --sensors qm_ac"),
    "generate": (
        "modelgen generate axis.toml",
        "modelgen generate emps300 --sensors qm_ac --target c -o firmware",
        "modelgen generate emps300 --check",
    ),
    "import": ("modelgen import run1.csv --model generated/emps300_qm_ac.py",),
    "identify": (
        "modelgen identify run1.csv --model generated/emps300_qm_ac.py --map-file run1.map.toml "
        "--report report.html",
        "modelgen identify chirp.npz --model generated/emps300_qm_ac.py --json",
    ),
    "simulate": (
        "modelgen simulate emps300 --sensors qm_ac --parameters light --excitation chirp -o chirp.npz",
    ),
}


def examples_of(command: str) -> str:
    """Return a command's examples as the end of its help; the mark keeps them from being wrapped."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in EXAMPLES[command])
