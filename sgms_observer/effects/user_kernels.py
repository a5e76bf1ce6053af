"""Effects of the user's own as one compiled function that the catalogue's switch calls.

Its type never changes (a first-class function), so that a stage or observer kernel compiled and cached once serves
any user's effects. Without such effects it is None, and kernels are compiled without the call.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

from sgms_observer import jit
from sgms_observer.effects.effect import INPUTS, Effect, Place
from sgms_observer.errors import ConfigurationError


def _compile(function: Callable[..., None]) -> Any:
    """Return ``function`` as a first-class compiled function, or as it is without numba."""
    if not jit.HAS_NUMBA:
        return function
    import numba

    floats = numba.types.Array(numba.float64, 1, "C")
    return numba.cfunc(numba.types.void(numba.int64, floats, floats, floats, floats))(function)


def compile_user_effects(effects: Sequence[Effect]) -> Any:
    """Compile the users' formulas into one function ``(number, inputs, s, p, out)``.

    Args:
        effects: in the order of their numbers.

    Returns:
        The function; it writes force [N] and level factor [-] into ``out`` and advances ``s``. None without effects:
        handing a first-class function to a kernel costs 14 us per call, which a node would pay for every sample.

    Raises:
        ConfigurationError: one sentence when a formula cannot be compiled.
    """
    if not effects:
        return None
    lines, formulas = user_step_lines(effects)
    scope: dict[str, Any] = {name: jit.njit_uncached(formula) for name, formula in formulas.items()}
    exec("\n".join(lines), scope)
    try:
        return _compile(scope["user_step"])
    except Exception as error:  # numba raises many kinds, over many lines
        first = str(error).strip().splitlines()[0]
        listed = ", ".join(entry.name for entry in effects)
        raise ConfigurationError(
            [f"effects {listed} cannot be compiled ({first}); write their formulas over math, without other libraries"]
        ) from error


def user_step_lines(effects: Sequence[Effect]) -> tuple[list[str], dict[str, Callable[..., Any]]]:
    """Return the source of that function, and the formulas by the names that it calls them."""
    formulas: dict[str, Callable[..., Any]] = {}
    lines = ["def user_step(number, inputs, s, p, out):", "    out[0] = 0.0", "    out[1] = 1.0"]
    for number, entry in enumerate(effects):
        formulas[f"output_{number}"] = entry.output
        lines.append(f"    if number == {number}:")
        if entry.advance is not None:
            formulas[f"advance_{number}"] = entry.advance
            lines.append(f"        new = advance_{number}({_arguments(entry.advance)})")
            lines.extend(f"        s[{i}] = new[{i}]" for i in range(len(entry.initial_state)))
        place = 0 if entry.place is Place.ADDED_FORCE else 1
        lines.append(f"        out[{place}] = output_{number}({_arguments(entry.output)})")
    return lines, formulas


def _arguments(formula: Callable[..., Any]) -> str:
    """Return the call's arguments by the names of the formula's own."""
    return ", ".join(
        name if name in ("s", "p") else f"inputs[{INPUTS.index(name)}]"
        for name in inspect.signature(formula).parameters
    )
