"""The one place that finds the templates."""

from __future__ import annotations

from importlib import resources
from pathlib import Path


def template_folder() -> Path:
    """Return the folder of templates: packaged with the wheel, or next to the package in a checkout."""
    packaged = Path(str(resources.files("modelgen"))) / "_templates"
    return packaged if packaged.is_dir() else packaged.parent.parent / "templates"


def template_text(name: str) -> str:
    """Return a template, or what is next to the templates of pages."""
    return (template_folder() / name).read_text(encoding="utf-8")
