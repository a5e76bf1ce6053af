"""The queues between processes, made long enough before ROS starts."""

from __future__ import annotations

import os
from pathlib import Path

from sgms_observer.errors import DataError
from sgms_observer.shipped import shipped_file

_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
_BESIDE = "DEFAULT_FASTRTPS_PROFILES.xml"  # Fast DDS takes this from the current folder


def use_shipped_transport() -> None:
    """Have Fast DDS read ``config/fastdds.xml``, unless the user chose a file; other middleware never looks at it.

    Must run before ``rclpy.init``.
    """
    if _VARIABLE in os.environ or Path(_BESIDE).exists():
        return
    try:
        os.environ[_VARIABLE] = str(shipped_file("config", "fastdds.xml"))
    except DataError:
        return
