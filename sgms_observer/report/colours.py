"""Colours of a report: a name, the colour on a light page and on paper, and the colour on a dark page."""

from __future__ import annotations

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
    """Return a colour as it is on a light page.

    Args:
        name: one of ``COLOURS``.
    """
    return COLOURS[name][0]
