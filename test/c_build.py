"""Exports an axis, builds it with a compiler and runs the shipped test vector."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import pytest

from sgms_observer.export.c_target import c_files
from sgms_observer.settings.axis import AxisSettings, Settings

REQUIRED = "SGMS_OBSERVER_REQUIRE_COMPILERS"
"""Environment variable with which a missing compiler is a failure: without it the tests that need one skip."""


def needs(*programs: str) -> pytest.MarkDecorator:
    """Return the mark that skips a test where a program is not installed, unless ``REQUIRED`` is set."""
    missing = [name for name in programs if shutil.which(name) is None]
    return pytest.mark.skipif(
        bool(missing) and not os.environ.get(REQUIRED), reason=f"{' and '.join(missing)} not installed"
    )


COMPILERS = [pytest.param(name, marks=needs(name)) for name in ("gcc", "clang")]
STRICT = "-O1 -g1 -Wall -Wextra -Werror"
SANITIZED = f"{STRICT} -fsanitize=address,undefined -fno-sanitize-recover=all"


def exported(folder: Path, axes: tuple[AxisSettings, ...], real: str = "double", sample_period: float = 1e-4) -> Path:
    """Write the C folder of some axes."""
    files, _warnings = c_files(Settings(axes=axes, sample_period=sample_period), axes, real)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def can_sanitize(compiler: str) -> bool:
    """Return whether a compiler has the libraries of its sanitizers; it must where ``REQUIRED`` is set."""
    return bool(os.environ.get(REQUIRED)) or _builds_sanitized(compiler)


@cache
def _builds_sanitized(compiler: str) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "sanitized.c"
        source.write_text("int main(void) { return 0; }\n", encoding="utf-8")
        flags = ["-fsanitize=address,undefined", "-o", str(source.with_suffix("")), str(source)]
        return subprocess.run([compiler, *flags], capture_output=True, check=False).returncode == 0


def run_vector(
    folder: Path, compiler: str = "gcc", flags: str = STRICT, *more: str
) -> subprocess.CompletedProcess[str]:
    """Build the folder and run its test."""
    command = ["make", "-s", "-B", "-C", str(folder), "test", f"CC={compiler}", f"CFLAGS={flags}", *more]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def assert_equal(folder: Path, compiler: str = "gcc", flags: str = STRICT, *more: str) -> str:
    """Build the folder, run its test, and return what it printed; every output must be equal to Python."""
    done = run_vector(folder, compiler, flags, *more)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "UNEQUAL" not in done.stdout
    assert done.stdout.rstrip().endswith("equal to Python")
    return done.stdout
