"""Pictures of random chains: everything is named, nothing lies on anything else, texts are escaped."""

from __future__ import annotations

import re
from itertools import pairwise
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.chain_picture.diagram import GROUND, ChainDiagram, DrawnBody, DrawnDeflection, DrawnLink
from modelgen.chain_picture.svg import chain_svg
from modelgen.chain_picture.symbols import width
from modelgen.chain_picture.tree import branches

SVG = "{http://www.w3.org/2000/svg}"


@st.composite
def diagrams(draw: st.DrawFn) -> ChainDiagram:
    """Trees with springs to the ground, loops, gears, sensors of every kind; some of it in several parts."""
    n = draw(st.integers(1, 14))
    names = [f"b{k}" for k in range(n)]
    measures = ("position", "velocity", "acceleration")
    bodies = []
    for k, name in enumerate(names):
        read = draw(st.lists(st.sampled_from(measures), max_size=3, unique=True))
        bodies.append(
            DrawnBody(
                name,
                f"J_{k}",
                draw(st.sampled_from([(), (f"F_v{k}",), (f"F_v{k}", f"F_s{k}")])),
                draw(st.sampled_from([None, f"O_{k}"])),
                draw(st.sampled_from([None, f"Gamma_{k}"])),
                tuple((f"{kind[0]}_{k}", kind) for kind in read),
            )
        )
    ratios = st.sampled_from([None, "20", "1/3", "0.00159155"])
    damping = st.sampled_from([None, "D"])
    links = []
    for k in range(1, n):
        other = draw(st.integers(-1, k - 1))  # -1: a part of its own
        if other >= 0:
            pair = draw(st.permutations([names[other], names[k]]))
            links.append(DrawnLink(*pair, (f"K_{k}",), draw(damping), draw(ratios)))
    for k in draw(st.lists(st.integers(0, n - 1), max_size=3)):
        links.append(DrawnLink(names[k], GROUND, (f"K_g{k}", "K3"), draw(damping)))
    pairs = st.lists(st.integers(0, n - 1), min_size=2, max_size=2, unique=True)
    for one, other in draw(st.lists(pairs, max_size=2)) if n > 1 else ():
        links.append(DrawnLink(names[one], names[other], ("K_loop",), draw(damping), draw(ratios)))
    between = [
        DrawnDeflection(f"d_{one}_{other}", "position", names[one], names[other])
        for one, other in (draw(st.lists(pairs, max_size=2)) if n > 1 else ())
    ]
    return ChainDiagram("a chain", tuple(bodies), tuple(links), tuple(between))


def texts(svg: str) -> list[str]:
    return ["".join(element.itertext()) for element in ElementTree.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.slow
@settings(max_examples=60)
@given(diagrams())
def test_everything_is_named_once_and_no_two_bodies_lie_on_each_other(diagram: ChainDiagram) -> None:
    svg = chain_svg(diagram)
    root, said = ElementTree.fromstring(svg), texts(svg)
    for body in diagram.bodies:
        assert said.count(body.name) == 1 and body.inertia in said
        rubbing = ", ".join((*body.friction, *((f"constant {body.offset}",) if body.offset else ())))
        assert not rubbing or rubbing in said
        assert not body.actuator or body.actuator in said
        for key, measures in body.sensors:
            assert f"{key} {measures}" in said
    for link in diagram.links:
        assert said.count(", ".join(link.springs)) >= 1
        assert not link.ratio or f"{link.ratio} : 1" in said
    for springs in {link.springs for link in diagram.links}:
        drawn = sum(link.springs == springs for link in diagram.links)
        assert said.count(", ".join(springs)) == drawn
    for sensor in diagram.deflections:
        assert f"{sensor.key} position" in said
    boxes = [
        tuple(float(element.attrib[key]) for key in ("x", "y", "width", "height"))
        for element in root.iter(f"{SVG}rect")
        if element.attrib["class"] == "body"
    ]
    assert len(boxes) == len(diagram.bodies)
    _, _, wide, high = map(float, root.attrib["viewBox"].split())
    for x, y, w, h in boxes:
        assert x >= 0 and x + w <= wide and y >= 0 and y + h <= high
    for (ax, ay, aw, ah), (bx, by, bw, bh) in ((a, b) for i, a in enumerate(boxes) for b in boxes[:i]):
        assert ax + aw < bx or bx + bw < ax or ay + ah < by or by + bh < ay
    for label in root.iter(f"{SVG}text"):
        if (label.text or "").endswith(" : 1"):
            at, level, half = float(label.attrib["x"]), float(label.attrib["y"]), 0.5 * width(str(label.text))
            assert not any(x < at + half and at - half < x + w and y < level < y + h for x, y, w, h in boxes)
    for d in re.findall(r' d="([^"]+)"', svg):
        for x, y in re.findall(r"[ML]([-\d.e]+) ([-\d.e]+)", d):
            assert -1 <= float(x) <= wide + 1 and -1 <= float(y) <= high + 1
    assert chain_svg(diagram) == svg


@pytest.mark.slow
@settings(max_examples=60)
@given(diagrams())
def test_every_body_has_a_place_of_its_own(diagram: ChainDiagram) -> None:
    nodes, loops = branches(diagram)
    assert sorted(node.name for node in nodes if not node.is_ground) == sorted(b.name for b in diagram.bodies)
    assert len({(node.depth, node.row) for node in nodes}) == len(nodes)
    drawn = [node.up for node in nodes if node.up]
    assert sorted(map(repr, [*drawn, *loops])) == sorted(map(repr, diagram.links))
    for node in nodes:
        assert (node.parent is None) == (node.depth == 0)


@pytest.mark.slow
@given(st.text(min_size=1, max_size=80))
def test_no_text_becomes_markup(text: str) -> None:
    clean = "".join(letter for letter in text if letter.isprintable())
    bodies = (DrawnBody(clean, "J", (clean,), clean, clean, ((clean, "position"),)), DrawnBody("c", clean))
    link = DrawnLink(clean, "c", (clean,), clean, clean)
    root = ElementTree.fromstring(chain_svg(ChainDiagram(clean, bodies, (link,))))
    kinds = {element.tag.removeprefix(SVG) for element in root.iter()}
    assert kinds <= {"svg", "title", "style", "rect", "path", "circle", "text"}


def test_a_chain_is_a_line_and_a_long_one_several() -> None:
    def line(n: int) -> ChainDiagram:
        bodies = tuple(DrawnBody(f"b{k}", f"J_{k}") for k in range(n))
        links = [DrawnLink(a.name, b.name, ("K",)) for a, b in pairwise(bodies)]
        return ChainDiagram("line", bodies, (*links, DrawnLink("b0", GROUND, ("K_g",))))

    assert {node.row for node in branches(line(20))[0] if not node.is_ground} == {0}
    sizes = [ElementTree.fromstring(chain_svg(line(n))).attrib["viewBox"].split()[2:] for n in (6, 20, 3000)]
    assert len({width for width, _ in sizes}) == 1
    assert float(sizes[1][1]) > 1.5 * float(sizes[0][1])


@pytest.mark.parametrize("name", ["x" * 64, "K" * 30])
def test_a_long_name_is_shown_in_part_and_whole_under_the_pointer(name: str) -> None:
    svg = chain_svg(ChainDiagram("t", (DrawnBody("m", name),), ()))
    assert f"<title>{name}</title>" in svg and "…" in svg
