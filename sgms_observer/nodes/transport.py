"""The transport between processes, before ROS starts: queues long enough, nothing that a killed process left, and a
ROS_DOMAIN_ID that no other run on this machine uses."""

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
_BESIDE = "DEFAULT_FASTRTPS_PROFILES.xml"  # Fast DDS takes this from the current folder
_SHARED_MEMORY = Path("/dev/shm")
_PORTS = ("fastrtps_port*[0-9]", "fastdds_port*[0-9]")
_IS_MADE = b"\x02\x00\x00\x00"
_LONGEST_MAKING = 5.0
"""Time after which a port is not being made any more [s]; it takes milliseconds."""

FIRST_DOMAIN, LAST_DOMAIN = 1, 100  # 0 is everybody's, and 101 is the last that leaves the ephemeral ports alone

_held: list[IO[str]] = []  # closing a file would free its domain


def prepare_transport() -> None:
    """Clear half-made ports, and have Fast DDS read ``config/fastdds.xml`` unless the user chose a file.

    Other middleware never looks at either. Must run before ``rclpy.init``.
    """
    remove_half_made_ports()
    if _VARIABLE in os.environ or Path(_BESIDE).exists():
        return
    try:
        os.environ[_VARIABLE] = str(shipped_file("config", "fastdds.xml"))
    except DataError:
        return


def remove_half_made_ports(folder: Path = _SHARED_MEMORY) -> None:
    """Remove the shared-memory ports of Fast DDS that a killed process left half made.

    Boost.Interprocess writes a word at the beginning of a segment when all of it is made; whoever opens one without it
    waits for that word, for ever. One process killed in that moment keeps every later one on the machine from starting.

    Args:
        folder: where the segments are.
    """
    half_made = [path for pattern in _PORTS for path in folder.glob(pattern) if not _is_made(path)]
    for path in half_made:
        with suppress(OSError):  # somebody else's, or gone already
            while not _is_made(path):
                if time.time() - path.stat().st_mtime > _LONGEST_MAKING:
                    path.unlink()
                    break
                time.sleep(0.05)


def _is_made(path: Path) -> bool:
    """Return whether a segment is whole; one that is gone is."""
    try:
        with path.open("rb") as file:
            return file.read(len(_IS_MADE)) == _IS_MADE
    except OSError:  # gone, or not ours to read and to judge
        return True


def claim_domain() -> int:
    """Return a domain of this process's own, from ``FIRST_DOMAIN`` to ``LAST_DOMAIN``.

    A lock holds it until the process ends; its children keep to it by inheriting ROS_DOMAIN_ID. Where no lock can be
    had, a number made from the process's own is the next best.
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
