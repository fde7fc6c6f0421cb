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
    from modelgen.errors import DataError as DataError
    from modelgen.errors import IdentifiabilityError as IdentifiabilityError
    from modelgen.errors import ModelError as ModelError
    from modelgen.errors import ModelgenError as ModelgenError
    from modelgen.errors import RenderError as RenderError
    from modelgen.errors import SpecError as SpecError
    from modelgen.render.writer import generate as generate
    from modelgen.report.arm_drawing import draw_arm as draw_arm
    from modelgen.report.chain_drawing import draw_chain as draw_chain
    from modelgen.runtime.exports.export import export as export
    from modelgen.runtime.identification.identify import identify as identify
    from modelgen.runtime.identification.methods import IV as IV
    from modelgen.runtime.identification.methods import TLS as TLS
    from modelgen.runtime.identification.methods import WLS as WLS
    from modelgen.runtime.identification.methods import Auto as Auto
    from modelgen.runtime.identification.methods import Pham2002 as Pham2002
    from modelgen.runtime.identification.options import CheckOptions as CheckOptions
    from modelgen.runtime.identification.options import Filters as Filters
    from modelgen.runtime.identification.sklearn_estimator import ChainEstimator as ChainEstimator
    from modelgen.runtime.joining.identify_jointly import identify_jointly as identify_jointly
    from modelgen.runtime.model.control_export import control_system as control_system
    from modelgen.runtime.model.known_parameters import with_known as with_known
    from modelgen.runtime.model.model import load_model as load_model
    from modelgen.runtime.model.model import model_from_module as model_from_module
    from modelgen.runtime.records.dataframe import record_from_frame as record_from_frame
    from modelgen.runtime.records.read_record import read_record as read_record
    from modelgen.runtime.records.record import Record as Record
    from modelgen.runtime.results.estimate import Estimate as Estimate
    from modelgen.runtime.simulation.arms.joint_controller import JointController as JointController
    from modelgen.runtime.simulation.arms.simulate_arm import simulate_arm as simulate_arm
    from modelgen.runtime.simulation.simulate import simulate as simulate
    from modelgen.spec.arms.load import load_arm as load_arm
    from modelgen.spec.load import load_spec as load_spec
    from modelgen.symbolic.pipeline import build as build

__version__ = "0.1.0"

# module -> the public names that it defines
_NAMES = {
    "modelgen.runtime.identification.methods": "Auto IV TLS WLS Pham2002",
    "modelgen.runtime.identification.options": "CheckOptions Filters",
    "modelgen.runtime.identification.sklearn_estimator": "ChainEstimator",
    "modelgen.errors": "DataError IdentifiabilityError ModelError ModelgenError RenderError SpecError",
    "modelgen.runtime.results.estimate": "Estimate",
    "modelgen.runtime.records.record": "Record",
    "modelgen.symbolic.pipeline": "build",
    "modelgen.runtime.model.control_export": "control_system",
    "modelgen.runtime.exports.export": "export",
    "modelgen.report.arm_drawing": "draw_arm",
    "modelgen.report.chain_drawing": "draw_chain",
    "modelgen.render.writer": "generate",
    "modelgen.runtime.identification.identify": "identify",
    "modelgen.runtime.joining.identify_jointly": "identify_jointly",
    "modelgen.runtime.model.known_parameters": "with_known",
    "modelgen.spec.arms.load": "load_arm",
    "modelgen.runtime.model.model": "load_model model_from_module",
    "modelgen.spec.load": "load_spec",
    "modelgen.runtime.records.read_record": "read_record",
    "modelgen.runtime.records.dataframe": "record_from_frame",
    "modelgen.runtime.simulation.simulate": "simulate",
    "modelgen.runtime.simulation.arms.joint_controller": "JointController",
    "modelgen.runtime.simulation.arms.simulate_arm": "simulate_arm",
}
_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}

__all__ = list(_HOMES)


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
