"""A command as a process of its own, with what it used."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sgms_observer.child_process import child_environment
from sgms_observer.errors import DataError

# What the parent sees of a child's peak contains the parent's own, so the child says it last.
TELL_PEAK = "print(*[line for line in open('/proc/self/status') if line.startswith('VmHWM')])"


@dataclass(frozen=True)
class Usage:
    """What a process used.

    Attributes:
        wall: from start to end [s].
        cpu: computing time of all its threads [s].
        peak_mb: largest memory [MB], if the process tells it (``TELL_PEAK``).
        output: what it printed.
    """

    wall: float
    cpu: float
    peak_mb: float | None
    output: str


def run_python(arguments: Sequence[str], environment: Mapping[str, str] | None = None) -> Usage:
    """Run this Python with arguments and wait for its end.

    Args:
        arguments: what follows ``python``.
        environment: variables to add.

    Raises:
        DataError: it failed; its last sentence.
    """
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=child_environment(environment),
        text=True,
    )
    output = process.stdout.read() if process.stdout is not None else ""
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        last = (output.strip() or "it said nothing").splitlines()[-1]
        raise DataError(f"python {' '.join(arguments[:3])} failed: {last}")
    peak = re.search(r"^VmHWM:\s*(\d+) kB", output, re.MULTILINE)
    return Usage(
        time.perf_counter() - start,
        used.ru_utime + used.ru_stime,
        int(peak.group(1)) / 1024.0 if peak else None,
        output,
    )


def seconds_used(process_id: int) -> float:
    """Return the computing time that a running process has used so far [s]."""
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
