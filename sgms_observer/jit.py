"""The one door to numba: compiled kernels where numba is installed, the same Python code where it is not.

Kernels are cached on disk under a key made of every compiled source file, so that a changed formula can
never be served from a stale cache (numba itself only watches the file a kernel is written in).
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_PACKAGES = ("sgms_observer", "sim_plant")
_KEPT_CACHES = 6


def _compiled_sources() -> list[Path]:
    """Return every file whose code can end up inside a compiled kernel, in a fixed order."""
    root = Path(__file__).resolve().parent.parent
    files = [path for name in _PACKAGES for path in sorted((root / name).rglob("*.py"))]
    return [path for path in files if path.parent.name == "formulas" or "njit" in path.read_text(encoding="utf-8")]


def _cache_directory() -> Path:
    """Return the folder for this version of the kernels, and forget all but the newest few others."""
    digest = hashlib.sha256()
    for path in _compiled_sources():
        digest.update(path.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "sgms_observer"
    folder = home / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        stale = sorted(home.iterdir(), key=lambda entry: entry.stat().st_mtime)[:-_KEPT_CACHES]
        for entry in stale:
            if entry != folder:
                shutil.rmtree(entry, ignore_errors=True)
    except OSError:
        pass
    return folder


def is_cache_warm() -> bool:
    """Return whether compiled kernels of exactly this version are already on disk."""
    return HAS_NUMBA and any(CACHE_DIRECTORY.rglob("*.nbi"))


try:
    import numba

    HAS_NUMBA = not os.environ.get("SGMS_OBSERVER_NO_NUMBA")
    CACHE_DIRECTORY = _cache_directory()
    if HAS_NUMBA and "NUMBA_CACHE_DIR" not in os.environ:
        numba.config.CACHE_DIR = str(CACHE_DIRECTORY)  # type: ignore[attr-defined]
except ImportError:
    HAS_NUMBA = False
    CACHE_DIRECTORY = Path()


def njit(function: Kernel) -> Kernel:
    """Compile ``function`` with numba (no fast-math: same bits everywhere), or return it as it is."""
    if not HAS_NUMBA:
        return function
    compiled: Kernel = numba.njit(function, cache=True, error_model="numpy", nogil=True)
    return compiled


def njit_bare(function: Kernel) -> Kernel:
    """Compile ``function`` without reference counting: it may be handed many arrays for nothing, but must not make one.

    Counting references to the fifty arrays of an estimator's memory costs ten times what a prediction does. Only
    kernels may call the result with arrays, or Python where it neither allocates nor returns any.
    """
    if not HAS_NUMBA:
        return function
    compiled: Kernel = numba.njit(function, cache=True, error_model="numpy", nogil=True, _nrt=False)
    return compiled


def inlined(function: Kernel) -> Kernel:
    """Leave ``function`` plain Python for Python, and let ``njit_bare`` kernels compile it into themselves."""
    if not HAS_NUMBA:
        return function
    from numba.extending import register_jitable

    registered: Kernel = register_jitable(_nrt=False)(function)
    return registered


def njit_uncached(function: Kernel) -> Kernel:
    """Compile a user's ``function``, which lives in no source file of this package, without a disk cache."""
    if not HAS_NUMBA:
        return function
    compiled: Kernel = numba.njit(function, error_model="numpy", nogil=True)
    return compiled

