"""What every page of ours must look like, on a telephone, on a desk, and on paper."""

from __future__ import annotations

from pathlib import Path

from browser import Browser

TELEPHONE, DESK, PAPER = 400, 1200, 718  # px; A4 without its margins is 718 wide
SMALLEST_TEXT = 11.0  # px


def check(browser: Browser, page: Path) -> None:
    """Assert that a page has no fault a reader would meet.

    Args:
        browser: a running browser.
        page: HTML file.
    """
    for width, media in ((TELEPHONE, ""), (DESK, ""), (PAPER, "print")):
        view = browser.look(page, width, media)
        where = f"{page.name} at {width} px {media}"
        assert view.complaints == (), where
        assert view.text_length > 100, where
        assert view.page_width <= width, (where, view.culprits)
        assert view.smallest_text >= SMALLEST_TEXT, where
        for source, drawn, description in view.images:
            assert drawn > 0, (where, source)
            assert description, (where, source, "a picture needs a description for those who cannot see it")
