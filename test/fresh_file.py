"""Writes a file again and again without the disk: one that is cut to nothing and written anew is put on it at once."""

from __future__ import annotations

from pathlib import Path


def write_fresh(path: Path, data: bytes | bytearray) -> None:
    """Write a file in the place of one of the same name.

    Args:
        path: the file, which may exist.
        data: its content.
    """
    path.unlink(missing_ok=True)
    path.write_bytes(data)
