"""The report: one page, no request, no script but its own, and every part in it."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modelgen.render.writer import generate
from modelgen.report.envelope import GAP, encoded_series
from modelgen.report.mathml import row_equations
from modelgen.report.page import report_page
from modelgen.report.plots import BUDGET
from modelgen.runtime.curves.rebuilt import autocorrelation, rebuild
from modelgen.runtime.identification.identify import identify
from modelgen.runtime.model.model import Model, model_from_text
from modelgen.runtime.records.record import Record
from modelgen.runtime.results.estimate import Estimate
from modelgen.runtime.simulation.simulate import simulate
from modelgen.spec.load import catalog_path, load_spec
from tests.runtime.two_mass_records import SMALL, two_mass_records

HOSTILE = '</script><script>document.title="owned"</script><img src=x onerror="document.title=\'owned\'">'


@pytest.fixture(scope="module")
def case() -> tuple[Model, Record, Estimate]:
    spec = load_spec(catalog_path("emps300"))
    model = model_from_text(generate(spec, "qm_ac"), "emps300_qm_ac")
    noise = {"q_m": 2e-6, "a_c": 0.5, "Gamma_m": 1e-4}
    record = simulate(
        model, spec.parameter_sets["light"], "chirp", fs=5000.0, duration_s=3.0, noise=noise
    ).record
    return model, record, identify(model, [record])


@pytest.fixture(scope="module")
def page(case: tuple[Model, Record, Estimate]) -> str:
    model, record, estimate = case
    return report_page(model, [record], estimate, {"--method": "wls"})


class Outline(HTMLParser):
    """Ids, tags and addresses of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attributes:
            if name == "id":
                self.ids.append(value or "")
            if name in ("src", "href", "action", "data", "srcset", "poster"):
                self.addresses.append(value or "")


@pytest.mark.slow
def test_every_part_is_there(page: str) -> None:
    outline = Outline(page)
    parts = ["answer", "chain", "forces", "frequency", "loop", "parameters", "residuals", "conditioning"]
    assert [name for name in outline.ids if name in parts] == parts
    assert {"equations", "sensors", "provenance"} <= set(outline.ids)
    assert outline.tags.count("math") >= 3 + 6
    assert outline.tags.count("canvas") == 3
    assert outline.tags.count("svg") == 1 + 3 + 2 * 3 + 2


def test_nothing_is_loaded_from_anywhere(page: str) -> None:
    outline = Outline(page)
    assert all(address.startswith("#") for address in outline.addresses)
    assert "url(" not in page and "@import" not in page and "http://" not in page and "https://" not in page
    assert "default-src &#39;none&#39;" in page


def test_the_policy_allows_the_one_script_by_its_hash(page: str) -> None:
    script = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert len(script) == 1
    digest = base64.b64encode(hashlib.sha256(script[0].encode()).digest()).decode()
    assert f"sha256-{digest}" in page.replace("&#43;", "+")


def test_the_same_inputs_give_the_same_bytes(case: tuple[Model, Record, Estimate], page: str) -> None:
    model, record, estimate = case
    assert report_page(model, [record], estimate, {"--method": "wls"}) == page


def hostile_page(case: tuple[Model, Record, Estimate]) -> str:
    model, record, estimate = case
    renamed = Record(dict(record.signals), record.fs, HOSTILE, HOSTILE)
    rows = tuple(replace(row, record=HOSTILE) for row in estimate.fit.rows)
    noted = replace(estimate, records=(HOSTILE,), fit=replace(estimate.fit, notes=(HOSTILE,), rows=rows))
    titled = replace(model, title=HOSTILE)
    return report_page(titled, [renamed], noted, {HOSTILE: HOSTILE}, [dict.fromkeys(KEYS, HOSTILE)])


KEYS = ("name", "rows", "order", "identifiable", "lost")


def test_names_in_the_data_stay_names(case: tuple[Model, Record, Estimate]) -> None:
    outline = Outline(hostile_page(case))
    assert outline.tags.count("script") == 2
    assert "img" not in outline.tags


