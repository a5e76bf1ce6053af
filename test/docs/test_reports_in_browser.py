"""Reports as a reader meets them: drawn, readable on a telephone and on paper, harmless whatever names they show.

The reports of demonstration, identification, diagnosis and fleet are looked at beside the tests that make them.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report
from program import load_script

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples
from sgms_observer.report.drawing import Line, Panel, sheet, time_plot
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Link, Page, Section, Table, light, write_page
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
HOSTILE = "<script>window.taken = 1</script><img src=x onerror='window.taken = 1'>\"'&{{ 7 * 7 }}"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a page with one of everything, all of it with a hostile name."""
    time = 0.01 * np.arange(1000)
    wave = np.where(time < 9.0, np.sin(time), np.nan)
    panels = [
        Panel(HOSTILE, [Line(HOSTILE, wave, "measured"), Line("cosine [N]", np.cos(time), "estimate")]),
        Panel("sine [N]", [Line("sine", wave, "ink")]),
    ]
    with sheet(HOSTILE, f"A picture of {HOSTILE}") as drawn:
        drawn.axes[0].plot([0.0, 1.0], [0.0, 1.0], label=f"a {HOSTILE}")
        drawn.axes[0].plot([0.0, 1.0], [1.0, 0.0], label="b")
        drawn.axes[0].set_xlabel(HOSTILE)
    row = [HOSTILE, "1" * 20, "2" * 20, "3", "4", "word " * 9]
    wide = Table([HOSTILE, "N", "c", "d", "e", "f"], [row] * 3, HOSTILE)
    folded = Table(["a", "b"], [["1", "2"]], "A table that is folded", is_folded=True)
    sections = [
        Section(HOSTILE, [HOSTILE, "word " * 40], [wide, folded], [drawn.picture]),
        Section("Over time", plots=[time_plot("over_time", HOSTILE, time, panels)]),
        Section("Folded", ["What is read last."], is_folded=True),
    ]
    lights = [Light("Data", f"Is {HOSTILE} harmless?", state, HOSTILE) for state in (GOOD, UNSURE, BAD)]
    return write_page(
        Page(HOSTILE, HOSTILE, sections, HOSTILE, [f"Warning: {HOSTILE}."], lights), tmp_path_factory.mktemp("page")
    )


def test_report_shows_what_bags_and_files_say_and_runs_none_of_it(page: Path, browser: Browser) -> None:
    view = check_report(browser, page, 1)
    assert any(image[2].endswith(HOSTILE) for image in view.images)
    asked = ["window.taken === undefined", "document.querySelectorAll('figure img, svg script, svg a').length"]
    assert browser.press(page, [], asked) == [[True, 0], ()]


