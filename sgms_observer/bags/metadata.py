"""metadata.yaml of a rosbag2 folder: written as version 9, read from version 1 on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import yaml

from sgms_observer.bags.message_types import OFFERED_QOS, MessageType
from sgms_observer.errors import RecordingError

METADATA = "metadata.yaml"
STORAGES = {"mcap": ".mcap", "sqlite3": ".db3"}


class _Plain(yaml.SafeDumper):  # type: ignore[misc]
    """Writes every value out: yaml-cpp reads anchors, but people do not."""

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
                f"{path} is no bag: it has neither a readable {METADATA} nor an .mcap or .db3 file"
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
