"""A report as one self-contained HTML page: verdict, warnings, answers, sections; everything escaped."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from sgms_observer import __version__
from sgms_observer.whole_file import write_bytes

COLOURS: dict[str, tuple[str, str]] = {
    "paper": ("#ffffff", "#12161c"),
    "ink": ("#1c2430", "#e4e8ee"),
    "soft": ("#5b6675", "#a3adba"),
    "line": ("#d9dee5", "#313945"),
    "panel": ("#f2f7fa", "#1a212a"),
    "accent": ("#0b6e98", "#58b7df"),
    "estimate": ("#d1495b", "#ff8593"),
    "measured": ("#0b6e99", "#58b7de"),
    "reference": ("#8a94a3", "#8f99a8"),
    "forward": ("#b35900", "#f2a65a"),
    "backward": ("#5a3fa0", "#b29cf0"),
    "good": ("#1b7a3d", "#5fca83"),
    "unsure": ("#9a6700", "#e6b450"),
    "bad": ("#b3261e", "#ff8a80"),
}
"""Every colour on a light page is a different one: a picture is drawn with it, and the page puts the name in its place.

Text and signs have a contrast of 4.5 to 1 at least against ``paper`` (WCAG 2.1); a test holds that.
"""


def light(name: str) -> str:
    """Return one of ``COLOURS`` as it is on a light page."""
    return COLOURS[name][0]


GOOD, UNSURE, BAD = "good", "unsure", "bad"
"""States of an answer, as green, amber and red lights show them."""
_FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Picture:
    """A drawing.

    Args:
        name: short name, also of the PNG beside the page.
        caption: what it shows, in one sentence.
        svg: the drawing as the page carries it: text is text, and colours are those of the page.
        draw_png: returns the same on white, for the file beside the page; most pages have no such files.
    """

    name: str
    caption: str
    svg: str
    draw_png: Callable[[], bytes]

    @cached_property
    def png(self) -> bytes:
        """Return the drawing as a PNG file."""
        return self.draw_png()


MAX_POINTS = 20_000
"""Points of a line in a plot over time."""
MAX_VALUES = 150_000
"""Numbers in all plots over time of a page, which share them: eight hundred kilobytes of the page."""


@dataclass(frozen=True)
class DrawnPlot:
    """A plot over time as the page carries it.

    Args:
        content: series and panels, as the page's script reads them.
        still: the whole of it as a picture, for paper and where no script runs.
    """

    content: Mapping[str, Any]
    still: Picture


@dataclass(frozen=True)
class Plot:
    """A plot over time that zooms.

    Args:
        name: short name, on this page the only one.
        caption: what it shows, in one sentence.
        signals: how many it holds, the time among them.
        draw: returns it with about so many points of each signal.
    """

    name: str
    caption: str
    signals: int
    draw: Callable[[int], DrawnPlot]


@dataclass(frozen=True)
class Table:
    """Rows of words and numbers.

    Args:
        header: titles of the columns.
        rows: one sequence per row, as long as the header.
        caption: what it shows, in one sentence.
        is_folded: whether the page shows the caption alone until a reader opens it.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    is_folded: bool = False


@dataclass(frozen=True)
class Light:
    """A question with its answer, shown as a traffic light.

    Args:
        topic: what it is about: data, convergence, believability.
        question: in plain words.
        state: ``GOOD``, ``UNSURE`` or ``BAD``.
        answer: one sentence or two, with the numbers that decide.
    """

    topic: str
    question: str
    state: str
    answer: str


