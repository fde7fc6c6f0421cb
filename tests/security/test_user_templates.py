"""Templates of the user that call themselves, never end, write gigabytes or lead out of their folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from modelgen.errors import RenderError
from modelgen.render.target import user_files
from modelgen.spec.load import catalog_path, load_spec

CHAIN = load_spec(catalog_path("emps_rigid"))
LOOP = "{% for a in range(99999) %}{% for b in range(99999) %}{% for c in range(99999) %}"
ENDLESS = {
    "loop": LOOP + "{% endfor %}" * 3,
    "loop that writes": LOOP + "x" + "{% endfor %}" * 3,
    "power": "{{ 9 ** (9 ** 9) }}",
    "macro": "{% macro a() %}{{ a() }}{% endmacro %}{{ a() }}",
    "macros": "{% macro a() %}{{ b() }}{% endmacro %}{% macro b() %}{{ a() }}{% endmacro %}{{ a() }}",
    "itself included": "{% include 'a.txt.j2' %}",
    "itself extended": "{% extends 'a.txt.j2' %}",
    "itself imported": "{% import 'a.txt.j2' as a %}",
    "another and back": "{% include 'b.j2' %}",
    "brackets": "{{ " + "(" * 50_000 + "1" + ")" * 50_000 + " }}",
    "lists": "{{ " + "[" * 3_000 + "]" * 3_000 + " }}",
    "filters": "{{ 'a'" + "|upper" * 50_000 + " }}",
    "blocks": "{% if 1 %}" * 5_000 + "{% endif %}" * 5_000,
    "product": "{{ 'x' * 10 ** 10 }}",
    "list": "{{ [1] * 10 ** 10 }}",
    "width": "{{ '%10000000000d' % 1 }}",
    "format": "{{ '{:10000000000d}'.format(1) }}",
    "centre": "{{ 'x'|center(10 ** 10) }}",
    "just": "{{ 'x'.ljust(10 ** 10) }}",
    "indent": "{{ 'x\n'|indent(10 ** 10) }}",
    "doubled": "{% set n = namespace(x='xxxxxxxx') %}"
    + "{% for i in range(99) %}{% set n.x = n.x ~ n.x %}{% endfor %}",
    "replaced": "{{ ('x' * 10 ** 6).replace('x', 'x' * 10 ** 6) }}",
    "joined": "{{ range(99999)|join('x' * 10 ** 6) }}",
    "digits": "{{ 10 ** 5000 }}",
    "lipsum": "{{ lipsum(n=10 ** 8) }}",
    "surrogate": "{{ '\\ud800' }}",
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ENDLESS)
def test_a_template_without_end(trap: Path, kind: str) -> None:
    (trap / "a.txt.j2").write_text(ENDLESS[kind])
    (trap / "b.j2").write_text("{% include 'a.txt.j2' %}")
    with pytest.raises(RenderError, match=r"fails \(|its templates take (longer than 2 s|more than 256 MB)"):
        user_files(CHAIN, "qm", trap)


def outside(folder: Path, name: str) -> Path:
    (folder.parent / "secret").mkdir()
    (folder.parent / "secret" / name).write_text("secret")
    return folder.parent / "secret"


LINKS: dict[str, Callable[[Path], object]] = {
    "link": lambda folder: (folder / "a.txt.j2").symlink_to(outside(folder, "a") / "a"),
    "relative link": lambda folder: (folder / "a.txt.j2").symlink_to(
        Path("..") / outside(folder, "a").name / "a"
    ),
    "chain of links": lambda folder: (
        (folder / "b").symlink_to(outside(folder, "a") / "a"),
        (folder / "a.txt.j2").symlink_to("b"),
    ),
    "folder that is a link": lambda folder: (
        (folder / "sub").symlink_to(outside(folder, "a")),
        (folder / "a.txt.j2").write_text("{% include 'sub/a' %}"),
    ),
    "included link": lambda folder: (
        (folder / "b").symlink_to(outside(folder, "a") / "a"),
        (folder / "a.txt.j2").write_text("{% include 'b' %}"),
    ),
    "imported link": lambda folder: (
        (folder / "b").symlink_to(outside(folder, "a") / "a"),
        (folder / "a.txt.j2").write_text("{% import 'b' as b %}{{ b }}"),
    ),
    "path upward": lambda folder: (
        outside(folder, "a"),
        (folder / "a.txt.j2").write_text("{% include '../secret/a' %}"),
    ),
    "ignored if missing": lambda folder: (
        outside(folder, "a"),
        (folder / "a.txt.j2").write_text("{% include '../secret/a' ignore missing %}"),
    ),
    "itself": lambda folder: (folder / "a.txt.j2").symlink_to("a.txt.j2"),
    "program's own": lambda folder: (folder / "a.txt.j2").write_text("{% include '/proc/self/environ' %}"),
}


@pytest.mark.parametrize("kind", LINKS)
def test_a_template_that_leads_out_of_its_folder(trap: Path, kind: str) -> None:
    folder = trap / "templates"
    folder.mkdir()
    LINKS[kind](folder)
    with pytest.raises(RenderError, match=r"a\.txt\.j2.* fails \(.*(leads out of the folder|cannot be read)"):
        user_files(CHAIN, "qm", folder)


def test_links_within_the_folder_and_a_folder_behind_a_link(trap: Path) -> None:
    folder = trap / "templates"
    (folder / "sub").mkdir(parents=True)
    (folder / "sub" / "b").write_text("{{ model.name }}")
    (folder / "c").symlink_to(Path("sub") / "b")
    (folder / "a.txt.j2").write_text("{% include 'c' %} {% include 'sub/b' %}")
    (trap / "link").symlink_to(folder)
    assert user_files(CHAIN, "qm", trap / "link") == {"emps_rigid_qm.txt": "emps_rigid_qm emps_rigid_qm"}
