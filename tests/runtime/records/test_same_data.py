"""The same data given twice is refused, however it is dressed; data with noise of its own is not."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from generated import emps300_qm_qc
from modelgen.cli.main import app
from modelgen.errors import DataError
from modelgen.runtime.files.npy_channels import open_npy
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.identification.options import values_of
from modelgen.runtime.model.model import model_from_module
from modelgen.runtime.records import same_data
from modelgen.runtime.records.record import Record
from modelgen.runtime.records.same_data import Contents, contents, is_held_out, refuse_same_data
from modelgen.runtime.simulation.simulate import simulate

MODULE = Path(str(emps300_qm_qc.__file__))
MODEL = model_from_module(emps300_qm_qc)
Signals = Mapping[str, npt.NDArray[np.float64]]


def measured(seed: int, n: int = 3000, resolution: float = 0.0, rest: int = 0) -> dict[str, Any]:
    """Return channels with noise of their own, of encoders of a resolution, after a standstill."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 1000.0
    signals = {
        "q_m": np.sin(5.0 * t) + 1e-4 * rng.standard_normal(n),
        "q_c": np.sin(5.0 * t - 0.1) + 1e-4 * rng.standard_normal(n),
        "Gamma_m": np.cos(7.0 * t) + 1e-2 * rng.standard_normal(n),
    }
    for key in ("q_m", "q_c"):
        if resolution:
            signals[key] = resolution * np.round(signals[key] / resolution)
        signals[key] -= signals[key][0]
    return {key: np.concatenate([np.zeros(rest), values]) for key, values in signals.items()}


def seven_digits(signals: Signals, _: np.random.Generator) -> Signals:
    return {key: np.array([float(f"{value:.6e}") for value in values]) for key, values in signals.items()}


def another_unit(signals: Signals, _: np.random.Generator) -> Signals:
    return {key: values * 1000.0 for key, values in signals.items()}


def a_cut(signals: Signals, rng: np.random.Generator) -> Signals:
    start = int(rng.integers(0, 1500))
    stop = start + int(rng.integers(200, 1500))
    return {key: values[start:stop] for key, values in signals.items()}


def a_tail_that_goes_on(signals: Signals, rng: np.random.Generator) -> Signals:
    start = int(rng.integers(100, 2500))
    return {
        key: np.concatenate([values[start:], values[start - 100 : start] + rng.standard_normal(100)])
        for key, values in signals.items()
    }


def other_order(signals: Signals, _: np.random.Generator) -> Signals:
    return dict(reversed(signals.items()))


def as_it_is(signals: Signals, _: np.random.Generator) -> Signals:
    return signals


DRESSES = [as_it_is, other_order, seven_digits, another_unit, a_cut, a_tail_that_goes_on]


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.sampled_from(DRESSES), st.integers(0, 10**6), st.sampled_from([0.0, 1e-3, 2e-2]), st.integers(0, 500)
)
def test_the_same_data_is_found_in_any_dress(
    dress: Callable[[Signals, np.random.Generator], Signals], seed: int, resolution: float, rest: int
) -> None:
    signals = measured(seed, resolution=resolution, rest=rest)
    dressed = dress(signals, np.random.default_rng(seed))
    others = [Record(measured(seed + k, 3000 + rest), 1000.0, f"own {k}") for k in (1, 2)]
    first = Record(signals, 1000.0, "first")
    second = Record(dressed, 500.0, "second", "chirp")
    for order in ([first, *others, second], [second, first, *others]):
        with pytest.raises(
            DataError, match=r"(first|second): (holds the same data as|shares \d+ samples with)"
        ):
            refuse_same_data(order, MODEL.channels)
    refuse_same_data([first, *others], MODEL.channels)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 1e-3, 2e-2]), st.integers(0, 500), st.integers(2, 200))
