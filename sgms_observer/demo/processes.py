"""Programs of this package in processes of their own: started, waited for, ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from sgms_observer.errors import SgmsError

_PATIENCE = 300.0  # s: a first start compiles its kernels
_ENDING = 30.0  # s
_LOOK_EVERY = 0.1  # s


class Program:
    """A running program whose output goes to a file.

    Args:
        name: for sentences and for the name of the file.
        module: module to run.
        arguments: its command line.
        folder: where its output goes.
    """

    def __init__(self, name: str, module: str, arguments: Sequence[str], folder: Path) -> None:
        self.name = name
        self.log = folder / f"{name}.log"
        with self.log.open("w", encoding="utf-8") as file:
            self._process = subprocess.Popen(
                [sys.executable, "-m", module, *arguments], stdout=file, stderr=subprocess.STDOUT, env=own_graph()
            )

    def wait_for(self, words: str) -> None:
        """Wait until the program has said ``words``.

        Args:
            words: part of its output.

        Raises:
            SgmsError: it ended, or did not say them in time.
        """
        end = time.monotonic() + _PATIENCE
        while words not in self.log.read_text(encoding="utf-8"):
            self.require_running()
            if time.monotonic() > end:
                raise SgmsError(f"{self.name} did not start within {_PATIENCE:g} s; read {self.log}")
            time.sleep(_LOOK_EVERY)

    def require_running(self) -> None:
        """Raise if the program has ended by itself.

        Raises:
            SgmsError: it has; with the last line it said.
        """
        if self._process.poll() is not None:
            said = self.log.read_text(encoding="utf-8").strip().splitlines()
            raise SgmsError(f"{self.name} ended by itself: {said[-1] if said else 'without a word'} ({self.log})")

    def stop(self) -> int:
        """End the program as Ctrl-C would and return its exit code."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            return self._process.wait(_ENDING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()


def own_graph() -> dict[str, str]:
    """Return this process's environment with a ROS graph of its own: no demonstration may move a real stage."""
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
