"""Whether a bag may be written where something is already, and how it takes its place."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from sgms_observer.bags.metadata import METADATA
from sgms_observer.errors import RecordingError

REPORT = "report.html"
"""The page about a bag, in its folder."""
_BAG_FILES = (".mcap", ".db3", ".zstd", ".db3-wal", ".db3-shm")


def refuse_existing_bag(path: str | Path, is_overwriting: bool) -> None:
    """Raise unless a bag may be written here.

    Args:
        path: the bag's folder.
        is_overwriting: a bag that is there may be replaced; anything else may not.

    Raises:
        RecordingError: something is there that must stay.
    """
    target = Path(path)
    if not target.exists() and not target.is_symlink():
        return
    if not is_overwriting:
        raise RecordingError(f"{target} exists already and is not overwritten; give another name, or --overwrite")
    if not _is_bag(target):
        raise RecordingError(f"{target} is no bag and is not overwritten; give another name, or remove it yourself")


def refuse_own_recording(out: str | Path, bags: Sequence[str | Path]) -> None:
    """Raise if results would go into the folder of a recording that they are made from.

    Args:
        out: folder of the results.
        bags: folders or files of the recordings.

    Raises:
        RecordingError: it is the folder of one of them, whatever may be overwritten.
    """
    target = Path(out).resolve()
    for bag in bags:
        source = Path(bag).resolve()
        if target in (source, source.parent if source.is_file() else source):
            raise RecordingError(f"--out {out} is the recording {bag} itself, which stays as it is; give another name")


def take_place(new: Path, path: Path) -> None:
    """Give a finished bag its name; a bag of that name is removed once the new one stands there.

    Args:
        new: the finished folder.
        path: its name.

    Raises:
        OSError: the operating system refuses.
    """
    if not path.exists():
        new.rename(path)
        return
    old = path.with_name(path.name + ".replaced")
    shutil.rmtree(old, ignore_errors=True)
    path.rename(old)
    new.rename(path)
    shutil.rmtree(old, ignore_errors=True)


def _is_bag(path: Path) -> bool:
    """Return whether a folder holds files of a bag, a report of ours about it, and nothing else."""
    if path.is_symlink() or not path.is_dir():
        return False
    names = [entry.name for entry in path.iterdir()]
    return bool(names) and all(name in (METADATA, REPORT) or name.endswith(_BAG_FILES) for name in names)
