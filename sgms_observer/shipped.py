"""Finds the files that are installed with the package."""

from __future__ import annotations

from pathlib import Path

from sgms_observer.errors import DataError


def shipped_file(folder: str, name: str) -> Path:
    """Return a file of ``config/`` or ``launch/``: beside the package in a source tree, else below ``share/``.

    Args:
        folder: ``config`` or ``launch``.
        name: the file's name.

    Raises:
        DataError: the installation lacks it.
    """
    package = Path(__file__).resolve().parent
    places = [package.parent / folder, *(above / "share" / package.name / folder for above in package.parents)]
    for place in places:
        if (place / name).is_file():
            return place / name
    raise DataError(f"{folder}/{name} is missing from this installation; install sgms_observer again")
