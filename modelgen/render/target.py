"""A model in another language than Python: its files as text, by the templates of that language."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from modelgen.errors import RenderError
from modelgen.render.environment import environment
from modelgen.render.languages import C99, MATLAB, Language, feature_source, signal_sum, state_space_lines
from modelgen.render.plain_model import PlainModel, plain_model
from modelgen.render.user_templates import render_templates
from modelgen.spec.chain import ChainSpec
from modelgen.symbolic.pipeline import build

#: target -> (its language, template -> suffix of the file it makes)
TARGETS: Mapping[str, tuple[Language, Mapping[str, str]]] = {
    "matlab": (MATLAB, {"model.m.j2": ".m"}),
    "c": (C99, {"model.h.j2": ".h", "model.c.j2": ".c"}),
}


def target_files(spec: ChainSpec, sensor_set: str, target: str) -> dict[str, str]:
    """Return the files of a model in one of TARGETS, name to text."""
    model = plain_model(build(spec, sensor_set))
    language, templates = TARGETS[target]
    fields = _printed(language, model)
    env = environment()
    return {
        f"{fields['name']}{suffix}": env.get_template(template).render(fields)
        for template, suffix in templates.items()
    }


def user_files(spec: ChainSpec, sensor_set: str, folder: Path) -> dict[str, str]:
    """Return what the user's own templates make of a model, name to text.

    Every NAME.SUFFIX.j2 of the folder gives MODEL.SUFFIX. A template sees `model` (see
    `modelgen.render.plain_model`) in a sandbox: no attribute that leads out of it, no change of what it sees,
    no file but those of its folder.

    Raises
    ------
    RenderError
        When the folder has no template, or one of them fails, takes too long or leads out of the folder.
    """
    templates = sorted(path.name for path in folder.glob("*.j2")) if folder.is_dir() else []
    if not templates:
        remedy = "give a folder with a file such as model.jl.j2"
        raise RenderError.at(str(folder), "holds no template (*.j2)", remedy)
    model = plain_model(build(spec, sensor_set))
    # a part that other templates include has no suffix
    suffixes = {name: name.removesuffix(".j2").partition(".")[2] for name in templates}
    names = {name: f"{model.name}.{suffix}" for name, suffix in suffixes.items() if suffix}
    return render_templates(folder, names, {"model": model})


def _printed(language: Language, model: PlainModel) -> dict[str, Any]:
    """Return the fields of a model, and its sums as source of the language."""
    fields: dict[str, Any] = {field.name: getattr(model, field.name) for field in dataclasses.fields(model)}
    fields |= {
        "header": model.header,
        "name": language.file_name(model.name),
        "name_of": language.name,
        "measurement_sources": [
            (row, signal_sum(language, model, parts)) for row, parts in enumerate(model.measurement) if parts
        ],
        "regressor_sources": [
            (row, column, signal_sum(language, model, parts)) for row, column, parts in model.regressor
        ],
        "feature_sources": [(f.key, feature_source(language, f)) for f in model.features],
        "state_space_lines": list(state_space_lines(language, model)),
        "has_cubes": any(feature.function == "cube" for feature in model.features),
        "first_key": language.name(model.signals[0][0]),
    }
    return fields
