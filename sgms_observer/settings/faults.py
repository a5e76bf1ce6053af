"""The faults of a parameter file, gathered so that all of them are said at once."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable, Mapping
from typing import Any

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlevel = 3


class Faults:
    """Sentences in the order in which they were found, and the parameters that they are about."""

    def __init__(self) -> None:
        self.sentences: list[str] = []
        self._paths: set[str] = set()

    def add(self, path: str, sentence: str) -> None:
        """Note one fault.

        Args:
            path: the parameter's full name, ``x.friction.static_force``.
            sentence: parameter, value, rule, remedy.
        """
        self._paths.add(path)
        self.sentences.append(sentence)

    def has(self, *paths: str) -> bool:
        """Return whether any of these parameters is already known to be wrong."""
        return not self._paths.isdisjoint(paths)


def shown(value: Any) -> str:
    """Return a value as it would stand in the YAML, shortened if it is long."""
    if value is None:
        return "(nothing)"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, Mapping):
        return "(a group of settings)"
    if isinstance(value, (list, tuple)):
        inside = ", ".join("[...]" if isinstance(entry, (list, tuple)) else shown(entry) for entry in value[:6])
        return f"[{inside}{', ...' if len(value) > 6 else ''}]"
    try:
        return _SHORT.repr(value).replace("\n", " ")
    except ValueError:  # Python refuses to write out integers of thousands of digits
        return "(a number of thousands of digits)"


def alternatives(words: Iterable[str]) -> str:
    """Return ``a, b or c``."""
    listed = list(words)
    return listed[0] if len(listed) == 1 else f"{', '.join(listed[:-1])} or {listed[-1]}"


def closest(word: str, words: Iterable[str]) -> str | None:
    """Return the word that was most likely meant, or None."""
    known = {entry.lower(): entry for entry in words}
    found = difflib.get_close_matches(word[:80].lower(), known, n=1, cutoff=0.6)
    return known[found[0]] if found else None
