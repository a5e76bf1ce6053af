"""The physics, written once.

Every module here is plain Python over the name ``math``, without branches on a value. The same source serves

* compiled kernels (``math`` is Python's, numba compiles it),
* symbolic models with exact derivatives (``symbolic`` binds ``math`` to CasADi),
* whole recordings at once (``vectorised`` binds ``math`` to numpy).
"""

from __future__ import annotations

import importlib.util
import sys
from functools import cache
from types import ModuleType


@cache
def bind(module_name: str, backend: str) -> ModuleType:
    """Load a formula module a second time with its ``math`` bound to another library.

    Args:
        module_name: module inside this package, for example ``"friction"``; or the full name of any module
            written by the same rules.
        backend: ``"casadi"`` or ``"numpy"``.

    Returns:
        A fresh module whose functions compute with ``backend``.

    Raises:
        ModuleNotFoundError: if there is no such module.
    """
    full_name = module_name if "." in module_name else f"{__name__}.{module_name}"
    spec = importlib.util.find_spec(full_name)
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(f"no formula module named {full_name}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.math = importlib.import_module(backend)  # type: ignore[attr-defined]
    sys.modules[f"{full_name}@{backend}"] = module
    return module


def symbolic(module_name: str) -> ModuleType:
    """Return formula module ``module_name`` over CasADi symbols (see ``bind``)."""
    return bind(module_name, "casadi")


def vectorised(module_name: str) -> ModuleType:
    """Return formula module ``module_name`` over numpy arrays (see ``bind``)."""
    return bind(module_name, "numpy")
