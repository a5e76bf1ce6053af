"""The folder of a rosbag2 bag: its metadata.yaml, its files, compressed or not, and the rules for replacing it."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path, PurePath
from typing import Any

import yaml

from sgms_observer.bags.message_types import OFFERED_QOS, MessageType
from sgms_observer.errors import RecordingError

METADATA = "metadata.yaml"
STORAGES = {"mcap": ".mcap", "sqlite3": ".db3"}

REPORT = "report.html"
"""The page about a bag, in its folder."""
_BAG_FILES = (".mcap", ".db3", ".zstd", ".db3-wal", ".db3-shm")


class _Plain(yaml.SafeDumper):  # type: ignore[misc]
    """Writes repeated values in full: yaml-cpp reads anchors, but people do not."""

    def ignore_aliases(self, data: Any) -> bool:
        """Return that nothing is written as a reference."""
        return True


def dump_qos() -> str:
    """Return the offered QoS profiles as the YAML text that storages keep per topic."""
    return str(yaml.dump([OFFERED_QOS], Dumper=_Plain, sort_keys=False))


def dump_metadata(
    storage: str, file_name: str, start_ns: int, end_ns: int, topics: Mapping[str, tuple[MessageType, int]]
) -> str:
    """Return the text of metadata.yaml.

    Args:
        storage: ``mcap`` or ``sqlite3``.
        file_name: the one storage file in the folder.
        start_ns: time of the first message [ns].
        end_ns: time of the last message [ns].
        topics: name to type and number of messages.
    """
    count = sum(messages for _, messages in topics.values())
    start = {"nanoseconds_since_epoch": start_ns if count else 0}
    duration = {"nanoseconds": end_ns - start_ns if count else 0}
    information = {
        "version": 9,
        "storage_identifier": storage,
        "duration": duration,
        "starting_time": start,
        "message_count": count,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": name,
                    "type": kind.name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [OFFERED_QOS],
                    "type_description_hash": kind.digest,
                },
                "message_count": messages,
            }
            for name, (kind, messages) in topics.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [{"path": file_name, "starting_time": start, "duration": duration, "message_count": count}],
        "custom_data": None,
        "ros_distro": "jazzy",
    }
    tree = {"rosbag2_bagfile_information": information}
    return str(yaml.dump(tree, Dumper=_Plain, sort_keys=False, width=200))


@dataclass(frozen=True)
class BagFiles:
    """Which files hold a bag's messages.

    Attributes:
        files: in the order in which they were recorded.
        compression: ``""``, ``"file"`` or ``"message"``.
        warnings: sentences about what is missing.
    """

    files: tuple[Path, ...]
    compression: str = ""
    warnings: tuple[str, ...] = ()


def find_files(path: Path) -> BagFiles:
    """Find the storage files of a bag.

    Args:
        path: a bag's folder, with or without metadata.yaml, or one storage file.

    Raises:
        RecordingError: there is no such bag.
    """
    if not path.exists():
        partial = path.with_name(path.name + ".partial")
        remedy = f"; {partial} holds an interrupted recording, give that" if partial.exists() else "; check the path"
        raise RecordingError(f"{path} does not exist{remedy}")
    if path.is_file():
        if path.name == METADATA:
            return find_files(path.parent)
        if path.suffix not in STORAGES.values():
            raise RecordingError(f"{path} is no bag; give a rosbag2 folder, an .mcap or a .db3 file")
        return BagFiles((path,))
    try:
        found = sorted(entry for entry in path.iterdir() if entry.suffix in STORAGES.values())
        packed = sorted(entry for entry in path.iterdir() if entry.name.endswith((".mcap.zstd", ".db3.zstd")))
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}; check its permissions") from None
    try:
        information = _read(path / METADATA)
        names = [PurePath(str(name)).name for name in information["relative_file_paths"]]
        mode = str(information.get("compression_mode") or "").lower()
        compression = mode if mode in ("file", "message") else ""
    except (OSError, KeyError, TypeError, ValueError, yaml.YAMLError):
        if not found and not packed:
            raise RecordingError(
                f"{path} is no bag: it has neither a readable {METADATA} nor an .mcap or .db3 file; check the path"
            ) from None
        warning = (
            f"{path / METADATA} is missing or cannot be read; the storage files in the folder were read without it"
        )
        return BagFiles(tuple(found or packed), "" if found else "file", (warning,))
    listed = [path / name for name in names if (path / name).is_file()]
    missing = [name for name in names if not (path / name).is_file()]
    if not listed:
        raise RecordingError(
            f"{path} names no file that is there ({', '.join(missing) or 'none'}); copy the whole folder"
        )
    warnings = tuple(f"{path} lacks its file {name}; what was in it is not read" for name in missing)
    return BagFiles(tuple(listed), compression, warnings)


def _read(path: Path) -> dict[str, Any]:
    """Read the one mapping that metadata.yaml holds; yaml and key errors pass through."""
    tree = yaml.load(path.read_text(encoding="utf-8"), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    information = tree["rosbag2_bagfile_information"]
    if not isinstance(information, dict) or not isinstance(information["relative_file_paths"], list):
        raise ValueError("no list of files")
    return information


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
        RecordingError: it is the folder of one of them; --overwrite does not allow it either.
    """
    target = Path(out).resolve()
    for bag in bags:
        source = Path(bag).resolve()
        if target in (source, source.parent if source.is_file() else source):
            raise RecordingError(f"--out {out} is the recording {bag} itself, which stays as it is; give another name")


