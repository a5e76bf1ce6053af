"""``switch.py``, written from the catalogue: ``python -m sgms_observer.effects.switch_source``.

A compiled kernel cannot call what it finds in a list, so the records become one ``elif`` each. The source is a file of
the package, because kernels are cached on disk by their file.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sgms_observer.effects.catalogue import BUILT_IN
from sgms_observer.effects.effect import Effect, Place

_STATE = "<state>"  # stands for a name of its own in each branch: tuples of different lengths need different names
PAGE = Path(__file__).with_name("switch.py")

_HEAD = '''"""The effects of the package as compiled switches, one branch per record of the catalogue.

Written by ``python -m sgms_observer.effects.switch_source``; do not edit. Arguments as in ``kernels``.
"""

from __future__ import annotations

from typing import Any

{imports}
from sgms_observer.jit import njit

{formulas}


@njit
def built_in_step(
    kind: int, p: Any, s: Any, q: float, v: float, a: float, t: float, u: float, h: float, level: float,
    v2: float, a2: float,
) -> tuple[float, float]:  # fmt: skip
    """Advance one effect by one step; return its force [N] and its factor on the Stribeck level [-]."""
    force = 0.0
    factor = 1.0
{steps}
    return force, factor


@njit
def effort_effect(kind: int, p: Any, u: float) -> float:
    """Return the effort that one effect without memory lets arrive [N]."""
{efforts}
    return u


@njit
def needed_effect(kind: int, p: Any, force: float) -> float:
    """Return the command that lets ``force`` arrive through one effect [N]."""
{commands}
    return force


@njit
def position_effect(kind: int, p: Any, q: float) -> float:
    """Return the position that one effect makes the encoder show [m]."""
{positions}
    return q


@njit
def position_correction(kind: int, p: Any, q: float) -> float:
    """Return the true position for what the encoder shows [m]; what an effect has lost stays lost."""
{corrections}
    return q
'''


def switch_source() -> str:
    """Return the text of ``switch.py``."""
    formulas: dict[str, Callable[..., Any]] = {}

    def call(formula: Callable[..., Any], **renamed: str) -> str:
        formulas[formula.__name__] = formula
        names = inspect.signature(formula).parameters
        return f"_{formula.__name__}({', '.join(renamed.get(name, name) for name in names)})"

    def step(entry: Effect) -> list[str]:
        lines = [f"{_STATE} = {call(entry.advance)}"] if entry.advance else []
        lines += [f"s[{i}] = {_STATE}[{i}]" for i in range(len(entry.initial_state))]
        target = "factor" if entry.place is Place.LEVEL_FACTOR else "force"
        return [*lines, f"{target} = {call(entry.output)}"]

    def acts(entry: Effect) -> bool:
        is_force = entry.place in (Place.ADDED_FORCE, Place.LEVEL_FACTOR)
        return is_force or (entry.place is Place.PLANT and entry.advance is not None)

    path = [entry for entry in BUILT_IN if entry.place is Place.EFFORT_PATH and not entry.is_delay]
    encoder = [entry for entry in BUILT_IN if entry.place is Place.MEASURED_POSITION]
    parts = {
        "steps": _switch([(entry, step(entry)) for entry in BUILT_IN if acts(entry)]),
        "efforts": _switch([(entry, [f"u = {call(entry.output)}"]) for entry in path]),
        "commands": _switch(
            [(entry, [f"force = {call(entry.inverse, u='force')}"]) for entry in path if entry.inverse]
        ),
        "positions": _switch([(entry, [f"q = {call(entry.output)}"]) for entry in encoder]),
        "corrections": _switch([(entry, [f"q = {call(entry.inverse)}"]) for entry in encoder if entry.inverse]),
    }
    return _HEAD.format(imports=_imports(formulas), formulas=_bindings(formulas), **parts)


def _switch(branches: list[tuple[Effect, list[str]]]) -> str:
    """Return the branches as one ``if``; records that do the same share a branch."""
    same: dict[tuple[str, ...], list[Effect]] = {}
    for entry, lines in branches:
        same.setdefault(tuple(lines), []).append(entry)
    text: list[str] = []
    for steps, entries in same.items():
        numbers = [BUILT_IN.index(entry) for entry in entries]
        condition = f"kind == {numbers[0]}" if len(numbers) == 1 else f"{numbers[0]} <= kind <= {numbers[-1]}"
        names = ", ".join(entry.name for entry in entries)
        text.append(f"    {'elif' if text else 'if'} {condition}:  # {names}")
        text += [f"        {line.replace(_STATE, f'{entries[0].name}_state')}" for line in steps]
    return "\n".join(text)


def _imports(formulas: dict[str, Callable[..., Any]]) -> str:
    """Return the imports of the formulas' modules; those of a learnt map call each other and come compiled."""
    modules = sorted({formula.__module__ for formula in formulas.values()})
    plain = [module.rsplit(".", 1)[1] for module in modules if not module.endswith("learnt_map")]
    found = [f"from sgms_observer.formulas import {', '.join(plain)}"]
    if len(plain) < len(modules):
        found.insert(0, "from sgms_observer.effects import map_kernel")
    return "\n".join(found)


def _bindings(formulas: dict[str, Callable[..., Any]]) -> str:
    """Return one compiled formula a line."""
    lines = []
    for name, formula in formulas.items():
        module = formula.__module__.rsplit(".", 1)[1]
        lines.append(
            f"_{name}: Any = " + (f"map_kernel.{name}" if module == "learnt_map" else f"njit({module}.{name})")
        )
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(switch_source(), encoding="utf-8")
