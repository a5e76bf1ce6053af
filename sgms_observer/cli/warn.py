"""Print warnings: on stderr, so that neither ``--quiet`` nor ``--json`` hides them. Imports nothing heavy."""

from __future__ import annotations

import sys
from collections.abc import Iterable

PREFIX = "Warning: "


def warn(sentences: Iterable[str]) -> None:
    """Print each sentence on stderr after ``Warning:``.

    Args:
        sentences: with the prefix or without.
    """
    for sentence in sentences:
        print(f"{PREFIX}{sentence.removeprefix(PREFIX)}", file=sys.stderr, flush=True)


def say(sentence: str) -> None:
    """Print a sentence of a command that is still running: a warning as ``warn`` does, anything else on stdout.

    Args:
        sentence: a warning starts with the prefix.
    """
    if sentence.startswith(PREFIX):
        warn([sentence])
    else:
        print(sentence, flush=True)
