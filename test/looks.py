"""What every page of ours must look like, on a telephone, on a desk, and on paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from browser import Browser, View

TELEPHONE, DESK, PAPER = 400, 1200, 718  # px; A4 without its margins is 718 wide
SMALLEST_TEXT, SMALLEST_LABEL = 11.0, 9.0  # px
LEAST_CONTRAST = 4.5  # WCAG 2.1, level AA
LARGEST_PAGE = 4_000_000  # bytes

LIGHT = ((TELEPHONE, "", "light"), (DESK, "", "light"), (PAPER, "print", "light"))
DARK = ((TELEPHONE, "", "dark"), (DESK, "", "dark"), (PAPER, "print", "dark"))


def check(browser: Browser, page: Path) -> View:
    """Assert that a page has no fault a reader would meet.

    Args:
        browser: a running browser.
        page: HTML file.

    Returns:
        What it looks like on a telephone.
    """
    return _checked(page, LIGHT, browser.look(page, LIGHT))[0]


def _checked(page: Path, sights: Sequence[tuple[int, str, str]], views: Sequence[View]) -> Sequence[View]:
    """Assert that no view of a page has a fault, and return the views."""
    for (width, media, scheme), view in zip(sights, views, strict=True):
        where = f"{page.name} at {width} px {media} {scheme}"
        assert view.width <= width, where
        assert view.complaints == (), where
        assert view.text_length > 100, where
        assert view.page_width <= width, (where, view.culprits)
        assert view.smallest_text >= SMALLEST_TEXT, where
        for source, drawn, description in view.images:
            assert drawn > 0, (where, source)
            assert description, (where, source, "a picture needs a description for those who cannot see it")
    return views


def check_report(browser: Browser, page: Path, pictures: int) -> View:
    """Assert that a report reads well, light, dark and printed, asks a network for nothing, and shows pictures.

    Args:
        browser: a running browser.
        page: HTML file.
        pictures: at least so many.

    Returns:
        What it looks like on a telephone.
    """
    assert page.stat().st_size < LARGEST_PAGE
    sights = (*LIGHT, *DARK)
    views = _checked(page, sights, browser.look(page, sights))
    for (width, media, scheme), view in zip(sights, views, strict=True):
        where = f"{page.name} at {width} px {media} {scheme}"
        assert (view.background < 0.1) == (scheme == "dark" and media != "print"), where
        assert view.contrast >= LEAST_CONTRAST, where
        assert view.smallest_label >= SMALLEST_LABEL, where
    view = views[0]
    assert len(view.images) >= pictures
    assert view.requests == (), "a report must be readable offline"
    assert browser.print(page).startswith(b"%PDF")
    return view
