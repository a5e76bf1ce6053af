"""Prepares the transport between processes: long queues, nothing of killed processes, an unused ROS_DOMAIN_ID."""

from __future__ import annotations

import fcntl
import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from sgms_observer.errors import DataError
from sgms_observer.shipped import shipped_file

_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
_BESIDE = "DEFAULT_FASTRTPS_PROFILES.xml"  # Fast DDS reads this file from the current folder
_SHARED_MEMORY = Path("/dev/shm")
_PORTS = ("fastrtps_port*[0-9]", "fastdds_port*[0-9]")
_LOCKS = tuple(f"{name}_{'[0-9a-f]' * 16}_el" for name in ("fastrtps", "fastdds"))
_IS_MADE = b"\x02\x00\x00\x00"
_LONGEST_MAKING = 5.0
"""Age after which an incomplete port, or a segment whose lock nobody holds, belongs to a killed process [s]; making one
takes milliseconds."""

FIRST_DOMAIN, LAST_DOMAIN = 1, 100  # 0 is the default of all, and 101 is the last whose ports are not ephemeral

_held: list[IO[str]] = []  # open files keep their domains locked


def prepare_transport() -> None:
    """Remove what killed processes left, and let Fast DDS read ``config/fastdds.xml`` unless the user chose a file.

    Other middleware uses neither. Must run before ``rclpy.init``.
    """
    remove_half_made_ports()
    remove_left_segments()
    if _VARIABLE in os.environ or Path(_BESIDE).exists():
        return
    try:
        os.environ[_VARIABLE] = str(shipped_file("config", "fastdds.xml"))
    except DataError:
        return


def remove_half_made_ports(folder: Path = _SHARED_MEMORY) -> None:
    """Remove the shared-memory ports of Fast DDS that a killed process left incomplete.

    Boost.Interprocess writes a word at the beginning of a complete segment. A process that opens an incomplete one
    waits for that word without end. So one process that is killed in that moment keeps every later one on the computer
    from starting.

    Args:
        folder: folder of the segments.
    """
    half_made = [path for pattern in _PORTS for path in folder.glob(pattern) if not _is_made(path)]
    for path in half_made:
        with suppress(OSError):  # owned by another user, or removed already
            while not _is_made(path):
                if time.time() - path.stat().st_mtime > _LONGEST_MAKING:
                    path.unlink()
                    break
                time.sleep(0.05)


def remove_left_segments(folder: Path = _SHARED_MEMORY) -> None:
    """Remove the segments of shared memory that killed processes left, as ``fastdds shm clean`` does.

    A process of Fast DDS holds a lock on a file beside its segment. With ``config/fastdds.xml`` a segment takes 18 MB,
    so some killed nodes would fill the 64 MB that a container has by default.

    Args:
        folder: folder of the segments.
    """
    for lock in (path for pattern in _LOCKS for path in folder.glob(pattern)):
        with suppress(OSError), lock.open("rb") as file:  # held by a running process, or owned by another user
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if time.time() - lock.stat().st_mtime > _LONGEST_MAKING:
                lock.with_name(lock.name.removesuffix("_el")).unlink(missing_ok=True)
                lock.unlink()


def _is_made(path: Path) -> bool:
    """Return whether a segment is complete, or was removed."""
    try:
        with path.open("rb") as file:
            return file.read(len(_IS_MADE)) == _IS_MADE
    except OSError:  # removed, or not readable
        return True


def claim_domain() -> int:
    """Return an unused domain, from ``FIRST_DOMAIN`` to ``LAST_DOMAIN``.

    A lock reserves it until the process ends; child processes inherit ROS_DOMAIN_ID. Without a lock the domain follows
    from the number of the process.
    """
    count = LAST_DOMAIN - FIRST_DOMAIN + 1
    for i in range(count):
        domain = FIRST_DOMAIN + (os.getpid() + i) % count
        try:
            file = (Path(tempfile.gettempdir()) / f"sgms_observer_domain_{domain}.lock").open("a")
        except OSError:
            continue
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            file.close()
            continue
        _held.append(file)
        return domain
    return FIRST_DOMAIN + os.getpid() % count
