"""The report: what stands in it, what a browser makes of it, and its figures for print."""

import json
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impid_host.cli import cli
from impid_host.diagnosis.events import Event
from impid_host.diagnosis.result import Diagnosis, Floor, Number, Stage, Trace
from impid_host.report.page.journal import draw
from impid_host.report.page.plot import Band, Line, Plot, Span
from impid_host.report.page.quality import lost
from impid_host.report.page.residual_plots import event_spans, residual_plots
from impid_host.report.page.svg import svg, ticks
from impid_host.samples import FLAG_RESET, DeviceSamples
from impid_host.study.folder import write_study

from tests.host.report.small_study import K, study
from tests.host.view.browser import Browser

PROBE = """<script>window.problems = [];
addEventListener("error", (e) => problems.push(String(e.message)));
console.error = console.warn = (...a) => problems.push(a.join(" "));</script>"""


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], catch_exceptions=False)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("report")
    folder = write_study(study("good"), place / "good")
    done = run(
        "report", folder, "--no-diagnose", "--out", place / "good.html", "--figures", place / "figures"
    )
    assert done.exit_code == 0, done.output
    return place / "good.html"


@pytest.fixture(scope="module")
def impossible(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of joint 1 has the wrong sign."""
    place = tmp_path_factory.mktemp("report")
    folder = write_study(study("wrong", sign=-1.0), place / "wrong")
    done = run("report", folder, "--no-diagnose", "--out", place / "wrong.html")
    assert done.exit_code == 3, done.output
    return place / "wrong.html"


def probed(page: Path, tmp_path: Path) -> str:
    """The address of the page with a probe that collects what a console would show."""
    copy = tmp_path / "probed.html"
    copy.write_text(page.read_text(encoding="utf-8").replace("<head>", f"<head>{PROBE}", 1), encoding="utf-8")
    return f"file://{copy}"


def loaded(browser: Browser) -> Browser:
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline and not browser.evaluate("window.impidPlots?.length ?? 0"):
        time.sleep(0.1)
    assert browser.evaluate("document.readyState") == "complete"
    return browser


def test_the_page_holds_everything_and_asks_nobody(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    outside = re.findall(
        r"""(?:src|href)\s*=\s*(?!["']?(?:#|data:))[^\s>]+|url\((?!["']?data:)|@import|fetch\(""", text
    )
    assert outside == []
    assert "P&lt;07&gt;" in text  # what a file says is text, never markup
    assert "P<07>" not in text
    for part in ("Checks", "Result", "Residuals of whole trials", "Ellipses", "Provenance"):
        assert f"<h2>{part}</h2>" in text
    assert "sha256 of free_01/robot.csv" in text
    assert "no cause was looked for" in text.lower()
    assert "By the first model" not in text  # it is the only one
    assert "kg·m²" in text
    assert "kg*m^2" not in text


def test_the_page_says_the_numbers_in_a_sentence(page: Path) -> None:
    """The spring's own, with an interval that holds them."""
    text = page.read_text(encoding="utf-8")
    found = re.search(
        r"<li>spring: stiffness ([\d.]+) ± ([\d.]+) N/m along x, ([\d.]+) ± ([\d.]+) N/m along y; "
        r"inertia ([\d.]+) ± ([\d.]+) kg \(± is the 95 % interval\)</li>",
        text,
    )
    assert found is not None
    values = [float(part) for part in found.groups()]
    for (value, half), truth in zip(
        zip(values[::2], values[1::2], strict=True), (K[0, 0], K[1, 1], 0.5), strict=True
    ):
        assert abs(value - truth) < 3 * half


def test_numbers_of_the_page_are_those_of_fit(page: Path) -> None:
    document = json.loads(run("fit", page.parent / "good", "--json", "-").output)
    value = document["loads"]["spring"]["method1"]["K"]["value"][0][0]
    assert value == pytest.approx(K[0, 0], rel=0.01)
    found = re.search(
        r"<th scope=\"row\">kxx</th><td class=\"right\">([\d.]+) ± ", page.read_text(encoding="utf-8")
    )
    assert found is not None
    assert float(found[1]) == pytest.approx(value, rel=1e-4)


def test_a_browser_shows_it_without_complaint_and_zooms_by_keyboard(page: Path, tmp_path: Path) -> None:
    with Browser(probed(page, tmp_path), tmp_path / "profile") as browser:
        loaded(browser)
        assert browser.evaluate("problems") == []
        assert browser.evaluate("performance.getEntriesByType('resource').length") == 0
        first = "document.querySelector('figure.plot')"
        press = f"(key) => {first}.dispatchEvent(new KeyboardEvent('keydown', {{key, bubbles: true}}))"
        browser.evaluate(f"{first}.focus()")
        assert browser.evaluate(f"document.activeElement === {first}")
        box = f"{first}.querySelector('svg.data').getAttribute('viewBox')"
        whole = browser.evaluate(box)
        browser.evaluate(f"({press})('+')")
        near = [float(part) for part in browser.evaluate(box).split()]
        assert near == pytest.approx([2500, 2500, 5000, 5000])
        browser.evaluate(f"({press})('ArrowRight')")
        assert float(browser.evaluate(box).split()[0]) == pytest.approx(3500)
        browser.evaluate(f"({press})('0')")
        assert [float(part) for part in browser.evaluate(box).split()] == pytest.approx(
            [float(part) for part in whole.split()]
        )
        # Python drew the ticks first, the page draws them anew: the same words in the same places.
        again = browser.evaluate(f"[...{first}.querySelectorAll('g.axes text')].map((e) => e.textContent)")
        drawn = re.search(r'<g class="axes">(.*?)</g>', page.read_text(encoding="utf-8"))
        assert drawn is not None
        assert again == re.findall(r"<text[^>]*>([^<]*)</text>", drawn[1])


CONTRAST = (Path(__file__).parent / "contrast.js").read_text(encoding="utf-8")


def test_every_word_has_contrast_and_an_impossible_result_cannot_be_missed(
    impossible: Path, tmp_path: Path
) -> None:
    with Browser(probed(impossible, tmp_path), tmp_path / "profile") as browser:
        loaded(browser)
        assert browser.evaluate("problems") == []
        assert browser.evaluate(CONTRAST) == []
        browser.resize(1200, 800, dark=True)
        assert browser.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 27)"
        assert browser.evaluate(CONTRAST) == []
        browser.resize(1200, 800)
        seen = browser.evaluate(
            "(() => { const r = document.querySelector('.banner').getBoundingClientRect(); "
            "return [r.top, r.height, innerHeight]; })()"
        )
        assert 0 < seen[0] < 0.3 * seen[2]
        assert seen[1] > 80
        shout = browser.evaluate("document.querySelector('.shout').textContent")
        assert shout == "IMPOSSIBLE: DO NOT USE THESE NUMBERS"
        # It is the first thing in the study after its name, and no colour is needed to see it.
        words = browser.evaluate("document.querySelector('main').innerText")
        assert words.index("IMPOSSIBLE") < 120
        bare = browser.evaluate(
            "[...document.querySelectorAll('table')]"
            ".filter((t) => /Robot|Load/.test(t.caption?.textContent ?? ''))"
            ".flatMap((t) => [...t.querySelectorAll('td.right')]).map((d) => d.textContent)"
            ".filter((s) => /\\d/.test(s) && !s.includes('(!)'))"
        )
        assert bare == []


def test_figures_for_print_have_the_width_of_a_column(page: Path) -> None:
    folder = page.parent / "figures"
    pdfs = sorted(folder.glob("*.pdf"))
    assert {path.stem for path in pdfs} == {path.stem for path in folder.glob("*.svg")}
    keys = {path.stem for path in pdfs}
    shown = set(re.findall(r'<figure class="plot[^"]*" id="([^"]+)"', page.read_text(encoding="utf-8")))
    assert keys == shown
    for path in pdfs:
        box = re.search(rb"/MediaBox \[\s*0 0 ([\d.]+) ([\d.]+)", path.read_bytes())
        assert box is not None
        width_mm = float(box[1]) / 72 * 25.4
        assert width_mm == pytest.approx(88 if path.stem.startswith("ellipse") else 180, abs=1)
    assert "<text" in next(iter(folder.glob("*.svg"))).read_text(encoding="utf-8")


def test_a_line_is_where_its_numbers_are_and_breaks_where_there_are_none() -> None:
    x = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    y = np.array([-1.0, 1.0, np.nan, 0.0, 0.5])
    text = svg(
        Plot("k", "<t>", "x", "y", (Line(x, y, "n", "second"),), spans=(Span(1.0, 2.0, "push", "event"),))
    )
    limits = json.loads(re.search(r'data-limits="([^"]*)"', text)[1])  # type: ignore[index]
    assert limits == pytest.approx([0, 4, -1.1, 1.1])
    path = re.search(r'<path class="line second"[^>]* d="([^"]*)"', text)
    assert path is not None
    pieces = path[1].split("M")[1:]
    assert len(pieces) == 2
    points = []
    for piece in pieces:
        start, rest = piece.split("l", 1)
        steps = np.array([int(v) for v in rest.split()]).reshape(-1, 2)
        points.append(np.array([int(v) for v in start.split()]) + np.cumsum(steps, axis=0))
    at = np.concatenate(points)
    assert at[:, 0] / 1e4 * 4 == pytest.approx(x[[0, 1, 3, 4]], abs=1e-3)
    assert 1.1 - at[:, 1] / 1e4 * 2.2 == pytest.approx(y[[0, 1, 3, 4]], abs=1e-3)
    assert "&lt;t&gt;" in text
    assert 'class="event" x="2500" y="0" width="2500"' in text


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 10, [0, 2, 4, 6, 8, 10]),
        (-0.011, 0.012, [-0.01, -0.005, 0, 0.005, 0.01]),
        (99.5, 100, [99.5, 99.6, 99.7, 99.8, 99.9, 100]),
    ],
)
def test_ticks_are_round(low: float, high: float, expected: list[float]) -> None:
    assert ticks(low, high, 6) == pytest.approx(expected)


