"""Errors a user meets: each carries whole sentences that say what is wrong, where, and what to do."""

from __future__ import annotations

from collections.abc import Sequence


def _one_line(sentence: str) -> str:
    """Return a sentence without the line breaks of what it quotes from the input."""
    return " ".join(line.strip() for line in sentence.splitlines())


class SgmsError(Exception):
    """Base of every error that is the input's fault; the command line prints it without a traceback."""


class ConfigurationError(SgmsError):
    """Settings that cannot work; carries one sentence per fault, all faults of the file at once.

    Args:
        sentences: one sentence per fault: parameter, value, rule, remedy.
    """

    def __init__(self, sentences: Sequence[str]) -> None:
        self.sentences = tuple(_one_line(sentence) for sentence in sentences)
        super().__init__("\n".join(self.sentences))


class RecordingError(SgmsError):
    """A bag, log or table that cannot be read or written; one sentence.

    Args:
        sentence: what is wrong; what it quotes from the input may have any line breaks.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(_one_line(sentence))


class DataError(SgmsError):
    """Data that were read but cannot answer the question asked of them; one sentence.

    Args:
        sentence: what is wrong; what it quotes from the input may have any line breaks.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(_one_line(sentence))
