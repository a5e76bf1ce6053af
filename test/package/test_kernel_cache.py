"""The disk cache of compiled kernels, for kernels of scripts that lie outside the package."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from program import ROOT

from sgms_observer.jit import HAS_NUMBA

pytestmark = pytest.mark.skipif(not HAS_NUMBA, reason="without numba there is no cache")

SCRIPT = """
import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.jit import _sources, njit


@njit
def twice(value: float) -> float:
    return value + np.exp(np.log(value))


print(round(twice(21.0), 9), *(path.name for path in _sources(__name__)))
"""
IMPORTED = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("imported_script", sys.argv[1])
module = sys.modules["imported_script"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
"""


def test_a_script_loads_its_kernels_after_it_was_imported_under_another_name(tmp_path: Path) -> None:
    """A kernel that was cached under the other name asks for a module that is not there."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    environment.pop("NUMBA_CACHE_DIR", None)
    for command in (["-c", IMPORTED, str(script)], [str(script)], [str(script)]):
        done = subprocess.run([sys.executable, *command], env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        value, *sources = done.stdout.split()
        assert value == "42.0"
        assert {"script.py", "arrays.py", "jit.py"} <= set(sources)  # a change of any of them compiles anew
    assert list((tmp_path / "cache").rglob("*.nbi"))
