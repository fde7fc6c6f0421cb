"""Whether a generated module's functions have their shapes and agree with its tables.

The estimation builds its rows from FEATURES and columns(), a user may call regressor(): the two must be the
same model. They are compared at a few random samples (seeded) of every signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from modelgen.array_types import BoolArray, FloatArray
from modelgen.magnitudes import is_usable

SAMPLES = 3
TOLERANCE = 1e-9  # relative to the largest entry; the two differ by rounding only
PROBED = "random signals and parameters"


def is_number(value: Any) -> bool:
    """Return whether a value is a real number that can be calculated with."""
    return isinstance(value, (int, float)) and is_usable(value)


def is_terms(value: Any) -> bool:
    """Return whether a value is a tuple of (coefficient, key) pairs."""
    return isinstance(value, tuple) and all(
        isinstance(pair, tuple) and len(pair) == 2 and is_number(pair[0]) and isinstance(pair[1], str)
        for pair in value
    )


def column_problems(module: Any) -> list[tuple[str, str]]:
    """Return (place, what is wrong) for the functions of a module whose tables are in order."""
    with np.errstate(all="ignore"):  # an overflow counts as a difference
        return _function_problems(module)


def _function_problems(module: Any) -> list[tuple[str, str]]:
    rows, width = len(module.ROWS), len(module.BASE_PARAMETERS)
    rng = np.random.default_rng(0)
    signals = {entry["key"]: rng.uniform(-1.0, 1.0, SAMPLES) for entry in module.SIGNALS}
    values = rng.uniform(1.0, 2.0, len(module.PARAMETERS)).tolist()
    physical = dict(zip(module.PARAMETERS, values, strict=True))
    try:
        described = module.columns()
        features = module.features(signals)
        measurement, regressor = module.measurement(signals), module.regressor(signals)
        base = module.base_from_physical(physical)
        # a search for them may take long, and its text is the same in every module
        searched = hasattr(module, "fit_physical")
        recovered = dict.fromkeys(module.IDENTIFIABLE) if searched else module.physical_from_base(base)
        space = tuple(module.state_space({**module.KNOWN, **physical}))
    except Exception as error:  # a broken module can raise any exception
        return [("functions", f"raise {type(error).__name__} ({error}) at {PROBED}")]
    expected = {entry["key"]: _feature(entry, signals) for entry in module.FEATURES}
    found = _features_problems(features, expected) + _space_problems(module, space)
    found += _form_problems(described, rows, width, frozenset(("1", *signals, *expected)))
    found += _array_problems("measurement()", measurement, (SAMPLES, rows))
    found += _array_problems("regressor()", regressor, (SAMPLES, rows, width))
    found += _array_problems("base_from_physical()", base, (width,))
    if not isinstance(recovered, Mapping) or sorted(recovered) != sorted(module.IDENTIFIABLE):
        found.append(("physical_from_base()", "does not return exactly the parameters of IDENTIFIABLE"))
    known = {"1": np.ones(SAMPLES), **signals, **expected}
    return found or _disagreements(described, measurement, regressor, known)


def _feature(entry: Mapping[str, Any], signals: Mapping[str, FloatArray]) -> FloatArray:
    """Evaluate a feature as its entry describes it, shape (N,)."""
    factor = 1.0 if entry["times"] is None else signals[entry["times"]]
    if entry["function"] == "cube":
        return np.asarray(_sum(entry["of"], signals) ** 3 * factor)
    of = signals[entry["of"]]
    value = {"sign": np.sign(of), "forward": of > 0.0, "backward": of < 0.0}[entry["function"]]
    return np.asarray(value * factor, dtype=float)


def _sum(terms: tuple[tuple[float, str], ...], known: Mapping[str, FloatArray]) -> FloatArray:
    return sum((coefficient * known[key] for coefficient, key in terms), np.zeros(SAMPLES))


def _features_problems(features: Any, expected: Mapping[str, FloatArray]) -> list[tuple[str, str]]:
    if not isinstance(features, Mapping) or sorted(features) != sorted(expected):
        return [("features()", "does not return exactly the keys of FEATURES")]
    return [
        (f"features()[{key!r}]", f"differs from its entry in FEATURES at {PROBED}")
        for key, value in expected.items()
        if np.shape(features[key]) != (SAMPLES,) or not _close(np.asarray(features[key], float), value).all()
    ]


def _form_problems(described: Any, rows: int, width: int, keys: frozenset[str]) -> list[tuple[str, str]]:
    """Return what is wrong with the form of columns(): one entry a row, known columns, known keys."""
    if not isinstance(described, Mapping) or sorted(described) != ["measurement", "regressor"]:
        return [("columns()", "is not a dict of measurement and regressor")]
    found: list[tuple[str, str]] = []
    for name, entries in described.items():
        place = f"columns()[{name!r}]"
        if not isinstance(entries, tuple) or len(entries) != rows:
            found.append((place, f"is not a tuple of {rows} rows"))
            continue
        for row, entry in enumerate(entries):
            if name == "measurement":
                found += _terms_problems(f"{place}[{row}]", entry, keys)
            elif not isinstance(entry, Mapping):
                found.append((f"{place}[{row}]", "is not a dict of column index to terms"))
            else:
                for column, terms in entry.items():
                    if column not in range(width):
                        found.append(
                            (f"{place}[{row}]", f"has column {column!r}, not one of 0 to {width - 1}")
                        )
                    found += _terms_problems(f"{place}[{row}][{column!r}]", terms, keys)
    return found


def _terms_problems(place: str, terms: Any, keys: frozenset[str]) -> list[tuple[str, str]]:
    if not is_terms(terms):
        return [(place, "is not a tuple of (coefficient, key) pairs")]
    return [(place, f"names {key!r}, which is no signal or feature") for _, key in terms if key not in keys]


def _array_problems(place: str, value: Any, shape: tuple[int, ...]) -> list[tuple[str, str]]:
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.shape == shape:
        return []
    got = f"{value.dtype} {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
    return [(place, f"returns {got}, not float64 {shape}, for {SAMPLES} samples")]


def _space_problems(module: Any, space: tuple[Any, ...]) -> list[tuple[str, str]]:
    """Return what is wrong with the shapes of the matrices that state_space() returns."""
    states = 2 * sum(len(entry["bodies"]) for entry in module.ROLES.values() if entry["role"] == "inertia")
    outputs, forces, frictions = len(module.SENSORS), len(module.ACTUATORS), len(module.FRICTION)
    shapes = [(n, k) for n in (states, outputs) for k in (states, forces, frictions)]
    wanted = [shapes[place] for place in (0, 1, 3, 4, 2, 5)]  # A, B, C, D, E, F
    if [getattr(matrix, "shape", None) for matrix in space] == wanted:
        return []
    return [("state_space()", f"does not return A, B, C, D, E, F of shapes {', '.join(map(str, wanted))}")]


def _disagreements(
    described: Any, measurement: FloatArray, regressor: FloatArray, known: Mapping[str, FloatArray]
) -> list[tuple[str, str]]:
    """Return the entries in which measurement() or regressor() differs from columns()."""
    what = f"differs from columns() at {PROBED}"
    found = [
        (f"measurement(), row {row}", what)
        for row, terms in enumerate(described["measurement"])
        if not _close(measurement[:, row], _sum(terms, known)).all()
    ]
    for row, entries in enumerate(described["regressor"]):
        expected = np.zeros((SAMPLES, regressor.shape[2]))
        for column, terms in entries.items():
            expected[:, column] = _sum(terms, known)
        wrong = np.flatnonzero(~_close(regressor[:, row], expected))
        found += [(f"regressor(), row {row}, column {column}", what) for column in wrong.tolist()]
    return found


def _close(got: FloatArray, expected: FloatArray) -> BoolArray:
    """Return for every column, shape (N,) or (N, columns), whether it differs by rounding only."""
    scale = np.max(np.abs(expected), axis=0)
    return np.asarray(np.all(np.abs(got - expected) <= TOLERANCE * scale, axis=0))
