"""Commands as processes of their own, with what they used, and the parameter files of their runs."""

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

_SHARED = """/**:
  ros__parameters:
    axes: [{names}]
    sample_period: {period:e}  # s
    publish_every: {publish_every}
"""
_AXIS = """    {name}:
      mass: 10.0                 # kg
      estimator: {{kind: {kind}, parameters: [kappa], correction_every: {every}}}
      compensation: {{enabled: true}}
      stage: {{reference: {{kind: sine, amplitude: 200.0e-6, frequency: 5.0}}}}
"""

RATE = 10_000
"""Samples per second of the scene, unless another rate is asked for [Hz]."""

_CORRECTION = 2.0e-3  # s from one correction to the next


@dataclass(frozen=True)
class Usage:
    """What a process used.

    Attributes:
        wall: from start to end [s].
        cpu: computing time of all its threads [s].
        peak_mb: largest memory [MB], if the process prints it (``TELL_PEAK``).
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
        last = (output.strip() or "it printed nothing").splitlines()[-1]
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


def axis_names(count: int) -> tuple[str, ...]:
    """Return the names of the axes: ``x``, or ``x1``, ``x2``, ... of several."""
    return ("x",) if count == 1 else tuple(f"x{number + 1}" for number in range(count))


def write_config(folder: Path, kind: str, publish_every: int = 1, rate: int = RATE, axes: int = 1) -> Path:
    """Write a parameter file: Table I, the default filter, the stiffness estimated, compensation on.

    Args:
        folder: where to.
        kind: of the estimator, ``ekf`` or ``mhe``.
        publish_every: samples from one published estimate to the next.
        rate: samples per second [Hz].
        axes: how many there are.

    Returns:
        The file.
    """
    path = folder / f"{kind}_{publish_every}_{rate}_{axes}.yaml"
    every = max(1, round(_CORRECTION * rate))
    names = axis_names(axes)
    text = _SHARED.format(names=", ".join(names), publish_every=publish_every, period=1.0 / rate)
    text += "".join(_AXIS.format(name=name, kind=kind, every=every) for name in names)
    path.write_text(text, encoding="utf-8")
    return path
