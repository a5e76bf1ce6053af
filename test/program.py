"""Starts the package's programs as processes, and waits until their first line is about to run; loads scripts.

A signal that comes earlier meets Python itself, which then ends with its own words: no matter for tests of ours.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 120.0
"""How long anything may take on a busy machine that compiles kernels first [s]."""

_CODE = """
import os, runpy, signal, sys
module, mark = sys.argv[1:3]
del sys.argv[1:3]
os.close(os.open(mark, os.O_CREAT))
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""


def start_program(module: str, arguments: Sequence[str], folder: Path, **pipes: Any) -> subprocess.Popen[str]:
    """Start a module as the main program and return once its Python has come up.

    Args:
        module: full name, as for ``python -m``.
        arguments: its command line.
        folder: where it runs.
        pipes: ``stdout`` and ``stderr`` as ``Popen`` takes them.
    """
    mark = folder / f".{module}.{time.monotonic_ns()}.started"
    process = subprocess.Popen(
        [sys.executable, "-c", _CODE, module, str(mark), *arguments],
        cwd=folder,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
        **pipes,
    )
    end = time.monotonic() + PATIENCE
    while not mark.exists():
        assert process.poll() is None, f"Python did not start: exit code {process.returncode}"
        assert time.monotonic() < end, f"waited {PATIENCE:g} s for Python to start"
        time.sleep(0.002)
    mark.unlink()
    return process


def load_script(name: str) -> ModuleType:
    """Return a script that lies in no package, such as ``benchmarks/filters.py``, as a module.

    Args:
        name: its path in the repository.
    """
    module_name = "script_" + Path(name).stem
    spec = importlib.util.spec_from_file_location(module_name, ROOT / name)
    assert spec is not None and spec.loader is not None
    module = sys.modules[module_name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def is_of_ours(errors: str) -> bool:
    """Return whether a traceback goes through a file of this package."""
    return "Traceback" in errors and f"{ROOT}{os.sep}sgms_observer{os.sep}" in errors