def test_report_says_the_answer_and_the_warnings_before_anything_else(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    body = text[text.index("<body>") :]
    places = [body.index(f'class="{name}"') for name in ("verdict", "warnings", "lights")]
    assert places == sorted(places) and places[-1] < body.index("<h2>")
    for state, word in ((GOOD, "Yes."), (UNSURE, "Not sure."), (BAD, "No.")):
        assert f'<li class="{state}">' in body and f"<strong>{word}</strong>" in body


@pytest.mark.parametrize(("width", "media"), [(1200, ""), (718, ""), (718, "print"), (400, "")])
def test_every_question_stands_below_the_heading_of_its_topic(
    tmp_path: Path, browser: Browser, width: int, media: str
) -> None:
    """Nine questions of the last topic stay in its one column, whatever the width of the page."""
    topics = ["Data"] * 2 + ["Convergence"] * 2 + ["Believability"] * 9
    lights = [Light(topic, f"Is number {k} true?", GOOD, "word " * 12) for k, topic in enumerate(topics)]
    page = write_page(Page("title", "verdict", [], lights=lights), tmp_path)
    edges = "(e => [e.left, e.top, e.right, e.bottom])(%s.getBoundingClientRect())"
    asked = (
        "[...document.querySelectorAll('.lights section')].map(s => "
        f"[{edges % 's.firstElementChild'}, [...s.querySelectorAll('li')].map(e => {edges % 'e'})])"
    )
    groups, complaints = browser.press(page, [], [asked], width=width, media=media)
    assert complaints == () and [len(questions) for _, questions in groups[0]] == [2, 2, 9]
    boxes = []
    for heading, questions in groups[0]:
        assert {question[0] for question in questions} == {heading[0]}
        tops = [heading[1], *(question[1] for question in questions)]
        assert tops == sorted(tops)
        boxes.append((heading[0], heading[1], questions[0][2], questions[-1][3]))
    for one in boxes:
        for other in boxes:
            is_apart = one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
            assert one is other or is_apart
    lefts = {box[0] for box in boxes}
    assert len(lefts) == {1200: 3, 718: 2, 400: 1}[width]


def test_links_lead_to_the_reports_beside_the_page(tmp_path: Path, browser: Browser) -> None:
    (tmp_path / "diagnosis").mkdir()
    (tmp_path / "diagnosis" / "report.html").write_text("<p>the diagnosis</p>")
    page = write_page(
        Page(
            "title",
            "verdict " * 20,
            [],
            warnings=["Warning: look."],
            links=[Link("Diagnosis", "diagnosis/report.html")],
        ),
        tmp_path,
    )
    check_report(browser, page, 0)
    found, _ = browser.press(page, [], ["document.querySelector('.links a').href"])
    assert found == [(tmp_path / "diagnosis" / "report.html").resolve().as_uri()]
    text = page.read_text(encoding="utf-8")
    assert text.index('class="warnings"') < text.index('class="links"')


def test_report_is_reached_by_keyboard(page: Path, browser: Browser) -> None:
    """Tables that scroll, folded parts, the plot and its buttons come in the order of the page; Enter opens a part."""
    active = "document.activeElement"
    asked = [f"{active}.tagName", f"{active}.getAttribute('aria-label') || {active}.innerText.trim()"]
    *found, complaints = browser.press(page, ["Tab"] * 9, asked)
    tags = [tag for tag, _ in found[1:]]
    assert tags == ["DIV", "SUMMARY", *["BUTTON"] * 5, "DIV", "SUMMARY"]
    assert [name for _, name in found[2:8]] == [
        "A table that is folded", "zoom in", "zoom out", "earlier", "later", "show the whole"
    ]  # fmt: skip
    opened = "[...document.querySelectorAll('details')].map(d => d.open)"
    *states, complaints = browser.press(page, ["Tab", "Tab", "Enter"], [opened])
    assert states[0] == [[False, False]] and states[-1] == [[True, False]]
    assert complaints == ()


def test_plot_zooms_by_keys_and_shows_the_whole_again(page: Path, browser: Browser) -> None:
    reach = ["+document.querySelector('.plot').dataset.from", "+document.querySelector('.plot').dataset.to"]
    keys = ["Tab"] * 8 + ["+", "ArrowRight", "-", "0"]
    *found, complaints = browser.press(page, keys, reach)
    whole, nearer, later, wider, again = (np.array(entry) for entry in found[8:])
    assert whole == pytest.approx([0.0, 9.99], abs=1e-3)
    assert nearer == pytest.approx([2.4975, 7.4925], abs=1e-3)
    assert later == pytest.approx(nearer + 0.25 * np.ptp(nearer), abs=1e-3)
    assert wider == pytest.approx([0.0, 9.99], abs=1e-3)
    assert again == pytest.approx(whole)
    assert complaints == ()


def test_plot_draws_every_line_in_its_colour_and_a_picture_stands_for_it_on_paper(page: Path, browser: Browser) -> None:
    pixels = """[...document.querySelectorAll('.plot canvas')].map(c => {
      const data = c.getContext('2d').getImageData(0, 0, c.width, c.height).data, seen = {};
      for (let i = 0; i < data.length; i += 4) seen[data.slice(i, i + 3).join()] = 1;
      return Object.keys(seen); })"""
    colours = browser.press(page, [], [pixels])[0][0]
    assert len(colours) == 2
    for number, name in ((0, "measured"), (0, "estimate"), (1, "ink")):
        text = light(name)
        wanted = ",".join(str(int(text[place : place + 2], 16)) for place in (1, 3, 5))
        assert wanted in colours[number], name
    shows = "[...document.querySelectorAll('.live, .still')].map(e => [e.className, e.getClientRects().length > 0])"
    assert browser.press(page, [], [shows])[0][0] == [["live", True], ["still", False]]
    assert browser.press(page, [], [shows], media="print")[0][0] == [["live", False], ["still", True]]


def test_every_scroll_box_can_be_reached(page: Path, browser: Browser) -> None:
    wide = "[...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth + 1)"
    found = browser.press(page, [], [f"{wide}.map(e => e.tabIndex)"], width=400)[0][0]
    assert found == [0]


def test_report_of_the_emps_example(tmp_path: Path, browser: Browser) -> None:
    """Its page with made-up records in the place of the real ones."""
    emps = load_script("examples/emps.py")
    phase = 0.005 * np.arange(4000)
    effort = 20.0 * np.tanh(20.0 * np.cos(phase)) - 95.0 * 25.0 * 0.05 * np.sin(phase)
    stamps = 10**9 + 1_000_000 * np.arange(phase.size)
    nothing = np.full(phase.size, math.nan)
    samples = Samples(stamps, 0.05 * np.sin(phase), effort, nothing, nothing)
    settings = load_settings(ROOT / "config" / "emps.yaml")
    estimates = AxisObserver(settings.axes[0], settings.sample_period).step(samples)
    observed = [emps.Observed(name, samples, estimates) for name in ("train", HOSTILE)]
    written = tmp_path / "report.html"
    written.write_text(emps.report([item.sentence for item in observed], observed), encoding="utf-8")
    check_report(browser, written, 0)
    plots = "[...document.querySelectorAll('.plot')].map(p => p.querySelectorAll('canvas').length)"
    assert browser.press(written, [], [plots])[0][0] == [2, 2]