@dataclass(frozen=True)
class Link:
    """A link to another report.

    Args:
        text: what it leads to.
        path: relative to the page's folder.
    """

    text: str
    path: str


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Args:
        title: its heading.
        text: paragraphs.
        tables: shown last.
        pictures: shown after the plots.
        plots: shown after the text.
        is_folded: whether the page shows the heading alone until a reader opens it.
    """

    title: str
    text: Sequence[str] = ()
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = field(default_factory=tuple)
    plots: Sequence[Plot] = ()
    is_folded: bool = False


@dataclass(frozen=True)
class Page:
    """Content of a report.

    Args:
        title: heading of the page.
        verdict: the result in one sentence.
        sections: its parts.
        provenance: where the numbers come from, in the footer.
        warnings: sentences that start with ``Warning:``; they stand above everything but the verdict.
        lights: questions with their answers; those of one topic stand together.
        lead: pictures that show the verdict; they stand above the questions.
        links: other reports of the same run; they stand below the warnings.
    """

    title: str
    verdict: str
    sections: Sequence[Section]
    provenance: str = ""
    warnings: Sequence[str] = ()
    lights: Sequence[Light] = ()
    lead: Sequence[Picture] = ()
    links: Sequence[Link] = ()

    long_topic: ClassVar[int] = 4
    """A topic with more questions gets a column twice as wide, and a row of its own where columns are narrow."""

    @cached_property
    def topics(self) -> dict[str, list[Light]]:
        """Return the questions of each topic; a topic has one column of the page."""
        topics: dict[str, list[Light]] = {}
        for one in self.lights:
            topics.setdefault(one.topic, []).append(one)
        return topics

    @property
    def light_columns(self) -> str:
        """Return the widths of the topics' columns on a desk, for the style sheet."""
        return " ".join("2fr" if len(lights) > self.long_topic else "1fr" for lights in self.topics.values())

    @cached_property
    def plots(self) -> list[Plot]:
        """Return the plots of all sections."""
        return [plot for section in self.sections for plot in section.plots]

    @cached_property
    def drawn_plots(self) -> dict[str, DrawnPlot]:
        """Return each plot by its name, with its share of the points of the page."""
        points = min(MAX_POINTS, MAX_VALUES // max(1, sum(plot.signals for plot in self.plots)))
        return {plot.name: plot.draw(points) for plot in self.plots}

    @property
    def pictures(self) -> list[Picture]:
        """Return every picture of the page."""
        listed = [picture for section in self.sections for picture in section.pictures]
        return [*self.lead, *listed, *(plot.still for plot in self.drawn_plots.values())]


def render_page(page: Page) -> str:
    """Return a page as HTML; it needs no other file and no network."""
    environment = Environment(
        loader=FileSystemLoader(_FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    scripts, styles = [], [_resource("page.css")]
    if page.plots:
        scripts = [_resource("uplot/uPlot.iife.min.js"), _resource("plot.js")]
        styles.insert(0, _resource("uplot/uPlot.min.css"))
    return environment.get_template("page.html").render(
        page=page,
        colours=COLOURS,
        styles=[Markup(style) for style in styles],
        scripts=[Markup(script) for script in scripts],
        hashes=[_hash(script) for script in scripts],
        drawn=_drawn,
        breakable=_breakable,
        words={GOOD: "Yes.", UNSURE: "Not sure.", BAD: "No."},
        signs={GOOD: "\N{CHECK MARK}", UNSURE: "?", BAD: "\N{MULTIPLICATION X}"},
        version=__version__,
    )


def write_page(page: Page, folder: Path) -> Path:
    """Write ``report.html`` and its pictures as PNG files, each whole or not at all.

    Args:
        page: what it says.
        folder: where to; made if it is missing.

    Returns:
        Path of the page.

    Raises:
        RecordingError: the folder cannot be written.
    """
    for picture in page.pictures:
        write_bytes(picture.png, folder / f"{re.sub(r'[^A-Za-z0-9_.-]', '_', picture.name)}.png")
    path = folder / "report.html"
    write_bytes(render_page(page).encode(), path)
    return path


def _resource(name: str) -> str:
    """Return a file of this package that goes into the page, without the last line's end."""
    return (_FOLDER / name).read_text(encoding="utf-8").strip()


def _hash(script: str) -> str:
    """Return what the page's policy names a script by: no other script may run, whatever a bag or a file says."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _drawn(picture: Picture) -> Markup:
    """Return a picture as the page carries it; matplotlib has escaped its text."""
    return Markup(picture.svg)


def _breakable(cell: str) -> Markup:
    """Return a cell of a table, escaped, in which a long name may go on in the next line behind ``_`` and ``.``."""
    return Markup(re.sub(r"(?<=[a-z][_.])(?=[a-z])", "<wbr>", str(escape(cell))))
