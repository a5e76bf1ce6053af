"""The formulas of a learnt map, compiled: they call each other, so their module is loaded once more for it."""

from __future__ import annotations

import importlib.util
from types import FunctionType
from typing import Any

from sgms_observer.formulas import learnt_map as plain
from sgms_observer.jit import njit


def _compiled() -> Any:
    """Return the formula module with every function in it compiled."""
    spec = importlib.util.find_spec(plain.__name__)
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(plain.__name__)
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name, value in vars(module).copy().items():
        if isinstance(value, FunctionType):
            setattr(module, name, njit(value))
    return module


_formulas = _compiled()
coordinate = _formulas.coordinate
learnt_map = _formulas.learnt_map
learnt_map_next = _formulas.learnt_map_next
learnt_map_weights = _formulas.learnt_map_weights
