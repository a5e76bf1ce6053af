"""Use of freed memory again, which the C library returns to the system by default."""

from __future__ import annotations

import ctypes
from contextlib import suppress

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of glibc's mallopt
_KEPT = 64 * 2**20
"""Freed memory at the end of a heap above which it is returned [bytes]: more than the columns of one fit take."""
_LARGEST = 32 * 2**20
"""Largest array from a heap [bytes], glibc's own limit; a larger one has pages of its own."""


def keep_freed_memory() -> None:
    """Let this process use freed memory again instead of returning it to the system.

    A fit allocates and frees the same megabytes thousands of times. The system clears each page that it hands out
    again, which took a third of the time of a column on a virtual machine. Without glibc nothing happens.
    """
    with suppress(OSError, AttributeError, TypeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_TRIM_THRESHOLD, _KEPT)
        mallopt(_MMAP_THRESHOLD, _LARGEST)