def diagnosis(notes: tuple[str, ...]) -> Diagnosis:
    """Two stages and one trial, by hand."""
    t = np.arange(0.0, 20.0, 0.01)
    before = np.sin(t)
    trace = Trace("tau1", "free_01", t, t > 15.0, before, 0.1 * before, {"omega1": np.cos(t)})
    number = Number(np.array([1.0]), np.array([[0.9, 1.1]]), "SI")
    stage = Stage(None, {"tau1": 1.0}, {"tau1": 50.0}, number, ("a1",), {})
    return Diagnosis(
        "s", "papers", ("free_01",), (), (stage, replace(stage, rms={"tau1": 0.1})), {"tau1": 0.05}, 0.0,
        False, notes=notes, traces=(trace,), told=Floor({}, {}, {}),
    )  # fmt: skip


def test_events_are_marked_in_their_trial_over_its_whole_length() -> None:
    notes = (
        f"{Event('free_01', 6.0, 10.0, 9.0).words}: left out of the fit",
        f"{Event('free_012', 2.0, 4.0, 9.0).words}: left out of the fit",
        "no accelerometer",
    )
    assert event_spans(notes, "free_01") == [Span(6.0, 10.0, "event: left out of the fit", "event")]
    (plot,) = residual_plots(diagnosis(notes))
    assert [(s.kind, s.low) for s in plot.spans] == [("held out", pytest.approx(15.01)), ("event", 6.0)]
    assert [line.name for line in plot.lines] == ["before: papers' model", "after: with what was found"]
    assert plot.limits()[:2] == pytest.approx((0.0, 20.0), abs=0.02)
    assert plot.caption == "rms 0.7 before, 0.07 after; noise floor 0.05 N m rms"
    one = diagnosis(notes)
    (alone,) = residual_plots(replace(one, stages=one.stages[:1]))
    assert [line.name for line in alone.lines] == ["left by the papers' model"]


