"""Samples and frequencies that nothing can be calculated with: a message, and no warning of a library."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import load_model
from modelgen.runtime.records.read_record import read_record
from modelgen.runtime.records.record import Record
from modelgen.runtime.simulation.excitation import Excitation

GOOD = np.sin(np.arange(50.0))
N = GOOD.size


def with_sample(value: Any, dtype: Any = float) -> Any:
    samples = GOOD.astype(dtype)
    samples[7] = value
    return samples


REFUSED: dict[str, tuple[Any, str]] = {
    **{f"{value:g}": (with_sample(value), r"sample 7: is ") for value in (1e31, 1e150, -1e150, 1e308)},
    "inf": (with_sample(np.inf), "sample 7: is inf"),
    "nan": (with_sample(np.nan), "sample 7: is nan"),
    "tiny": (1e-200 * GOOD, "none reaches 1e-100"),
    "denormal": (np.full(N, 5e-324), "none reaches 1e-100"),
    "long double": (with_sample(np.longdouble("1e400"), np.longdouble), "sample 7: is inf"),
    "half": (with_sample(np.inf, np.float16), "sample 7: is inf"),
    "masked": (np.ma.masked_greater(GOOD, 0.99), "is masked"),
    "complex": (GOOD + 0j, "data type complex128"),
    "object": (GOOD.astype(object), "data type object"),
    "bool": (GOOD > 0.0, "data type bool"),
    "dates": (np.arange(N).astype("datetime64[s]"), "data type datetime64"),
    "differences of dates": (np.arange(N).astype("timedelta64[s]"), "data type timedelta64"),
    "text": (GOOD.astype(str), "data type <U"),
    "two dimensions": (GOOD.reshape(5, 10), r"shape \(5, 10\)"),
}
TAKEN: dict[str, Any] = {
    "zeros": np.zeros(N),
    "negative zeros": -np.zeros(N),
    "greatest integers": with_sample(np.iinfo(np.int64).max, np.int64),
    "least integers": with_sample(np.iinfo(np.int64).min, np.int64),
    "unsigned": with_sample(np.iinfo(np.uint64).max, np.uint64),
    "half": GOOD.astype(np.float16),
    "long double": GOOD.astype(np.longdouble),
    "big endian": GOOD.astype(">f8"),
    "small next to large": with_sample(1e-300),
}
FREQUENCIES = [
    1e308,
    1e10,
    5e-324,
    1e-10,
    0.0,
    -0.0,
    -1.0,
    np.nan,
    np.inf,
    -np.inf,
    10**400,
    True,
    "x",
    None,
    1j,
]


@pytest.mark.parametrize("kind", REFUSED)
def test_a_record_of_such_samples(kind: str) -> None:
    samples, message = REFUSED[kind]
    with pytest.raises(DataError, match=f"channel q_m.*{message}"):
        Record({"F": GOOD, "q_m": samples}, fs=1000.0)


@pytest.mark.parametrize(
    "kind", [kind for kind in REFUSED if kind not in ("masked", "object", "two dimensions")]
)
def test_a_file_of_such_samples(trap: Path, kind: str) -> None:
    samples, message = REFUSED[kind]
    np.savez(trap / "a.npz", fs=1000.0, F=GOOD, q_m=samples)
    for factor in (1.0, 1e30):
        with pytest.raises(DataError, match=f"(?s)(a.npz: column|a: channel) q_m.*{message}|{message}"):
            read_record(trap / "a.npz", scales={"q_m": factor}, needed=("F", "q_m"))


@pytest.mark.parametrize("kind", TAKEN)
def test_samples_that_are_odd_but_right(trap: Path, kind: str) -> None:
    np.savez(trap / "a.npz", fs=1000.0, q_m=TAKEN[kind])
    for record in (Record({"q_m": TAKEN[kind]}, 1000.0), read_record(trap / "a.npz")):
        np.testing.assert_array_equal(record.signals["q_m"], TAKEN[kind].astype(float))


def excitation(fs: Any) -> object:
    return Excitation(GOOD, GOOD, GOOD, fs)


def archive(fs: Any) -> object:
    np.savez("a.npz", fs=fs, q_m=GOOD)
    return read_record("a.npz")


def given(fs: Any) -> object:
    np.savez("a.npz", q_m=GOOD)
    return read_record("a.npz", fs=fs)


def text(fs: Any) -> object:
    Path("a.csv").write_text(
        f'# modelgen record {{"fs": {fs}, "name": "a", "tag": null}}\nq_m\n1\n2\n3\n', encoding="utf-8"
    )
    return read_record("a.csv")


def mapped(fs: Any) -> object:
    np.save("q_m.npy", GOOD)
    return open_npy({"q_m": "q_m.npy"}, fs)


PLACES: dict[str, Callable[[Any], object]] = {
    "record": lambda fs: Record({"q_m": GOOD}, fs),
    "excitation": excitation,
    "archive": archive,
    "given": given,
    "text": text,
    "mapped": mapped,
}


@pytest.mark.parametrize("fs", FREQUENCIES, ids=lambda fs: f"{str(fs)[:8]} {type(fs).__name__}")
@pytest.mark.parametrize("place", PLACES)
def test_a_frequency_that_is_none(trap: Path, place: str, fs: Any) -> None:
    with pytest.raises(DataError) as caught:
        PLACES[place](fs)
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize("step", [1e-300, 1e-12, 1e20, 1e300, np.nan, np.inf, 0.0, -0.001])
def test_times_that_are_none(trap: Path, step: float) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        times = np.arange(N) * step
    np.savez(trap / "a.npz", t=times, q_m=GOOD)
    with pytest.raises(DataError, match=r"a: fs|a\.npz: column t"):
        read_record(trap / "a.npz")


@pytest.mark.parametrize(("position", "force"), [(1e-29, 1e-29), (1e29, 1e26), (1e-90, 1.0), (1.0, 1e-90)])
@pytest.mark.parametrize("fs", [1e-9, 1000.0, 1e9])
def test_an_identification_at_the_limits(position: float, force: float, fs: float) -> None:
    model = load_model(Path(__file__).resolve().parents[2] / "generated" / "emps_rigid_qm.py")
    t = np.arange(2000) / 1000.0
    q = np.sin(9.0 * t) + 0.2 * np.sin(44.0 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    record = Record({"q_m": position * q, "F": force * (9.0 * a + 2.0 * v)}, fs)
    if min(position, force) < 1e-30:
        with pytest.raises(DataError, match="none reaches 1e-30"):
            identify(model, [record], "wls")
        return
    assert identify(model, [record], "wls").params  # and no warning, which would be an error here
