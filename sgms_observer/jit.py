"""Access to numba: compiled kernels where numba is installed, the same Python code where it is not.

Kernels are cached on disk, each under a key of its module, of the package or a script, and of every module of the
package that it imports. So a changed formula is never loaded from an old cache (numba itself checks only the file of
the kernel).
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import os
import re
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_ROOT = Path(__file__).resolve().parent.parent
_KEPT_KEYS = 1024  # about thirty of each version of the source, 60 kB each
_KEY = re.compile(r"[0-9a-f]{16}")
_IMPORT = re.compile(
    r"^\s*(?:from|import)\s+((?:sgms_observer|sim_plant)[\w.]*)(?:\s+import\s+(\([^)]*\)|[^\n#]*))?", re.MULTILINE
)

# LLVM's third level takes a third longer to compile and makes no kernel of ours faster.
os.environ.setdefault("NUMBA_OPT", "2")

try:
    import numba

    HAS_NUMBA = not os.environ.get("SGMS_OBSERVER_NO_NUMBA")
except ImportError:
    HAS_NUMBA = False


call_inside: Callable[..., None] | None = None
if HAS_NUMBA:
    with suppress(ImportError, AttributeError):  # a numba whose inner parts lie elsewhere only compiles longer
        from sgms_observer.inner_kernels import call_inside


def _look_for_blas_later() -> None:
    """Avoid the import of scipy.linalg: numba imports it with the first kernel, to check whether it is installed.

    That takes 0.2 s, as much as all of numba. The first check returns without an import. A kernel that uses linear
    algebra (none of this package does) checks again and gets numba's original answer.
    """
    linalg = importlib.import_module("numba.np.linalg")
    original = getattr(linalg, "ensure_blas", None)
    if original is None or "numba.np.arraymath" in sys.modules or importlib.util.find_spec("scipy") is None:
        return

    def ensure_blas() -> None:
        linalg.ensure_blas = original  # type: ignore[attr-defined]

    linalg.ensure_blas = ensure_blas  # type: ignore[attr-defined]


if HAS_NUMBA:
    _look_for_blas_later()


def _cache_folder() -> Path:
    """Return the folder of the kernels: below XDG_CACHE_HOME where that is an absolute path, else below ~/.cache."""
    home = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (home if home.is_absolute() else Path.home() / ".cache") / "sgms_observer" / "kernels"


_CACHE = _cache_folder()


def _file_of(module: str) -> Path | None:
    """Return the source file of a module of this package or of a loaded script, or None for any other name."""
    base = _ROOT.joinpath(*module.split("."))
    for path in (base.with_suffix(".py"), base / "__init__.py"):
        if path.is_file():
            return path
    script = getattr(sys.modules.get(module), "__file__", None)
    return Path(script) if script and Path(script).is_file() else None


@cache
def _imports(module: str) -> frozenset[str]:
    """Return the modules of this package that a module imports."""
    path = _file_of(module)
    if path is None:
        return frozenset()
    names = set()
    for source, imported in _IMPORT.findall(path.read_text(encoding="utf-8")):
        names.add(source)
        names.update(f"{source}.{word}" for word in re.findall(r"\w+", imported))
    return frozenset(name for name in names if _file_of(name))


@cache
def _sources(module: str) -> tuple[Path, ...]:
    """Return the files of the module and of all its imports, in a fixed order."""
    visited: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in visited:
            visited.add(name)
            waiting.extend(_imports(name))
    return tuple(path for path in map(_file_of, sorted(visited)) if path is not None)


@cache
def _key_of(module: str) -> str:
    """Return a key that changes whenever the module, or one it imports, does.

    The key holds the name too, because a cached kernel belongs to the module that compiled it: a script is ``__main__``
    where it is run, and has another name where it is imported.
    """
    digest = hashlib.sha256(module.encode())
    for path in _sources(module):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _forget_old_keys() -> None:
    """Remove all but the newest cache folders, once per process."""
    try:
        keys = (entry for entry in _CACHE.iterdir() if _KEY.fullmatch(entry.name))
        folders = sorted(keys, key=lambda entry: entry.stat().st_mtime)
    except OSError:
        return
    for folder in folders[:-_KEPT_KEYS]:
        shutil.rmtree(folder, ignore_errors=True)


def cache_folder() -> Path:
    """Return the folder that kernels are kept in."""
    chosen = numba.config.CACHE_DIR if HAS_NUMBA else ""  # type: ignore[attr-defined]
    return Path(chosen) if chosen else _CACHE


def can_keep() -> bool:
    """Return whether kernels can be written into the cache."""
    folder = cache_folder()
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return os.access(folder, os.W_OK)


def _mark(name: str, module: str) -> Path:
    """Return the file that marks a part's kernels as cached, for this source, numba, Python and processor.

    numba separates the kernels of each copy of the source, and drops those of a file that was written again.
    """
    from llvmlite import binding

    written = [(str(path), path.stat().st_mtime_ns) for path in _sources(module)]
    made_by = f"{numba.__version__} {sys.version} {binding.get_host_cpu_name()} {os.environ['NUMBA_OPT']} {written}"  # type: ignore[attr-defined]
    return cache_folder() / _key_of(module) / f"{name}-{hashlib.sha256(made_by.encode()).hexdigest()[:16]}.complete"


def is_complete(name: str, module: str) -> bool:
    """Return whether all kernels of a part, of exactly this version, are on disk.

    Args:
        name: of the part.
        module: full name of the module whose kernel calls all others, for example ``"sgms_observer.estimators.block"``.
    """
    return HAS_NUMBA and _mark(name, module).exists()


def note_complete(name: str, module: str) -> None:
    """Note that all kernels of a part are on disk; arguments as ``is_complete``."""
    with suppress(OSError):
        _mark(name, module).parent.mkdir(parents=True, exist_ok=True)
        _mark(name, module).touch()


def tell_each_compilation(tell: Callable[[], None]) -> None:
    """Register a function that is called after each compiled kernel, in the thread that compiles."""
    if not HAS_NUMBA:
        return
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, happened: Any) -> None:
            """Ignore the start of a compilation."""

        def on_end(self, happened: Any) -> None:
            """Report the end of a compilation."""
            tell()

    event.register("numba:compile", Listener())


def _compile(function: Kernel, **options: Any) -> Kernel:
    """Compile with numba: no fast-math, hence the same bits everywhere; cached on disk under the module's key."""
    if not HAS_NUMBA:
        return function
    _forget_old_keys()
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    if not before:
        numba.config.CACHE_DIR = str(_CACHE / _key_of(function.__module__))  # type: ignore[attr-defined]
    try:
        compiled: Kernel = numba.njit(function, cache=True, error_model="numpy", nogil=True, **options)
    except RuntimeError:  # no folder to write to: compile at every start
        compiled = numba.njit(function, error_model="numpy", nogil=True, **options)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
    _do_without_room(compiled)
    if call_inside is not None:
        call_inside(compiled, function, error_model="numpy", nogil=True, **options)
    return compiled


def _do_without_room(compiled: Any) -> None:
    """Let a kernel work uncached where the disk is full; numba itself would raise an error."""
    kernel_cache = getattr(compiled, "_cache", None)
    save = getattr(kernel_cache, "save_overload", None)
    if kernel_cache is None or save is None:
        return

    def save_if_there_is_room(signature: Any, data: Any) -> None:
        with suppress(OSError):
            save(signature, data)

    kernel_cache.save_overload = save_if_there_is_room


def njit(function: Kernel) -> Kernel:
    """Compile ``function`` with numba, or return it as it is."""
    return _compile(function)


def njit_bare(function: Kernel) -> Kernel:
    """Compile ``function`` without reference counting: many array arguments cost nothing, but it must not allocate one.

    Only kernels may call the result with arrays, or Python where it neither allocates nor returns any.
    """
    return _compile(function, _nrt=False)


def njit_uncached(function: Kernel) -> Kernel:
    """Compile a user's ``function``, which lives in no source file of this package, without a disk cache."""
    if not HAS_NUMBA:
        return function
    compiled: Kernel = numba.njit(function, error_model="numpy", nogil=True)
    return compiled
