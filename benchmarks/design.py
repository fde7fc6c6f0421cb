"""Predicted precision against Monte Carlo, and what an optimised excitation gains; not measured in time.

    python benchmarks/design.py [--experiments 200] [--rounds 200] [--method wls]

Prints (a) predicted over found standard deviations of the six parameters of emps300, for two sensor sets and
three parameter sets, (b) the ranking of ten sensor sets by prediction and by Monte Carlo (parameters of
Table 2; the root mean square error of the worst parameter, infinite where most estimates refuse one), and
(c) the gain of the optimised excitation over chirp and trapezoid, same limits, same length.
Noise: 2e-5 rad, 0.01 rad/s, 2 rad/s^2, 1e-4 N m.
"""

from __future__ import annotations

import argparse

from modelgen.cli.arguments import load_chain
from modelgen.cli.candidates import Candidates, candidate_models, spec_model
from modelgen.runtime.planning.monte_carlo import Spread, misorders, monte_carlo, worst_spread
from modelgen.runtime.planning.optimal_excitation import optimise
from modelgen.runtime.planning.planned_experiment import experiment
from modelgen.runtime.planning.sensor_set_ranking import judge_set, rank
from modelgen.runtime.simulation.instrument import Instrument
from modelgen.spec.chain import Sensor

NOISE = {"q": 2e-5, "v": 0.01, "a": 2.0, "G": 1e-4}
MEASURES = {"q": "position", "v": "velocity", "a": "acceleration"}
TEN = ("q_m+q_c", "q_m+a_c", "q_m+a_m", "v_m+a_c", "q_c+v_m", "q_c+a_m", "q_m", "v_m", "q_c", "q_c+a_c")


def instruments(keys: list[str]) -> dict[str, Instrument]:
    """Return the instruments of channels, by what their keys begin with."""
    return {key: Instrument(NOISE[key[0]]) for key in keys}


def main() -> None:
    """Print the three tables."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--experiments", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--method", default="wls")
    given = parser.parse_args()
    chain = load_chain("emps300")
    tools = instruments(["q_m", "q_c", "v_m", "a_m", "a_c", "Gamma_m"])

    print(f"(a) predicted / found standard deviation, {given.experiments} experiments, {given.method}")
    print("    (wanted: within 15 %)")
    models = {name: spec_model(chain, name) for name in ("qm_qc", "qm_ac")}
    for name, model in models.items():
        for values, parameters in chain.parameter_sets.items():
            spreads = monte_carlo(
                experiment(model, parameters, tools, method=given.method), given.experiments
            )
            ratios = ", ".join(f"{s.name} {s.predicted_std / s.std:.2f}" for s in spreads)
            print(f"    {name}, {values}: {ratios}")

    print("(b) largest error in %, predicted and found, most precise by prediction first")
    sensors = tuple(
        Sensor(f"{kind}_{body}", body, None, MEASURES[kind])  # type: ignore[arg-type]
        for kind, body in (("q", "m"), ("q", "c"), ("v", "m"), ("a", "m"), ("a", "c"))
    )
    sets = candidate_models(chain, Candidates(sensors, tools), 2)[0]
    parameters = chain.parameter_sets["table_2"]
    predictions = rank([judge_set(key, sets[key], parameters, tools, method=given.method) for key in TEN])
    found: dict[str, Spread] = {}
    for prediction in predictions:
        if prediction.planned is None:
            continue
        worst = worst_spread(monte_carlo(prediction.planned, given.experiments, prediction.promised))
        found[prediction.sensor_set] = worst
        what = f"{prediction.worst:.3g}, {worst.error:.3g} +- {worst.uncertainty:.2g} ({worst.name})"
        print(f"    {prediction.sensor_set}: {what}", flush=True)
    judged = misorders([prediction.sensor_set for prediction in predictions], found)
    for what, pairs in (("in the wrong order", judged.wrong), ("that cannot be distinguished", judged.ties)):
        print(f"    pairs {what}: {', '.join(f'{a} and {b}' for a, b in pairs) or 'none'}")

    print(f"(c) gain over chirp and trapezoid after {given.rounds} trials, parameters of Table 2")
    for name, model in models.items():
        gained = optimise(model, parameters, tools, rounds=given.rounds, method=given.method)
        print(
            f"    {name}: {gained.pair_worst:.3g} % to {gained.worst:.3g} %, "
            f"{gained.pair_worst / gained.worst:.2f} times  (wanted: at least 2)"
        )


if __name__ == "__main__":
    main()