@pytest.mark.parametrize("method", ["auto", "wls", "pham2002"])
def test_rebuilt_rows_are_those_of_the_estimate(case: tuple[Model, Record, Estimate], method: str) -> None:
    model, record, estimate = case
    if method != "auto":
        estimate = identify(model, [record], method)
    rows, singular = rebuild(model, [record], estimate)
    for row, entry in zip(rows, estimate.fit.rows, strict=True):
        rms = float(np.sqrt(np.nanmean(row.residual**2)))
        assert rms == pytest.approx(entry.residual_rms, rel=1e-6)
    if method == "wls":
        # with instruments the condition number is that of what these see of W
        assert singular[0] / singular[-1] == pytest.approx(estimate.condition_number, rel=1e-6)


@pytest.mark.slow
def test_rows_are_rebuilt_with_the_delays_that_were_found() -> None:
    records = two_mass_records(late={"Gamma_m": 7.0})
    estimate = identify(SMALL, records)
    rows, _ = rebuild(SMALL, records, estimate)
    assert estimate.delays
    assert len(rows) == len(estimate.fit.rows) == 4
    for row, entry in zip(rows, estimate.fit.rows, strict=True):
        assert float(np.sqrt(np.nanmean(row.residual**2))) == pytest.approx(entry.residual_rms, rel=1e-6)


def test_autocorrelation_of_white_noise_lies_within_its_bound() -> None:
    noise = np.random.default_rng(3).normal(size=20000)
    noise[500:700] = np.nan
    found = autocorrelation(noise, 1e-3)
    assert found is not None
    assert found.values[0] == 1.0
    assert np.mean(np.abs(found.values[1:]) > found.bound) < 0.03
    assert autocorrelation(np.zeros(1000), 1e-3) is None


def test_equations_are_those_of_the_rows(case: tuple[Model, Record, Estimate]) -> None:
    origin, equation = row_equations(case[0])[2]
    assert origin == "m+c: sum of the equations of m, c"
    text = re.sub(r"<[^>]*>", "", equation).replace("&#x2062;", "")
    assert text == "Γm=Jmq¨m+Fvmq˙m+Fsmsign(q˙m)+Jcac"


def decoded(series: dict[str, Any], name: str) -> np.ndarray[Any, Any]:
    levels = np.frombuffer(base64.b64decode(series[name]), dtype="<i2").astype(float)
    return np.where(levels == GAP, np.nan, levels * series["scale"] + series["offset"])


def test_an_envelope_keeps_every_peak_and_gap() -> None:
    values = np.sin(np.arange(100_000) / 50.0)
    values[54_321] = 7.0
    values[1000:3000] = np.nan
    series = encoded_series("a", "measured", values, 1000)
    low, high = decoded(series, "low"), decoded(series, "high")
    assert series["step"] == 100 and low.size == 1000
    assert high[543] == pytest.approx(7.0, abs=2e-4)
    assert np.isnan(low[10:30]).all() and np.isfinite(low[[9, 30]]).all()
    short = encoded_series("a", "measured", values[:900], 1000)
    np.testing.assert_allclose(decoded(short, "low"), values[:900], atol=2e-5)


