"""What is too long is refused at once, with the number, and a remedy that helps."""

from __future__ import annotations

import random
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.errors import ModelError
from modelgen.spec.load import parse_spec
from modelgen.symbolic.pipeline import build
from tests.symbolic.graphs import bipartite, chain, graph, grid, mesh, ring, star, wheel

SECONDS = 60.0  # of patience with a busy machine; a refusal takes one
LENGTH = r"terms|can be eliminated|additions"

TOO_LONG = {
    "mesh of 6, damped, 4 unseen": graph(mesh(6), 6, [4, 5]),
    "mesh of 6, damped, 3 unseen": graph(mesh(6), 6, [3, 4, 5]),
    "mesh of 12, 4 unseen": graph(mesh(12), 12, range(4, 12), damping=False),
    "30 unseen in a row": graph(chain(32), 32, [0, 31]),
    "998 unseen in a row": graph(chain(1000), 1000, [0, 999]),
    "every second of 500": graph(chain(500), 500, range(1, 500, 2)),
    "checkers": graph(grid(8, 8), 64, [i for i in range(64) if (i // 8 + i % 8) % 2]),
    "half a grid": graph(grid(16, 16), 256, range(128)),
    "hub of 1000": graph(star(1000), 1000, range(1, 1000)),
    "leaves of 300": graph(star(300), 300, [0]),
    "wheel": graph(wheel(9), 9, [0, 2, 4, 6, 8]),
    "bipartite": graph(bipartite(4, 30), 34, range(4, 34)),
    "ring": graph(ring(12), 12, range(8), ground=True),
    "200 links in parallel": graph([(0, 1)] * 200, 2, [0]),
    "4000 links in parallel": graph([(0, 1)] * 4000, 2, [0], damping=False),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TOO_LONG)
def test_the_command_refuses_with_the_number_and_ends(name: str, tmp_path: Path) -> None:
    spec = tmp_path / "graph.toml"
    spec.write_text(TOO_LONG[name])
    command = [sys.executable, "-m", "modelgen", "show", str(spec), "--sensors", "set"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert done.returncode == 2, done.stdout + done.stderr
    assert re.search(rf"[0-9]+ (?:of them|{LENGTH})|10\^[0-9]+ terms", done.stderr), done.stderr
    assert "add a position sensor on b" in done.stderr
    assert "Traceback" not in done.stderr


def with_sensors(text: str, bodies: list[str]) -> str:
    return text + "".join(f'\nextra_{b} = {{ body = "{b}", measures = "position" }}' for b in bodies)


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        graph(mesh(6), 6, [4, 5]),
        graph(chain(20), 20, [0, 19], damping=False),
        graph([(0, 1)] * 200, 2, [0]),
    ],
)
def test_the_remedy_helps(text: str) -> None:
    with pytest.raises(ModelError, match=LENGTH) as refused:
        build(parse_spec(text, "graph.toml"), "set")
    remedy = refused.value.problems[0].remedy
    bodies = re.findall(r"b[0-9]+", remedy)
    assert len(bodies) < text.count("[[bodies]]")
    model = build(parse_spec(with_sensors(text, bodies), "graph.toml"), "set")
    assert model.base


@pytest.mark.slow
def test_a_thousand_measured_bodies_are_no_elimination() -> None:
    assert build(parse_spec(graph(chain(1000), 1000, range(1000), damping=False), "graph.toml"), "set").base


@pytest.mark.slow
def test_a_sum_that_python_could_not_read_is_refused() -> None:
    text = graph([(0, 1)] * 2600, 2, [0, 1], damping=False)
    with pytest.raises(ModelError, match=r"2,600 parameters act as one sum, K0 \+ K1 \+ K2 \+ \.\.\."):
        build(parse_spec(text, "graph.toml"), "set")


RATIOS = ["1.0000000000000002", "1e-30", "1e30", "3.141592653589793", "-2.5", "0.1"]


@settings(max_examples=25)
@given(st.integers(0, 10**9))
@pytest.mark.slow
def test_any_graph_gives_a_model_or_a_reason(seed: int) -> None:
    rng = random.Random(seed)
    count = rng.randint(3, 10)
    edges = [(rng.randrange(i), i) for i in range(1, count)]
    edges += [
        pair for pair in mesh(count) if pair not in edges and rng.random() < rng.choice([0.0, 0.2, 0.5])
    ]
    unseen = set(rng.sample(range(count), rng.randrange(count)))
    text = graph(edges, count, set(range(count)) - unseen, rng.random() < 0.5, rng.random() < 0.3)
    text = re.sub(
        r"(stiffness = .*)",
        lambda found: found[1] + (f"\nratio = {rng.choice(RATIOS)}" if rng.random() < 0.2 else ""),
        text,
    )
    text = re.sub(r'(bodies = \["b[0-9]+", "ground"\]\nstiffness = .*)\nratio = .*', r"\1", text)
    try:
        assert build(parse_spec(text, "graph.toml"), "set").base
    except ModelError as error:
        assert re.search(rf"{LENGTH}|cannot be distinguished|extremely large or small", str(error)), text
