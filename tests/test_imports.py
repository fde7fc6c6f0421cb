"""What importing costs and what may import what: each check in an interpreter of its own."""

from __future__ import annotations

import ast
import json
import pkgutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

import modelgen
from modelgen.errors import ModelgenError

PUBLIC = {
    "JointController",
    "simulate_arm",
    "draw_arm",
    "draw_chain",
    "Auto",
    "IV",
    "TLS",
    "WLS",
    "ChainEstimator",
    "CheckOptions",
    "DataError",
    "Estimate",
    "Filters",
    "IdentifiabilityError",
    "ModelError",
    "ModelgenError",
    "Pham2002",
    "Record",
    "RenderError",
    "SpecError",
    "build",
    "control_system",
    "export",
    "generate",
    "identify",
    "identify_jointly",
    "load_model",
    "load_arm",
    "load_spec",
    "model_from_module",
    "read_record",
    "record_from_frame",
    "simulate",
    "with_known",
}

LOADED = """
import json, sys
print(json.dumps(sorted({name.partition(".")[0] for name in sys.modules})))
"""

BLOCKED = """
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

FORBIDDEN = (
    "sympy", "jinja2", "pydantic", "modelgen.symbolic", "modelgen.render", "modelgen.spec", "modelgen.cli"
)

class Blocked:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if any(name == module or name.startswith(module + ".") for module in FORBIDDEN):
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocked)

import modelgen.runtime

names = [module.name for module in walk_packages(modelgen.runtime.__path__, "modelgen.runtime.")]
names += [f"generated.{path.stem}" for path in sorted(Path("generated").glob("*.py"))]
for name in names:
    import_module(name)
    print(name)
"""


def run_python(code: str, folder: Path) -> str:
    """Run code in a fresh interpreter with warnings as errors; return what it prints."""
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_modelgen_is_light(repo_root: Path) -> None:
    loaded = set(json.loads(run_python("import modelgen" + LOADED, repo_root)))
    assert "modelgen" in loaded
    assert not loaded & {"sympy", "numpy", "scipy", "pydantic", "jinja2", "typer", "rich", "matplotlib"}


def test_help_is_light(repo_root: Path) -> None:
    show_help = """
from modelgen.cli.main import main
try:
    main(["--help"])
except SystemExit as done:
    assert not done.code
print()
"""
    printed = run_python(show_help + LOADED, repo_root)
    assert "identify" in printed
    loaded = set(json.loads(printed.splitlines()[-1]))
    assert "typer" in loaded
    assert not loaded & {"sympy", "numpy", "scipy", "pydantic", "jinja2", "rich", "matplotlib"}


def test_identify_loads_neither_the_derivation_nor_a_simulation(repo_root: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    q = np.cumsum(np.sin(0.02 * np.arange(4000))) * 1e-4
    force = 2.0 * np.gradient(np.gradient(q)) * 1e6 + 0.01 * rng.standard_normal(q.size)
    np.savez(tmp_path / "run.npz", q_m=q, F=force, fs=1000.0)
    identify = f"""
from modelgen.cli.main import main
try:
    run = ["identify", {str(tmp_path / "run.npz")!r}, "--model", "generated/emps_rigid_qm.py"]
    main([*run, "--method", "wls", "--json"])
except SystemExit as done:
    assert not done.code
print()
import sys
print([n for n in sys.modules if n.startswith(("modelgen.report", "modelgen.render", "modelgen.symbolic"))])
print([n for n in sys.modules if n.startswith(("modelgen.spec", "modelgen.runtime.iv"))])
"""
    printed = run_python(identify + LOADED, repo_root)
    *_, derivation, pipeline, packages = printed.splitlines()
    loaded = set(json.loads(packages))
    assert "numpy" in loaded
    assert not loaded & {"scipy", "sympy", "rich", "jinja2", "matplotlib", "pandas", "h5py"}
    assert (derivation, pipeline) == ("[]", "[]")


def test_runtime_and_generated_modules_live_without_the_derivation(repo_root: Path) -> None:
    imported = run_python(BLOCKED, repo_root).split()
    assert "modelgen.runtime.model.model" in imported
    assert "generated.emps300_qm_ac" in imported


def test_exported_names() -> None:
    assert len(modelgen.__all__) == len(PUBLIC)
    assert set(modelgen.__all__) == PUBLIC
    assert set(modelgen.__dir__()) >= PUBLIC
    for name in modelgen.__all__:
        assert callable(getattr(modelgen, name)), name
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = modelgen.nonsense


def test_every_error_is_exported() -> None:
    family = {ModelgenError, *ModelgenError.__subclasses__()}
    assert family == {getattr(modelgen, name) for name in modelgen.__all__ if name.endswith("Error")}


def test_layers(repo_root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = lint_imports(config_filename=str(repo_root / "pyproject.toml"), no_cache=True, no_logo=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out


def imports_from(path: Path) -> set[str]:
    """What a file imports names from; a relative import as its dots."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    found = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    return {"." * node.level or (node.module or "") for node in found}


def test_no_module_imports_from_its_own_package(repo_root: Path) -> None:
    offenders = []
    for path in sorted((repo_root / "modelgen").rglob("*.py")):
        inside = path.relative_to(repo_root)
        packages = {".".join(parent.parts) for parent in inside.parents[:-1]}
        if path.name != "__init__.py" and any(m in packages or m[0] == "." for m in imports_from(path)):
            offenders.append(str(inside))
    assert not offenders, f"import from the module that defines the name instead: {offenders}"


def outside_programs() -> list[Path]:
    """Notebooks and benchmarks: programs that use the package and run rarely."""
    root = Path(__file__).resolve().parents[1]
    return [*sorted((root / "docs/notebooks").glob("*.py")), *sorted((root / "benchmarks").glob("*.py"))]


@pytest.mark.parametrize("path", outside_programs(), ids=lambda path: path.name)
def test_what_notebooks_and_benchmarks_import_is_there(path: Path) -> None:
    taken = [
        (node.module, name.name)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "modelgen"
        for name in node.names
    ]
    for module, name in taken:
        assert pkgutil.resolve_name(f"{module}.{name}") is not None


def test_what_the_reference_lists_is_there() -> None:
    page = (Path(__file__).resolve().parents[1] / "docs/reference.md").read_text(encoding="utf-8")
    listed = [line.split()[1] for line in page.splitlines() if line.startswith("::: ")]
    assert listed
    for one in listed:
        assert pkgutil.resolve_name(one) is not None
