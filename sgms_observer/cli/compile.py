"""``sgms compile``: compile the numerical kernels into the cache, so that no first start waits for that."""

from __future__ import annotations

import argparse
import time

from sgms_observer.cli.options import add_output_options
from sgms_observer.cli.warn import warn

HELP = "compile the numerical kernels now, so that no node or command waits for that at its first start"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    add_output_options(parser, has_result=False)


def run(args: argparse.Namespace) -> int:
    """Do the job, as ``main.Command``."""
    from sgms_observer import jit
    from sgms_observer.application.kernels import missing_parts
    from sgms_observer.errors import DataError

    if not jit.HAS_NUMBA:
        print("numba is not installed: nothing is compiled, and everything works about a hundred times slower")
        return 0
    missing = missing_parts()
    start = time.monotonic()
    failure = _compiled()
    if failure:
        raise DataError(failure)
    took = f"compiled in {time.monotonic() - start:.0f} s" if missing else "compiled already"
    print(f"kernels {took}: {jit.cache_folder()}")
    return 0


def compile_or_warn() -> None:
    """Compile the kernels that are missing before nodes start; warn where that failed.

    Two processes that each compile the same kernels would share the cores that they need.
    """
    failure = _compiled()
    warn([failure] if failure else [])


def _compiled() -> str:
    """Compile the kernels that are missing, with progress; return why that failed, in one sentence, or nothing."""
    from sgms_observer.application.kernels import compile_ahead
    from sgms_observer.cli.progress import Progress

    with Progress("compile", 1.0) as progress:
        return compile_ahead(show=progress.show)