def test_a_band_and_dots_are_drawn_for_print(tmp_path: Path) -> None:
    x = np.linspace(0, 1, 5)
    plot = Plot(
        "k",
        "t",
        "x",
        "y",
        (Line(x, x, "n", "first", dots=True),),
        (Band(x, x - 1, x + 1, "first"),),
        (Span(0, 0.5, "e", "event"),),
    )
    paths = draw([plot], tmp_path)
    assert [path.name for path in paths] == ["k.pdf", "k.svg"]
    assert plot.limits() == pytest.approx((-0.05, 1.05, -1.15, 2.15))
    assert paths[0].read_bytes() == draw([plot], tmp_path / "again")[0].read_bytes()


def test_lost_samples_are_counted_through_a_wrap_and_not_over_a_reset() -> None:
    seq = np.array([2**32 - 2, 2**32 - 1, 0, 3, 0, 1], dtype=np.uint32)
    flags = np.array([FLAG_RESET, 0, 0, 0, FLAG_RESET, 0], dtype=np.uint8)
    none = np.zeros(6)
    samples = DeviceSamples(
        none.astype(np.uint64), seq, none.astype(np.uint16), none.astype(np.uint16), none.astype(np.int32),
        none.astype(np.int32), flags,
    )  # fmt: skip
    assert lost(samples) == 2


def test_a_page_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    folder = write_study(study("good"), tmp_path / "good")
    done = CliRunner().invoke(
        cli, ["report", str(folder), "--no-diagnose", "--out", str(tmp_path / "no" / "r.html")]
    )
    assert done.exit_code == 1
    assert "cannot be written" in str(done.exception)
