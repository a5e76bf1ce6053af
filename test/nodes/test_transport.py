"""What a killed process leaves in shared memory does not keep the next one from starting."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from sgms_observer.nodes.transport import remove_half_made_ports

MADE, BEING_MADE = b"\x02\x00\x00\x00" + bytes(60), b"\x01\x00\x00\x00" + bytes(60)
PORT = "fastrtps_port7412"


@pytest.mark.parametrize("content", [b"", b"\x00", BEING_MADE])
def test_an_old_half_made_port_is_removed(content: bytes, tmp_path: Path) -> None:
    names = (PORT, "fastrtps_port7411", f"{PORT}_el", "fastrtps_0123456789abcdef", "sem.fastrtps_port7412_mutex")
    for name in names:
        (tmp_path / name).write_bytes(MADE if name == "fastrtps_port7411" else content)
    os.utime(tmp_path / PORT, (0.0, time.time() - 60.0))
    remove_half_made_ports(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(names) - {PORT}


def test_a_port_that_is_being_made_is_waited_for(tmp_path: Path) -> None:
    port = tmp_path / PORT
    port.write_bytes(BEING_MADE)
    begun = time.monotonic()
    remove_half_made_ports(tmp_path)
    assert not port.exists() and time.monotonic() - begun > 4.0


def test_no_shared_memory_is_no_fault(tmp_path: Path) -> None:
    remove_half_made_ports(tmp_path / "missing")
