"""Compiles kernels in advance, in separate processes, into the cache from which other processes load them.

A process that compiles does not answer meanwhile, and keeps the compiler's memory and threads until it ends.
``python -m sgms_observer.application.kernels NAME`` is such a process: it compiles one part and prints a dot for each
function, from which its parent knows the progress.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer import jit
from sgms_observer.child_process import child_command, child_environment
from sgms_observer.settings.axis import Settings
from sgms_observer.settings.load import settings_from_tree

OF_OBSERVER = ("estimator", "filter", "stage", "observer")
OF_STAGE = ("stage",)

_SOONEST = 3.0  # s before the first estimate of the remaining time
_ALMOST = 0.95  # largest reported share of an unfinished part
_WATCH = 0.1  # s
_SAMPLES = 200  # samples of the run that calls every kernel of a part


@dataclass(frozen=True)
class Part:
    """Kernels that are compiled together.

    Attributes:
        module: full name of the module whose kernel calls all others of the part.
        weight: computing time, measured on one computer [s]; for the progress only.
        functions: number of compiled functions; for the progress only.
        after: parts whose kernels this one uses, so that they are compiled first and once.
    """

    module: str
    weight: float
    functions: int
    after: tuple[str, ...] = ()


#: Longest first.
PARTS = {
    "estimator": Part("sgms_observer.estimators.block", 12.3, 66),
    "stage": Part("sim_plant.kernel", 7.0, 94),
    "filter": Part("sgms_observer.filters.kernel", 4.8, 18),
    "observer": Part("sgms_observer.observer.axis_observer", 8.2, 107, ("estimator", "stage", "filter")),
}


def missing_parts(names: Sequence[str] = tuple(PARTS)) -> tuple[str, ...]:
    """Return those parts whose kernels, of exactly this version, are not in the cache."""
    if not jit.HAS_NUMBA:
        return ()
    return tuple(name for name in names if not jit.is_complete(name, PARTS[name].module))


class Compilation:
    """Compiles parts, as many at once as there are cores; call ``poll`` until it returns True.

    Args:
        names: parts, each with those that it uses.
    """

    def __init__(self, names: Sequence[str] = ()) -> None:
        self._waiting = [name for name in PARTS if name in names]
        self._all = tuple(self._waiting)
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._functions: dict[str, int] = {}
        self._finished: set[str] = set()
        self._start = time.monotonic()
        self.failure = ""

    def poll(self) -> bool:
        """Start the next parts, read the progress, and return whether all parts have ended."""
        for name, process in list(self._running.items()):
            output = process.stdout.read() if process.stdout is not None else None
            self._functions[name] = self._functions.get(name, 0) + (output or b"").count(b".")
            if process.poll() is not None:
                del self._running[name]
                self._end(name, process.returncode)
        for name in list(self._waiting):
            if len(self._running) < max(1, os.cpu_count() or 1) and not self._blockers(name):
                self._waiting.remove(name)
                self._running[name] = _started(name)
        return not self._running and not self._waiting

    def stop(self) -> None:
        """End every process that still compiles; the cache keeps the finished kernels."""
        self._waiting.clear()
        for process in self._running.values():
            process.kill()
        for process in self._running.values():
            process.wait()
        self._running.clear()

    @property
    def share(self) -> float:
        """Return the completed share, 0 to 1."""
        total = sum(PARTS[name].weight for name in self._all)
        done = sum(PARTS[name].weight * self._share_of(name) for name in self._all)
        return done / total if total > 0.0 else 1.0

    @property
    def seconds_left(self) -> float | None:
        """Return the remaining time at the pace so far [s]; None while it is unknown."""
        elapsed = time.monotonic() - self._start
        return elapsed * (1.0 - self.share) / self.share if elapsed > _SOONEST and self.share > 0.0 else None

    def _share_of(self, name: str) -> float:
        if name in self._finished:
            return 1.0
        return min(self._functions.get(name, 0) / PARTS[name].functions, _ALMOST)

    def _blockers(self, name: str) -> list[str]:
        return [other for other in PARTS[name].after if other in self._all and other not in self._finished]

    def _end(self, name: str, code: int) -> None:
        """Note the end of a part; a failed one is compiled by the process that needs it."""
        self._finished.add(name)
        if code == 0:
            jit.note_complete(name, PARTS[name].module)
        elif not self.failure:
            self.failure = (
                f"the kernels of {name} could not be compiled ahead (exit code {code});"
                f" run python -m sgms_observer.application.kernels {name} to see why"
            )


def compile_ahead(names: Sequence[str] = tuple(PARTS), show: Callable[[float], None] = lambda share: None) -> str:
    """Compile the kernels that are not in the cache, and wait for them.

    Args:
        names: parts that are needed.
        show: called with the completed share, 0 to 1.

    Returns:
        A sentence about kernels that could not be compiled or cached; empty without one.
    """
    missing = missing_parts(names)
    if missing and not jit.can_keep():
        return (
            f"{jit.cache_folder()} cannot be written, so no kernel can be cached; set XDG_CACHE_HOME to another folder"
        )
    compilation = Compilation(missing)
    try:
        while not compilation.poll():
            show(compilation.share)
            time.sleep(_WATCH)
    finally:
        compilation.stop()
    return compilation.failure


def _started(name: str) -> subprocess.Popen[bytes]:
    """Return the process that compiles a part; it ends with this one, and its output can be read without waiting."""
    process = subprocess.Popen(
        child_command("sgms_observer.application.kernels", [name]),
        stdin=subprocess.DEVNULL,
        bufsize=0,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=child_environment(),
    )
    if process.stdout is not None:
        os.set_blocking(process.stdout.fileno(), False)
    return process


def _settings() -> Settings:
    """Return one axis with an effect; kernels take sizes and choices as data, so these serve every configuration."""
    axis = {"mass": 10.0, "effects": {"names": ["offset"], "offset": {"force": 0.1}}}
    return settings_from_tree({"axes": ["x"], "x": axis})


def _estimator(settings: Settings) -> None:
    from sgms_observer.estimators.estimator import Estimator
    from sgms_observer.filters.motion import known_motion

    axis, zeros = settings.axes[0], np.zeros(_SAMPLES)
    motion = known_motion(np.full(_SAMPLES, settings.sample_period), zeros, zeros)
    Estimator(axis.estimator, axis.friction, axis.mass).step(motion, zeros, np.ones(_SAMPLES))


def _filter(settings: Settings) -> None:
    from sgms_observer.filters.differentiator import Differentiator

    stamps = np.arange(_SAMPLES, dtype=np.int64) * round(settings.sample_period * 1e9)
    differentiator = Differentiator(settings.axes[0].filter, settings.sample_period)
    differentiator.step(stamps, np.zeros(_SAMPLES), np.zeros(_SAMPLES))


def _stage(settings: Settings) -> None:
    from sim_plant.table import SimulatedTable

    SimulatedTable(settings).step(2)


def _observer(settings: Settings) -> None:
    from sgms_observer.bags.rows import warm_up_encoding
    from sgms_observer.observer.axis_observer import AxisObserver, run_all_kernels

    warm_up_encoding()
    run_all_kernels(AxisObserver(settings.axes[0], settings.sample_period))


_WORK: dict[str, Callable[[Settings], None]] = {
    "estimator": _estimator,
    "filter": _filter,
    "stage": _stage,
    "observer": _observer,
}


def main() -> int:
    """Compile the part that is named on the command line."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a compiler's callback may swallow an exception
    jit.tell_each_compilation(lambda: print(".", end="", flush=True))
    _WORK[sys.argv[1]](_settings())
    return 0


if __name__ == "__main__":
    sys.exit(main())