def refuse_bag_folder(out: str | Path) -> None:
    """Raise if results of another kind would go into the folder of a bag.

    Args:
        out: folder of the results.

    Raises:
        RecordingError: a bag is there; --overwrite does not allow it either.
    """
    if (Path(out) / METADATA).is_file():
        raise RecordingError(f"--out {out} is the folder of a bag, which stays as it is; give another name")


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


def _zstd() -> Any:
    """Return a module with the interface of Python 3.14's ``compression.zstd``."""
    for name in ("compression.zstd", "backports.zstd"):
        try:
            return import_module(name)
        except ImportError:
            continue
    raise RecordingError("the bag is compressed with zstd; run `pip install backports.zstd` to read it")


def unpack(data: bytes, compression: str, size: int) -> bytes:
    """Unpack what can be unpacked.

    Args:
        data: compressed bytes, possibly cut off.
        compression: ``""``, ``"lz4"`` or ``"zstd"``.
        size: the size that the unpacked bytes should have; never more than one byte more is returned.

    Returns:
        The unpacked bytes; fewer than ``size`` if the data are cut off or damaged.

    Raises:
        RecordingError: the compression is unknown, or its Python package is not installed.
    """
    if not compression:
        return data
    if compression == "zstd":
        decompressor = _zstd().ZstdDecompressor()
    elif compression == "lz4":
        try:
            decompressor = import_module("lz4.frame").LZ4FrameDecompressor()
        except ImportError:
            raise RecordingError("the bag is compressed with lz4; run `pip install lz4` to read it") from None
    else:
        raise RecordingError(f"the bag is compressed with {compression}; convert it to zstd, lz4 or no compression")
    pieces = []
    left = size + 1
    try:
        while left > 0:
            piece = decompressor.decompress(data, max_length=left)
            pieces.append(piece)
            left -= len(piece)
            data = b""
            if not piece or decompressor.eof:
                break
    except Exception:  # each package has errors of its own for damaged data; what came before them counts
        pass
    return b"".join(pieces)


def unpack_message(data: bytes) -> bytes:
    """Unpack one message of a bag in compression mode ``message``; empty if it is damaged.

    Args:
        data: the packed bytes.
    """
    try:
        unpacked: bytes = _zstd().decompress(data)
    except RecordingError:
        raise
    except Exception:  # the package's own error; the caller counts a message without content
        return b""
    return unpacked


def unpack_file(path: Path, folder: Path) -> Path:
    """Unpack a file ``NAME.mcap.zstd`` or ``NAME.db3.zstd`` into a folder, up to any damage.

    Args:
        path: the compressed file.
        folder: where to put ``NAME.mcap`` or ``NAME.db3``.

    Raises:
        RecordingError: it cannot be read, or there is no space for it.
    """
    unpacked = folder / path.stem
    zstd = _zstd()
    try:
        with path.open("rb") as packed, unpacked.open("wb") as target:
            try:
                with zstd.open(packed, "rb") as source:
                    shutil.copyfileobj(source, target, 2**20)
            except (EOFError, zstd.ZstdError):
                pass  # cut off: the reader of the unpacked file says how far it got
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be unpacked: {error.strerror or error}; check free space in {folder}"
        ) from None
    return unpacked
