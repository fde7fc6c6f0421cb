"""A generated module draws the chain that its spec draws: bodies, links, ratios, ground, sensors."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

import modelgen
from modelgen.chain_picture.diagram import ChainDiagram, DrawnLink
from modelgen.cli.main import app
from modelgen.errors import SpecError
from modelgen.render.writer import generate
from modelgen.report.chain_drawing import diagram_of_model, diagram_of_spec
from modelgen.runtime.model.model import model_from_text
from modelgen.spec.load import catalog_names, catalog_path, load_spec, parse_spec


@pytest.mark.parametrize("name", catalog_names())
def test_spec_and_module_draw_the_same(name: str) -> None:
    spec = load_spec(catalog_path(name))
    for sensors in spec.sensor_sets:
        model = model_from_text(generate(spec, sensors), name)
        assert diagram_of_model(model) == diagram_of_spec(spec, sensors)
        assert modelgen.draw_chain(model) == modelgen.draw_chain(spec, sensors)


RATIOS = st.one_of(
    st.integers(2, 200).map(Fraction),
    st.fractions(Fraction(1, 50), 50, max_denominator=99),
    st.just(Fraction(1)),
)


@st.composite
def trees(draw: st.DrawFn) -> str:
    """A tree of bodies with ratios; names may be shared, parameters known."""
    n = draw(st.integers(2, 5))
    lines = ["[chain]", 'name = "t"', 'motion = "rotation"']
    for k in range(n):
        lines += ["[[bodies]]", f'name = "b{k}"', f'inertia = "{draw(st.sampled_from(["J", f"J_{k}"]))}"']
        lines += ['actuator = "T"'] if k == 0 else []
    for k in range(1, n):
        other, spring = draw(st.integers(0, k - 1)), draw(st.sampled_from(["K", f"K_{k}"]))
        lines += ["[[links]]", f'bodies = ["b{other}", "b{k}"]', f'stiffness = "{spring}"']
        ratio = draw(RATIOS)
        lines += [f"ratio = {float(ratio)!r}"] if ratio != 1 else []
    if draw(st.booleans()):
        lines += ["[[links]]", f'bodies = ["b{n - 1}", "ground"]', 'stiffness = "K_g"']
        lines += ["[known]", "K_g = 3.5"] if draw(st.booleans()) else []
    sensors = [f'q_{k} = {{ body = "b{k}", measures = "position" }}' for k in range(n)]
    return "\n".join([*lines, "[sensors.s]", *sensors])


@pytest.mark.slow
@settings(max_examples=25)
@given(trees())
def test_ratios_and_shared_names_are_found_in_the_module(text: str) -> None:
    spec = parse_spec(text, "t.toml")
    drawn, found = diagram_of_spec(spec, "s"), diagram_of_model(model_from_text(generate(spec, "s"), "t"))
    assert found.bodies == drawn.bodies

    def ratio(link: DrawnLink) -> float:
        return round(float(Fraction(link.ratio or 1)), 3)

    def ends(diagram: ChainDiagram) -> list[tuple[frozenset[str], tuple[str, ...], float]]:
        return sorted(
            (
                (
                    frozenset((link.first, link.second)),
                    link.springs,
                    round(float(Fraction(link.ratio or 1)), 3),
                )
                for link in diagram.links  # type: ignore[attr-defined]
            ),
            key=lambda link: sorted(link[0]),
        )

    assert ends(found) == ends(drawn)


def test_an_unknown_set_is_explained() -> None:
    with pytest.raises(SpecError, match="has no set 'qm_xx'; choose from qm_qc, qm_ac"):
        modelgen.draw_chain(load_spec(catalog_path("emps300")), "qm_xx")


def test_show_writes_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "chain.svg"
    arguments = ["show", "emps300", "--sensors", "qm_ac", "--svg", str(path)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert path.read_text(encoding="utf-8") == modelgen.draw_chain(
        load_spec(catalog_path("emps300")), "qm_ac"
    )
    again = CliRunner().invoke(app, arguments)
    assert again.exit_code == 2 and "--overwrite" in again.stderr
    assert CliRunner().invoke(app, [*arguments, "--overwrite"]).exit_code == 0
    wrong = CliRunner().invoke(app, ["show", "emps300", "--svg", str(tmp_path / "chain.png")])
    assert wrong.exit_code == 2 and "give it .svg" in wrong.stderr
