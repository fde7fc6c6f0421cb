"""Units as instruments write them: products of powers, prefixes, steps of so much; and what is none."""

from __future__ import annotations

import math
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from modelgen.errors import DataError
from modelgen.runtime.files.units import split_name, split_titles, unit_from_text
from modelgen.runtime.records.read_record import read

SPEED, INCH_POUND = 2.0 * math.pi / 60.0, 0.0254 * 4.4482216152605


@pytest.mark.parametrize(
    ("texts", "si", "factor"),
    [
        (("min-1", "min⁻¹", "1/min", "U/min", "Upm", "UPM", "rpm", "rev/min", "[RPM]"), "rad/s", SPEED),
        (("krpm", "1000 rpm", "1e3 U/min"), "rad/s", 1000.0 * SPEED),
        (("Nmm", "N·mm", "mNm", "N mm", "NMM", "0.001 Nm", "mN*m"), "N m", 1e-3),
        (("lbf in", "in-lb", "inlb", "lbf·in", "in lbf"), "N m", INCH_POUND),
        (("mg", "mG"), "m/s^2", 9.80665e-3),
        (("m s-2", "m·s^-2", "ms-2", "m/s/s", "m s⁻²", "m/sec2"), "m/s^2", 1.0),
        (("Grad", "DEG", "degrees", "°"), "rad", math.pi / 180.0),
        (("0.001 mm", "0,001 mm", "um", "µm"), "m", 1e-6),
        (("MM/S", "mm/s", "mm/sec"), "m/s", 1e-3),
        (("Newton", "N"), "N", 1.0),
        (("MHz",), "Hz", 1e6),
    ],
)
def test_what_is_known(texts: tuple[str, ...], si: str, factor: float) -> None:
    for text in texts:
        unit = unit_from_text(text)
        assert unit is not None and (unit.si, unit.factor) == (si, pytest.approx(factor, rel=1e-14)), text


@pytest.mark.parametrize(
    "text",
    [
        *("grad", "GRAD/s", "1/s", "Mm", "°C", "counts/s", "Nm/rad", "m^9", "m^-4", "%Nm", "A V", "1e999 m"),
        *("1e-999 m", "/", "m//s", "-", "5", "m" * 81, "/" * 79, "N-", "\u0661 m\u0661"),
    ],
)
def test_what_is_not(text: str) -> None:
    unit = unit_from_text(text)
    assert unit is None or text == "-"


def test_a_place_in_brackets_is_no_unit() -> None:
    for name in ("/joints.position[elbow]", "position[2]", "position [2]", "a[1]", "speed (elbow)"):
        assert split_name(name) == (name, None)
    assert split_name("theta[deg]") == ("theta", "deg")
    assert split_name("theta [furlong]") == ("theta", "furlong")


def test_a_joint_called_as_a_unit_is_none() -> None:
    """Next to other joints "[m]" is one of them, whatever it says alone; angles in two units stay such."""
    titles = ("time", "position[m]", "position[elbow]", "effort[m]", "torque [m]", "tau[Nm]")
    assert split_titles(titles) == [
        *(("time", None), ("position[m]", None), ("position[elbow]", None), ("effort[m]", None)),
        *(("torque", "m"), ("tau", "Nm")),
    ]
    assert split_titles(("theta[deg]", "theta[furlong]"))[0] == ("theta", "deg")
    assert split_titles(("position[m]", "effort[Nm]"))[0] == ("position", "m")


DEGREE = math.pi / 180.0


@pytest.mark.parametrize(
    ("title", "si", "factor"),
    [
        *(
            (title, "rad", DEGREE)
            for title in ("q_m/deg", "q_m/°", "q_DEG", "posDeg", "q-deg", "q.deg", "q deg")
        ),
        *(
            (title, "rad", DEGREE)
            for title in ("q {deg}", "q <deg>", "[deg] q", "q (deg) raw", "q (deg, raw)")
        ),
        *(("q: degrees", "rad", DEGREE), ("q_m_mrad", "rad", 1e-3), ("q_m_rev", "rad", 2.0 * math.pi)),
        *(
            (title, "rad/s", DEGREE)
            for title in ("v_deg_s", "v_DEG_PER_S", "v/deg/s", "v in deg per s", "v_dps")
        ),
        *(("VEL_MM_S", "m/s", 1e-3), ("a_mm_s2", "m/s^2", 1e-3), ("POS_MM", "m", 1e-3)),
        *(
            ("nRpm", "rad/s", SPEED),
            ("Gamma/Ncm", "N m", 1e-2),
            ("tau_mNm", "N m", 1e-3),
            ("t/msec", "s", 1e-3),
        ),
        *(("enc_counts", "count", 1.0), ("pos.ticks", "count", 1.0), ("GammaNm", "N m", 1.0)),
    ],
)
def test_a_unit_without_brackets_counts(title: str, si: str, factor: float) -> None:
    """An angle in degrees that is taken for radians makes every parameter wrong by 57, without a word."""
    name, text = split_name(title)
    unit = unit_from_text(text or "")
    assert unit is not None and (unit.si, unit.factor) == (si, pytest.approx(factor, rel=1e-14))
    assert name == title or name == title.partition(" in ")[0]


@pytest.mark.parametrize(
    "title",
    [
        *(
            "q_m",
            "q_m_s",
            "x_in",
            "x_min",
            "a_g",
            "i_A",
            "T_h",
            "deg",
            "count",
            "rms",
            "x_rms",
            "params",
            "discount",
        ),
        *("return", "Sturm", "temp_degC", "q_ms_ok", "msg", "torque_nm", "motor.position", "set_day", "x_lb"),
    ],
)
def test_a_word_that_is_no_unit_does_not(title: str) -> None:
    assert split_name(title) == (title, None)


def test_a_title_of_any_length_takes_no_time() -> None:
    start = process_time()
    for text in ("a" + 200_000 * " " + "b", 200_000 * " ,", "q [" * 100_000 + "rad]"):
        assert split_name(text) == (text.strip(), None)
    assert process_time() - start < 1.0


def test_a_unit_that_is_not_known_asks_for_its_factor(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t [ms],torque [furlong]\n0,0\n1,180\n2,360\n")
    with pytest.raises(DataError, match="is in furlong, a unit that is not known, and N m is needed"):
        read(path, {"tau": "torque"}, units={"tau": "N m"})
    signals = read(path, {"tau": "torque"}, {"tau": 2.0}, units={"tau": "N m"}).record.signals
    np.testing.assert_array_equal(signals["tau"], [0.0, 360.0, 720.0])
