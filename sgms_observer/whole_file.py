"""Writes files completely or not at all: a full disk or a signal leaves no incomplete file."""

from __future__ import annotations

import contextlib
import io
import itertools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sgms_observer.errors import RecordingError

_number = itertools.count()


def file_in_the_way(path: str | Path, error: Exception) -> RecordingError | None:
    """Return the sentence about a path where a file is instead of a folder, or None for another error."""
    if not isinstance(error, FileExistsError | NotADirectoryError):
        return None
    reason = "it is a file, or lies in one, where a folder must be"
    return RecordingError(f"{path} cannot be written: {reason}; give another name")


def _refused(path: str | Path, error: Exception) -> RecordingError:
    """Return the sentence about a path that the operating system refused."""
    if found := file_in_the_way(path, error):
        return found
    reason = getattr(error, "strerror", None) or "it is not a possible file name"
    remedy = (
        "choose a folder that you may write to"
        if isinstance(error, PermissionError)
        else "make room or choose another folder"
    )
    return RecordingError(f"{path} cannot be written: {reason}; {remedy}")


def write_bytes(content: bytes, path: str | Path) -> None:
    """Write a file under another name first, then rename it.

    Args:
        content: all of it.
        path: the file; its folder is made if need be.

    Raises:
        RecordingError: the file cannot be written; one sentence.
    """
    partial = None
    try:
        target = Path(path).resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = target.with_name(f".{target.name[:100]}.{os.getpid()}.{next(_number)}")
        with open(partial, "xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, target)
    except (OSError, ValueError) as error:
        if partial is not None:
            with contextlib.suppress(OSError, ValueError):
                partial.unlink(missing_ok=True)
        raise _refused(path, error) from None
    except BaseException:
        if partial is not None:
            partial.unlink(missing_ok=True)
        raise


def try_folder(folder: str | Path) -> None:
    """Check before long work that a folder can be made and written into; an empty folder is removed again.

    Raises:
        RecordingError: it cannot be made or refuses files; one sentence.
    """
    probe = Path(folder) / f".{os.getpid()}.{next(_number)}"
    try:
        is_new = not probe.parent.exists()
        probe.parent.mkdir(parents=True, exist_ok=True)
        probe.touch(exist_ok=False)
        probe.unlink()
        if is_new:
            with contextlib.suppress(OSError):  # another process uses it already
                probe.parent.rmdir()
    except (OSError, ValueError) as error:
        raise _refused(folder, error) from None


def refuse_existing_files(paths: Sequence[str | Path], is_overwriting: bool) -> None:
    """Raise if an output file exists already.

    Args:
        paths: the files.
        is_overwriting: they may be replaced.

    Raises:
        RecordingError: one of them is there and must stay, or is a folder; one sentence.
    """
    for path in paths:
        if is_overwriting and os.path.isdir(path):
            raise RecordingError(f"{path} is a folder where a file must be; give the name of a file")
        if not is_overwriting and os.path.lexists(path):
            raise RecordingError(f"{path} exists already and is not overwritten; give another name, or --overwrite")


def write_text(text: str, path: str | Path) -> None:
    """Write a text file in UTF-8, whole or not at all.

    Args:
        text: all of it.
        path: the file; its folder is made if need be.

    Raises:
        RecordingError: the file cannot be written; one sentence.
    """
    write_bytes(text.encode("utf-8"), path)


def write_figure(figure: Any, path: str | Path, dpi: int) -> None:
    """Write a figure of matplotlib as PNG, whole or not at all.

    Args:
        figure: the figure.
        path: the file; its folder is made if need be.
        dpi: pixels per inch.

    Raises:
        RecordingError: the file cannot be written; one sentence.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    write_bytes(buffer.getvalue(), path)
