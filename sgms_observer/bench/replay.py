"""Throughput and memory of ``sgms replay``, and the start-up of an observer."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from sgms_observer.bench.process import TELL_PEAK, Usage, run_python, write_config

_SGMS = ("-c", f"import sys; from sgms_observer.__main__ import main; code = main(); {TELL_PEAK}; sys.exit(code)")
_FIRST_ESTIMATE = """
import sys
from sgms_observer.nodes.engine import Engine
from sgms_observer.settings.load import load_settings
engine = Engine(load_settings(sys.argv[1]))
engine.warm_up()
"""


def time_replay(folder: Path, seconds: float) -> dict[str, Any]:
    """Replay a simulated recording of one axis at 10 kHz with the EKF and the MHE, and a third of it for the memory.

    Args:
        folder: for bags and parameter files.
        seconds: length of the recording [s].

    Returns:
        Entries ``seconds`` and, per estimator, ``loop_s`` (as the command says), ``process_s``, ``cpu_s``,
        ``peak_mb`` and ``peak_mb_of_a_third``.
    """
    config = write_config(folder, "mhe")
    bags = {"": seconds, "third": seconds / 3.0}
    for name, duration in bags.items():
        bag = str(folder / f"recorded{name}")
        run_python([*_SGMS, "simulate", "--config", str(config), "--out", bag, "--duration", str(duration)])
    result: dict[str, Any] = {"seconds": seconds}
    for kind in ("ekf", "mhe"):
        config = write_config(folder, kind)
        usages = []
        for run, name in enumerate(["third", "third", ""]):  # the first may have to compile
            out = str(folder / f"replayed_{kind}_{run}")
            os.sync()  # what was written before must not be paid for here
            arguments = [str(folder / f"recorded{name}"), "--config", str(config), "--out", out, "--no-report"]
            usages.append(run_python([*_SGMS, "replay", *arguments]))
        found = re.search(r"messages in ([\d.]+) s", usages[-1].output)
        result[kind] = {
            "loop_s": float(found.group(1)) if found else None,
            "process_s": round(usages[-1].wall, 2),
            "cpu_s": round(usages[-1].cpu, 2),
            "peak_mb": _rounded(usages[-1].peak_mb),
            "peak_mb_of_a_third": _rounded(usages[-2].peak_mb),
        }
    return result


def time_start(folder: Path, cold: bool) -> dict[str, dict[str, float] | None]:
    """Time a process from its start until every kernel has run.

    Args:
        folder: for the parameter file and, cold, an empty cache.
        cold: also time a first-ever start, which compiles everything.

    Returns:
        ``warm`` and ``cold`` (None unless asked for), each with ``wall_s`` and ``cpu_s``.
    """
    arguments = ["-c", _FIRST_ESTIMATE, str(write_config(folder, "mhe"))]
    run_python(arguments)
    warm = _seconds(run_python(arguments))
    empty = {"XDG_CACHE_HOME": str(folder / "empty_cache")}
    return {"warm": warm, "cold": _seconds(run_python(arguments, empty)) if cold else None}


def _seconds(usage: Usage) -> dict[str, float]:
    return {"wall_s": round(usage.wall, 2), "cpu_s": round(usage.cpu, 2)}


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 1)
