"""What every page of ours must look like, on a telephone, on a desk, and on paper."""

from __future__ import annotations

from pathlib import Path

from browser import Browser, View

TELEPHONE, DESK, PAPER = 400, 1200, 718  # px; A4 without its margins is 718 wide
SMALLEST_TEXT = 11.0  # px


SIGHTS = ((TELEPHONE, ""), (DESK, ""), (PAPER, "print"))


def check(browser: Browser, page: Path) -> View:
    """Assert that a page has no fault a reader would meet.

    Args:
        browser: a running browser.
        page: HTML file.

    Returns:
        What it looks like on a telephone.
    """
    views = browser.look(page, SIGHTS)
    for (width, media), view in zip(SIGHTS, views, strict=True):
        where = f"{page.name} at {width} px {media}"
        assert view.width <= width, where
        assert view.complaints == (), where
        assert view.text_length > 100, where
        assert view.page_width <= width, (where, view.culprits)
        assert view.smallest_text >= SMALLEST_TEXT, where
        for source, drawn, description in view.images:
            assert drawn > 0, (where, source)
            assert description, (where, source, "a picture needs a description for those who cannot see it")
    return views[0]


def check_report(browser: Browser, page: Path, pictures: int) -> View:
    """Assert that a report reads well, asks a network for nothing, shows pictures, and can be printed.

    Args:
        browser: a running browser.
        page: HTML file.
        pictures: at least so many.

    Returns:
        What it looks like on a telephone.
    """
    view = check(browser, page)
    assert len(view.images) >= pictures
    assert view.requests == (), "a report must be readable offline"
    assert browser.print(page).startswith(b"%PDF")
    return view
