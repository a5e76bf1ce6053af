"""Kernels count as compiled only for the copy of the source that they were compiled from."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

ROOT = Path(__file__).resolve().parents[2]
MODULE = "sgms_observer.filters.kernel"
NOTE = f"from sgms_observer import jit; jit.note_complete('part', {MODULE!r})"
ASK = f"from sgms_observer import jit; print(jit.is_complete('part', {MODULE!r}))"


def run(code: str, folder: Path, cache: Path) -> str:
    """Run Python code with the package that lies in a folder, and return what it prints."""
    environment = os.environ | {"PYTHONPATH": str(folder), "XDG_CACHE_HOME": str(cache)}
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env=environment, check=True, capture_output=True, text=True
    ).stdout.strip()


def test_a_second_checkout_does_not_take_the_kernels_of_the_first_for_its_own(tmp_path: Path) -> None:
    first, second, cache = tmp_path / "first", tmp_path / "second", tmp_path / "cache"
    for folder in (first, second):
        shutil.copytree(ROOT / "sgms_observer", folder / "sgms_observer", ignore=shutil.ignore_patterns("__pycache__"))
    assert run(ASK, first, cache) == "False"
    run(NOTE, first, cache)
    assert run(ASK, first, cache) == "True"
    assert run(ASK, second, cache) == "False", "numba keeps the kernels of each copy apart"
    (first / "sgms_observer" / "filters" / "kernel.py").touch()
    assert run(ASK, first, cache) == "False", "older versions of numba look at the time of the file"
