"""Runs a module that does not outlive the process that started it, even if that one is killed.

``python -m sgms_observer.nodes.beside PID MODULE ARGUMENT ...``, where PID started it.
"""

from __future__ import annotations

import ctypes
import os
import runpy
import signal
import sys

_SIGNAL_AT_PARENTS_DEATH = 1  # PR_SET_PDEATHSIG of Linux


def main() -> None:
    """Ask for SIGINT at the parent's death, as the parent itself would send it, and become the module."""
    parent, module = int(sys.argv[1]), sys.argv[2]
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SIGNAL_AT_PARENTS_DEATH, int(signal.SIGINT), 0, 0, 0)
        if os.getppid() != parent:
            sys.exit(1)  # gone already: nobody is left to tell
    sys.argv[:3] = [module]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
