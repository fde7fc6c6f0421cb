"""Identification models of spring-coupled chains: from a TOML file to rows that can be identified.

    spec = modelgen.load_spec("emps300.toml")           # TOML -> ChainSpec
    model = modelgen.build(spec, "qm_ac")               # -> BaseModel: rows and base parameters, in symbols
    text = modelgen.generate(spec, "qm_ac")             # -> the text of a NumPy module

    model = modelgen.load_model("emps300_qm_ac.py")     # a generated module, ready for estimation
    estimate = modelgen.identify(model, records)        # -> Estimate: params, bse, conf_int(), summary()

The names below are loaded when first used: importing modelgen brings in neither SymPy nor SciPy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from modelgen.errors import (
        DataError,
        IdentifiabilityError,
        ModelError,
        ModelgenError,
        RenderError,
        SpecError,
    )
    from modelgen.render.writer import generate
    from modelgen.runtime.contract import load_model
    from modelgen.runtime.control_export import control_system
    from modelgen.runtime.data import Record
    from modelgen.runtime.estimate import Estimate
    from modelgen.runtime.estimator import ChainEstimator
    from modelgen.runtime.frame import record_from_frame
    from modelgen.runtime.identify import identify
    from modelgen.runtime.read import read_record
    from modelgen.runtime.simulate import simulate
    from modelgen.spec import load_spec
    from modelgen.symbolic.pipeline import build

__version__ = "0.1.0"

__all__ = [
    "ChainEstimator",
    "DataError",
    "Estimate",
    "IdentifiabilityError",
    "ModelError",
    "ModelgenError",
    "Record",
    "RenderError",
    "SpecError",
    "build",
    "control_system",
    "generate",
    "identify",
    "load_model",
    "load_spec",
    "read_record",
    "record_from_frame",
    "simulate",
]

_HOMES = {
    "ChainEstimator": "modelgen.runtime.estimator",
    "DataError": "modelgen.errors",
    "Estimate": "modelgen.runtime.estimate",
    "IdentifiabilityError": "modelgen.errors",
    "ModelError": "modelgen.errors",
    "ModelgenError": "modelgen.errors",
    "Record": "modelgen.runtime.data",
    "RenderError": "modelgen.errors",
    "SpecError": "modelgen.errors",
    "build": "modelgen.symbolic.pipeline",
    "control_system": "modelgen.runtime.control_export",
    "generate": "modelgen.render.writer",
    "identify": "modelgen.runtime.identify",
    "load_model": "modelgen.runtime.contract",
    "load_spec": "modelgen.spec",
    "read_record": "modelgen.runtime.read",
    "record_from_frame": "modelgen.runtime.frame",
    "simulate": "modelgen.runtime.simulate",
}


# Type checkers see the imports above; with this function they would let any misspelt name pass.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """Load a public name from its home (PEP 562)."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value: object = getattr(import_module(_HOMES[name]), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
