"""The same experiment for many parameter vectors: one array a signal, simulations side by side in threads.

Compiled steps (extra "fast") release the interpreter, so that threads use all cores; without numba the
simulations run one after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from modelgen.array_types import FloatArray
from modelgen.errors import DataError
from modelgen.runtime.model.model import Model
from modelgen.runtime.numerics.threads import usable_threads
from modelgen.runtime.simulation.excitation import Excitation
from modelgen.runtime.simulation.sensor_readings import instrument_keys
from modelgen.runtime.simulation.simulate import simulate
from modelgen.runtime.stick_slip.compiled_steps import has_numba


def sweep(
    model: Model,
    parameters: Mapping[str, npt.ArrayLike],
    excitation: Excitation,
    *,
    keys: Sequence[str] | None = None,
    **options: Any,
) -> dict[str, FloatArray]:
    """Return the exact signals for every parameter vector, key to array of shape (P, N).

    Parameters
    ----------
    model : Model
    parameters : mapping of str to array_like, shape (P,) or scalar
        Physical parameters (SI); what is a scalar is the same for all.
    excitation : Excitation
        One for all: a default one would change with the parameters.
    keys : sequence of str, optional
        Signals of `Simulation.true` to return; by default the sensors and actuators.
    **options
        As in `modelgen.simulate`; without a controller, every vector gets the default one of its own.

    Raises
    ------
    DataError
        When the arrays differ in length, or a vector does not suit the model.
    """
    arrays = {name: np.asarray(values, dtype=float) for name, values in parameters.items()}
    sizes = dict.fromkeys(array.size for array in arrays.values() if array.ndim)
    if len(sizes) > 1 or any(array.ndim > 1 for array in arrays.values()):
        raise DataError.at("parameters", "differ in length", "give arrays of one length, or scalars")
    count = next(iter(sizes), 1)
    columns = {name: np.broadcast_to(array, (count,)) for name, array in arrays.items()}
    vectors = [{name: float(array[i]) for name, array in columns.items()} for i in range(count)]
    wanted = tuple(keys or instrument_keys(model))

    def run(vector: Mapping[str, float]) -> list[FloatArray]:
        found = simulate(model, vector, excitation, **options).true
        return [found[key] for key in wanted]

    if not vectors:
        raise DataError.at("parameters", "hold no vector", "give at least one value each")
    # the first one alone: it compiles, and explains what is wrong with the options
    rows = [run(vectors[0])]
    with ThreadPoolExecutor(usable_threads() if has_numba() else 1) as pool:
        rows += pool.map(run, vectors[1:])
    return {key: np.array([row[i] for row in rows]) for i, key in enumerate(wanted)}