def test_data_with_noise_of_its_own_passes(seed: int, resolution: float, rest: int, short: int) -> None:
    records = [measured(seed + k, 3000, resolution, rest) for k in range(3)]
    records += [{key: values[:short] for key, values in measured(seed + 3).items()}]
    records += [{key: np.zeros(3000) for key in MODEL.channels}]
    sources = [Record(one, 1000.0, f"run {i}") for i, one in enumerate(records)]
    refuse_same_data(sources, MODEL.channels)


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.floats(-11.0, -5.5), st.sampled_from([0.0, 1.0]))
def test_the_same_motion_measured_twice_passes_however_small_the_noise(
    seed: int, exponent: float, of_force: float
) -> None:
    """As `simulate` with another seed: forces may be equal to the last bit, readings are not."""
    rng = np.random.default_rng(seed)
    t = np.arange(3000) / 1000.0
    clean = {"q_m": np.sin(5.0 * t), "q_c": np.sin(5.0 * t - 0.1), "Gamma_m": 3.0 * np.cos(7.0 * t)}
    noise = {"q_m": 10**exponent, "q_c": 10**exponent, "Gamma_m": of_force * 10**exponent}

    def reading() -> Signals:
        return {key: one + noise[key] * rng.standard_normal(t.size) for key, one in clean.items()}

    first, second = reading(), reading()
    refuse_same_data([Record(first, 1000.0, "1"), Record(second, 1000.0, "2")], MODEL.channels)
    for dress in (as_it_is, seven_digits, another_unit):
        with pytest.raises(DataError, match="2: holds the same data as 1"):
            refuse_same_data(
                [Record(first, 1000.0, "1"), Record(dress(first, rng), 1000.0, "2")], MODEL.channels
            )


def test_every_way_to_an_estimate_refuses_it(tmp_path: Path) -> None:
    record = simulate(MODEL, MODEL.parameter_sets["table_2"], "chirp", duration_s=1.0, oversample=4).record
    again = Record(dict(record.signals), record.fs, "again", "trapezoid")
    with pytest.raises(
        DataError, match=f"again: holds the same data as {record.name}; leave one of them out"
    ):
        identify(MODEL, [record, again])
    with pytest.raises(DataError, match="again: holds the same data"):
        identify(MODEL, [record, again], **values_of(hold_out=["again"]))
    for channel, samples in record.signals.items():
        np.save(tmp_path / f"{channel}.npy", samples.astype(np.float32))
    mapped = open_npy({key: tmp_path / f"{key}.npy" for key in record.signals}, record.fs, "mapped")
    with pytest.raises(DataError, match="mapped: holds the same data"):
        identify(MODEL, [record, mapped])


def test_a_file_by_another_path_is_the_same_file(tmp_path: Path) -> None:
    folder = tmp_path / "press"
    folder.mkdir()
    np.save(folder / "q_m.npy", np.zeros(10))
    (tmp_path / "crane").symlink_to(folder)
    given_twice = [str(folder), str(tmp_path / "crane")]
    result = CliRunner().invoke(
        app, ["fleet", *given_twice, "--model", str(MODULE), "--cutoff-hz", "1", "--fs", "100"]
    )
    assert result.exit_code == 2
    assert f"is the same file as {folder}; give it once" in result.stderr.replace("\n", " ")


def test_a_used_record_is_told_by_its_samples(tmp_path: Path) -> None:
    signals, channels = measured(1), ("q_m", "q_c", "Gamma_m")
    given = Record(signals, 1000.0, "run")
    used = contents(given, channels)
    assert len(used) == 3 and len(set(used)) == 3
    assert not is_held_out(Record({"q_m": signals["q_m"]}, 1000.0, "by another name"), channels, used)
    assert is_held_out(Record(measured(2), 1000.0, "run"), channels, used)  # by the same name
    paths = {key: tmp_path / f"{key}.npy" for key in channels}
    for key, path in paths.items():
        np.save(path, signals[key])
    assert contents(open_npy(paths, 1000.0, "read in stretches"), channels) == used
    # what never changes is the same in any record
    still = {"q_m": np.zeros(50), "Gamma_m": np.arange(50.0)}
    assert len(contents(Record(still, 1000.0), channels)) == 1
    # without contents, as older estimates were saved, by its name
    assert not is_held_out(Record(measured(2), 1000.0, "run"), channels, ("run",))


def test_contents_are_worked_out_when_they_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    records = [Record({"q": np.arange(5.0) * k}, 100.0) for k in (1, 2)]
    made: list[str] = []

    def counted(one: Record, keys: tuple[str, ...]) -> tuple[str, ...]:
        made.append(one.name)
        return contents(one, keys)

    monkeypatch.setattr(same_data, "contents", counted)
    found = Contents(records, ("q",))
    assert not made
    plain = tuple(text for one in records for text in contents(one, ("q",)))
    again = pickle.loads(pickle.dumps(found))
    assert (tuple(found), again, found[-1], len(found)) == (plain, plain, plain[-1], 2)
    assert isinstance(again, tuple)
    assert len(made) == 2
