"""Modules of arms: each that is written may be executed; what differs is refused, or does arithmetic only."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest

from modelgen.generated_module.module_check import module_problems, seal
from modelgen.render.arms.arm_writer import arm_module
from modelgen.runtime.model.module_file import execute_text
from modelgen.spec.arms.arm import ArmSpec
from modelgen.symbolic.arms.arm_rows import arm_rows
from modelgen.symbolic.arms.base_parameters import arm_base_model
from tests.symbolic.arms.made_arms import PUMA, random_arm, serial, tx40

ARMS = [tx40(), *(random_arm(random.Random(seed)) for seed in range(40, 60))]
TEXT = arm_module(arm_base_model(arm_rows(serial(PUMA[:2], True))))
PAYLOADS = ["__import__('os')", "open('x')", "s", "np", "np.save", "().__class__", "lambda: 0", "1e400", "-1",
            "q1", "b0", "o0", "v1", "base_fx", "signals", "2 ** 9 ** 9", "'''", '"', "\n", "#", "\\",
            ", ", ")", "(", "0.5", "nan", "np.add", "[", "999999999", "eval", "{", "}", "\u202e"]  # fmt: skip


@pytest.mark.parametrize("spec", ARMS)
@pytest.mark.parametrize("base_rows", [False, True])
def test_every_module_that_is_written_may_be_executed(spec: ArmSpec, base_rows: bool) -> None:
    model = arm_base_model(arm_rows(spec, base_rows=base_rows))
    assert module_problems(arm_module(model)) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("import numpy as np", "import os as np"),
        ("np.cos(q2, b0)", "np.cos(q2, q1)"),
        ("np.cos(q2, b0)", "np.save(q2, b0)"),
        ("np.cos(q2, b0)", "np.cos(q2, s)"),
        ("    # joint 2", "    q1 = np.cos(q2, b0)"),
        ("    # joint 2", "    import os"),
        ("    # joint 2", "    # joint 2\r    import os"),
        ("BLOCK = 4096", "BLOCK = 10 ** 9"),
        ("p = {**KNOWN, **parameters}", "p = parameters"),
        ("1.0 * np.array(", "np.array("),
        ("CONTRACT_VERSION = 2", "CONTRACT_VERSION = open('x')"),
        ("return out.T", "return signals"),
        (") = b", ") = o"),
        ("def _arrays(signals):", "def _arrays(signals, x=open('x')):"),
    ],
)
def test_another_line_is_refused(old: str, new: str) -> None:
    found = re.sub(r"np\.(cos|sin)\(q2, b\d+\)", "np.cos(q2, b0)", TEXT)
    assert module_problems(seal(found)) == []
    assert old in found
    assert module_problems(seal(found.replace(old, new, 1))) != []


def test_sizes_are_those_of_the_literals() -> None:
    count = TEXT.count("\n", TEXT.index("\nENTRIES"), TEXT.index("#: samples")) - 1
    assert f"np.empty(({count}, samples))" in TEXT
    for size in (count + 1, 10**9):
        changed = TEXT.replace(f"np.empty(({count}, samples))", f"np.empty(({size}, samples))")
        assert module_problems(seal(changed)) != []


@pytest.mark.slow
def test_no_accepted_mutant_does_harm() -> None:
    # the audit hook around every test of this folder refuses files, processes and connections
    rng, accepted = random.Random(2002), 0
    tokens = [found.span() for found in re.finditer(r"[A-Za-z_0-9.]+|[^\sA-Za-z_0-9.]", TEXT)]
    kernel = [span for span in tokens if span[0] > TEXT.index("def _arrays")]
    for number in range(1500):
        start, end = rng.choice(kernel if number % 3 else tokens)
        other = TEXT[slice(*rng.choice(kernel))] if rng.random() < 0.6 else rng.choice(PAYLOADS)
        mutant = seal(TEXT[:start] + other + TEXT[end:])
        if module_problems(mutant):
            continue
        accepted += 1
        use(mutant, f"mutant_{number}")
    assert accepted > 100


def use(text: str, name: str) -> None:
    """Call all functions of a module; inputs stay as they are whatever fails."""
    module = execute_text(text, name)
    keys = ("q", "d1_q", "d2_q", "tau")
    signals = {f"{key}_{n}": np.full(5, 0.5) for key in keys for n in (1, 2)}
    with np.errstate(all="ignore"):
        for function in (module.measurement, module.regressor, module.entries):
            try:
                function(signals)
            except (LookupError, NameError, TypeError, ValueError):
                continue
    assert all(np.all(values == 0.5) for values in signals.values())
