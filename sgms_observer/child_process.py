"""Runs modules of this package in processes that end with their parent, also if the parent is killed.

``python -m sgms_observer.child_process PID MODULE ARGUMENT ...`` becomes the module, where PID started it.
"""

from __future__ import annotations

import ctypes
import os
import runpy
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

_SIGNAL_AT_PARENTS_DEATH = 1  # PR_SET_PDEATHSIG of Linux


def child_command(module: str, arguments: Sequence[str] = ()) -> list[str]:
    """Return the command line of a module that ends with this process."""
    return [sys.executable, "-m", "sgms_observer.child_process", str(os.getpid()), module, *arguments]


def child_environment(more: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the environment for a child process, in which it imports this package, with more variables."""
    root = str(Path(__file__).resolve().parents[1])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), **(more or {})}


def main() -> None:
    """Ask for SIGINT at the parent's death, as the parent itself would send it, and become the module."""
    parent, module = int(sys.argv[1]), sys.argv[2]
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SIGNAL_AT_PARENTS_DEATH, int(signal.SIGINT), 0, 0, 0)
        if os.getppid() != parent:
            sys.exit(1)  # the parent has ended already
    sys.argv[:3] = [module]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
