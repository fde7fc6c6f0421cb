"""What each command is for, and the examples below its help; each of them is run by a test."""

from __future__ import annotations

# headings and order of `modelgen --help`
PURPOSES: dict[str, tuple[str, ...]] = {
    "See it work": ("demo",),
    "A chain and its models": ("new", "show", "generate"),
    "Plan an experiment": ("design", "simulate"),
    "From records to parameters": ("import", "identify", "run", "fleet"),
    "Judge an estimate": ("validate", "compare", "trend"),
    "Use its numbers": ("export",),
}

EXAMPLES: dict[str, tuple[str, ...]] = {
    "demo": ("modelgen demo",),
    "new": ("modelgen new axis", "modelgen new axis --project", "modelgen new robot --arm"),
    "show": (
        "modelgen show axis.toml",
        "modelgen show emps300 --sensors qm_ac --svg chain.svg",
        "modelgen show tx40",
    ),
    "generate": (
        "modelgen generate axis.toml",
        "modelgen generate emps300 --sensors qm_ac --target c -o firmware",
        "modelgen generate emps300 --check",
    ),
    "import": ("modelgen import run1.csv --model generated/emps300_qm_ac.py",),
    "identify": (
        "modelgen identify run1.csv --model generated/emps300_qm_ac.py --map-file run1.map.toml "
        "--report report.html",
        "modelgen identify chirp.npz --model generated/emps300_qm_ac.py -o estimate.json",
        "modelgen identify chirp.npz --spec emps300 --set F_vmc=3.9e-5",
    ),
    "run": ("modelgen run axis.project.toml",),
    "simulate": (
        "modelgen simulate emps300 --sensors qm_ac --parameters light --excitation chirp -o chirp.npz",
        "modelgen simulate emps300 --sensors qm_ac --parameters light --excitation trapezoid "
        "--controller loop.toml --with-reference -o trapezoid.npz",
    ),
    "validate": (
        "modelgen validate trapezoid.npz --model generated/emps300_qm_ac.py --estimate estimate.json "
        "--controller loop.toml",
        "modelgen validate trapezoid.npz --model generated/emps300_qm_ac.py --estimate estimate.json "
        "--horizon 10",
    ),
    "export": (
        "modelgen export estimate.json --model generated/emps300_qm_ac.py --to modelica -o emps300.mo",
        "modelgen export --parameters light --model generated/emps300_qm_ac.py --to mjcf -o emps300.xml",
    ),
    "compare": (
        "modelgen compare emps300",
        "modelgen compare generated/emps300_qm_ac.py generated/emps300_qm_qc.py --parameters table_2",
    ),
    "trend": ("modelgen trend axis.project.toml --plot trend.png",),
    "fleet": (
        "modelgen fleet axis1/run1.npz axis2/run1.npz --model generated/emps300_qm_ac.py --cutoff-hz 60",
    ),
    "design": (
        "modelgen design emps300 --parameters light --noise q_m=1e-5 --noise q_c=1e-5 --noise a_c=0.5",
        "modelgen design scara --inside 4=:,:,0.1: --seeds 2 --rounds 20 --optimise excite.csv",
    ),
}


def examples_of(command: str) -> str:
    """Return a command's examples as the end of its help; the mark keeps them from being wrapped."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in EXAMPLES[command])
