from __future__ import annotations

import numpy as np

from modelgen.runtime.parameters.pruning import PruningStep, prune


def test_the_worst_goes_first_and_every_removal_fits_again() -> None:
    asked: list[tuple[str, ...]] = []
    spreads = {
        ("a", "b", "c", "d"): [1.0, 30.0, 200.0, 2.0],
        ("a", "b", "d"): [1.0, 12.0, 9.0],
        ("a", "d"): [1.0, 9.9],
    }
    errors = {4: 0.05, 3: 0.06, 2: 0.2}

    def refit(names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, float]:
        asked.append(names)
        return np.arange(float(len(names))), np.array(spreads[names]), errors[len(names)]

    pruning = prune(("a", "b", "c", "d"), refit, 10.0)
    assert asked == list(spreads)
    assert pruning.steps == (PruningStep("c", 200.0, 0.06), PruningStep("b", 12.0, 0.2))
    assert pruning.relative_error == 0.05
    assert pruning.kept == (("a", 0.0, 1.0), ("d", 1.0, 9.9))


def test_ten_percent_itself_is_removed_and_the_last_parameter_stays() -> None:
    def refit(names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, float]:
        return np.ones(len(names)), np.linspace(10.0, 20.0, len(names)), 0.1

    pruning = prune(("a", "b"), refit, 10.0)
    assert [step.removed for step in pruning.steps] == ["b"]
    assert pruning.kept == (("a", 1.0, 10.0),)
    assert prune(("a", "b"), refit, 20.5).steps == ()
