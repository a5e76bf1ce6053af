"""A ROS_DOMAIN_ID that no other run on this machine uses: held by a lock until the process ends."""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path
from typing import IO

FIRST, LAST = 1, 100  # 0 is everybody's, and 101 is the last that leaves the ephemeral ports alone

_held: list[IO[str]] = []  # closing a file would free its domain


def claim_domain() -> int:
    """Return a domain of this process's own, from ``FIRST`` to ``LAST``.

    The children of this process keep to it by inheriting ROS_DOMAIN_ID. Where no lock can be had, a number made from
    the process's own is the next best.
    """
    count = LAST - FIRST + 1
    for i in range(count):
        domain = FIRST + (os.getpid() + i) % count
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
    return FIRST + os.getpid() % count
