# %% [markdown]
# # Before buying sensors, and after identifying
#
# Which sensors give which precision can be computed before any is bought; whether an estimate is good shows
# in closed loop, on a record it has not seen.

# %%
from dataclasses import replace

import pandas

import modelgen
from modelgen.cli.candidates import spec_model
from modelgen.runtime.planning.monte_carlo import monte_carlo
from modelgen.runtime.planning.planned_experiment import experiment
from modelgen.runtime.planning.sensor_set_ranking import cheapest, judge_set, rank
from modelgen.runtime.simulation.closed_loop import PositionVelocityController
from modelgen.runtime.simulation.instrument import Instrument
from modelgen.runtime.simulation.validate import validate
from modelgen.spec.load import catalog_path

spec = modelgen.load_spec(catalog_path("emps300"))
true = spec.parameter_sets["light"]

# %% [markdown]
# ## Predict
#
# Instruments with their noise and resolution (SI) and price, and an expectation of the parameters:

# %%
instruments = {
    "q_m": Instrument(noise=1e-5, price=150),
    "q_c": Instrument(noise=2e-6, price=600),
    "a_c": Instrument(noise=0.5, price=180),
    "Gamma_m": Instrument(noise=1e-4),
}
models = {name: spec_model(spec, name) for name in ("qm_qc", "qm_ac")}
predictions = rank([judge_set(name, model, true, instruments) for name, model in models.items()])
pandas.DataFrame(
    [
        {"sensors": one.sensor_set, "price": one.price, "parameter": p.name, "std %": p.std, "bias %": p.bias}
        for one in predictions
        for p in one.precisions
    ]
).set_index(["sensors", "price", "parameter"]).round(4)

# %%
best = cheapest(predictions, wanted_percent=1.0)
print("cheapest set with every parameter within 1 %:", best.sensor_set if best else "none")

# %% [markdown]
# These are the deviations that `identify` would state. Of one method, least squares say, the prediction has a
# closed form. Forty simulated experiments agree with it:

# %%
model = models["qm_ac"]
spreads = monte_carlo(experiment(model, true, instruments), draws=40)
for spread in spreads:
    print(f"{spread.name:5} predicted {spread.predicted_std:.4f} %, found {spread.std:.4f} %")
    assert 0.6 < spread.std / spread.predicted_std < 1.5

# %% [markdown]
# ## Validate
#
# Identified from a chirp, simulated on trapezoids: the same reference into the same loop, all signals
# compared.

# %%
loop = PositionVelocityController(kp=0.02, kv=5e-4)
noise = {"q_m": 2e-6, "a_c": 0.5, "Gamma_m": 1e-4}
simulations = [
    modelgen.simulate(model, true, kind, noise=noise, seed=seed, controller=loop)
    for seed, kind in enumerate(("chirp", "trapezoid"))
]


def with_reference(found):
    """Return a simulation's record with the inputs of the loop in addition to the readings."""
    record, inputs = found.record, found.reference
    step = round(inputs.rate_hz / record.fs)
    channels = ("reference", "reference_rate", "feedforward")
    signals = {name: getattr(inputs, name)[::step][: record.n] for name in channels}
    return replace(record, signals={**record.signals, **signals})


chirp, trapezoid = map(with_reference, simulations)
estimate = modelgen.identify(model, [chirp])
estimate

# %%
for found in validate(model, estimate.physical, [chirp, trapezoid], loop, used=estimate.records):
    print(f"{found.record}, {'held out' if found.held_out else 'used'}:")
    for check in found.checks:
        rms = f"rms error {check.rms_error:.2g} {check.unit}"
        print(f"  {check.channel:8} {check.kind:15} fit {check.fit:.2f} %, {rms}")
    assert found.check("q_m", "position").fit > 99.0
