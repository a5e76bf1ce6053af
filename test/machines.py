"""Where the logs of real machines are: ``SGMS_DATA``, or a folder ``shared/data`` beside a folder above this one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

_PLACES = [Path(os.environ["SGMS_DATA"])] if "SGMS_DATA" in os.environ else []
_PLACES += [folder / "shared" / "data" for folder in Path(__file__).resolve().parents]
MACHINES = next((place / "machines" for place in _PLACES if (place / "machines").is_dir()), None)

needs_machines = pytest.mark.skipif(MACHINES is None, reason="the logs of real machines (data/machines) are not here")


def machine_file(name: str) -> str:
    """Return the path of a machine's raw file.

    Args:
        name: relative to the folder of the machines.
    """
    assert MACHINES is not None
    return str(MACHINES / name)
