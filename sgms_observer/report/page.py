"""A report as one self-contained HTML page: sections of text, tables and pictures, everything escaped."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgms_observer import __version__
from sgms_observer.whole_file import write_bytes


@dataclass(frozen=True)
class Picture:
    """A drawing.

    Args:
        name: short name, also of the PNG beside the page.
        caption: what it shows, in one sentence.
        png: the file's bytes.
    """

    name: str
    caption: str
    png: bytes

    @property
    def data(self) -> str:
        """Return the bytes as the page carries them."""
        return base64.b64encode(self.png).decode("ascii")


@dataclass(frozen=True)
class Table:
    """Rows of words and numbers.

    Args:
        header: titles of the columns.
        rows: one sequence per row, as long as the header.
        caption: what it shows, in one sentence.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Args:
        title: its heading.
        text: paragraphs.
        tables: shown after the text.
        pictures: shown after the tables.
    """

    title: str
    text: Sequence[str] = ()
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = field(default_factory=tuple)


def render_page(title: str, verdict: str, sections: Sequence[Section], provenance: str = "") -> str:
    """Return the page.

    Args:
        title: heading of the page.
        verdict: the result in one sentence.
        sections: its parts.
        provenance: where the numbers come from, in the footer.
    """
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(
        title=title, verdict=verdict, sections=sections, provenance=provenance, version=__version__
    )


def write_page(folder: Path, title: str, verdict: str, sections: Sequence[Section], provenance: str = "") -> Path:
    """Write ``report.html`` and its pictures as PNG files, each whole or not at all.

    Args:
        folder: where to; made if it is missing.
        title: heading of the page.
        verdict: the result in one sentence.
        sections: its parts.
        provenance: where the numbers come from, in the footer.

    Returns:
        Path of the page.

    Raises:
        RecordingError: the folder cannot be written.
    """
    page = folder / "report.html"
    for section in sections:
        for picture in section.pictures:
            write_bytes(picture.png, folder / f"{re.sub(r'[^A-Za-z0-9_.-]', '_', picture.name)}.png")
    write_bytes(render_page(title, verdict, sections, provenance).encode(), page)
    return page