def test_a_million_samples_stay_small(case: tuple[Model, Record, Estimate], page: str) -> None:
    """The script's data are bounded whatever the records hold; the rest does not grow with them."""
    rest = len(page) - len(page.partition('id="plots">')[2].partition("</script>")[0])
    values = np.random.default_rng(1).normal(size=1_000_000)
    most = min(60_000, BUDGET // 6)
    three = 3 * len(json.dumps(encoded_series("a", "measured", values, most)))
    assert rest + three < 2_000_000 and rest + 4 * BUDGET < 5_400_000


@pytest.fixture(scope="module")
def chromium() -> str:
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if found is None:
        pytest.skip("chromium is not installed: apt-get install chromium")
    return found


def dom(chromium: str, folder: Path, text: str) -> tuple[str, str]:
    """Return the page's elements after its script ran, and the browser's log of the network."""
    (folder / "report.html").write_text(text, encoding="utf-8")
    log = folder / "net.json"
    command = [
        chromium,
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        f"--user-data-dir={folder / 'profile'}",
        f"--log-net-log={log}",
        "--dump-dom",
        (folder / "report.html").as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout, log.read_text(encoding="utf-8")


def asked_by_the_page(log: str) -> list[str]:
    """Who asked the network for anything, the browser itself (which has no origin) aside."""
    return [who for who in re.findall(r'"initiator":"([^"]*)"', log) if who != "not an origin"]


@pytest.mark.slow
def test_chromium_runs_the_script_and_asks_nobody(chromium: str, tmp_path: Path, page: str) -> None:
    shown, log = dom(chromium, tmp_path, page)
    assert 'data-ready="yes"' in shown
    assert asked_by_the_page(log) == []
    # the log would have shown it
    _, log = dom(chromium, tmp_path, '<img src="http://report-probe.invalid/x.png">')
    assert asked_by_the_page(log) == ["null"]


@pytest.mark.slow
def test_chromium_runs_no_name(chromium: str, tmp_path: Path, case: tuple[Model, Record, Estimate]) -> None:
    shown, _ = dom(chromium, tmp_path, hostile_page(case))
    assert 'data-ready="yes"' in shown
    assert "<title>emps300, sensors qm_ac</title>" in shown


@pytest.mark.slow
def test_print_shows_what_is_behind_folds(chromium: str, tmp_path: Path, page: str) -> None:
    pypdf = pytest.importorskip("pypdf")
    (tmp_path / "report.html").write_text(page, encoding="utf-8")
    command = [
        *(chromium, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking"),
        *(f"--user-data-dir={tmp_path / 'profile'}", f"--print-to-pdf={tmp_path / 'report.pdf'}"),
        (tmp_path / "report.html").as_uri(),
    ]
    subprocess.run(command, capture_output=True, check=True, timeout=120)
    printed = "".join(leaf.extract_text() for leaf in pypdf.PdfReader(tmp_path / "report.pdf").pages)
    # one thing of every fold
    for text in (
        "noise",
        "Residual tests",
        "lag in ms",
        "Condition number",
        "Order ",
        "row by row",
        "SHA-256 of",
    ):
        assert text in printed, text
    assert page.count("<details") == 8


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_chromium_draws_the_plots_in_the_colours_of_the_scheme(
    chromium: str, tmp_path: Path, page: str, dark: bool
) -> None:
    """Paper, rebuilt lines and residuals have the colours of the style sheet, and are there."""
    image = pytest.importorskip("matplotlib.image")
    (tmp_path / "report.html").write_text(page, encoding="utf-8")
    command = [
        *(chromium, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking"),
        *(["--force-dark-mode", "--blink-settings=preferredColorScheme=0"] if dark else []),
        *(f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1300,1800"),
        *(f"--screenshot={tmp_path / 'shot.png'}", (tmp_path / "report.html").as_uri()),
    ]
    subprocess.run(command, capture_output=True, check=True, timeout=120)
    pixels = np.round(255 * image.imread(tmp_path / "shot.png")[..., :3]).astype(int).reshape(-1, 3)
    light_style, dark_style = re.findall(r":root \{(.*?)\}", page, re.DOTALL)[:2]
    colours = dict(re.findall(r"--(\w+): #(\w{6})", dark_style if dark else light_style))
    for name, share in (("paper", 0.5), ("rebuilt", 0.005), ("residual", 0.0005)):
        wanted = [int(colours[name][k : k + 2], 16) for k in (0, 2, 4)]
        # lines that are thinner than a pixel are blended with the paper
        near = np.mean(np.abs(pixels - wanted).max(axis=1) <= 12)
        assert near > share, (name, near)
