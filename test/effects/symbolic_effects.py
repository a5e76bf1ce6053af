"""Effects as CasADi functions with exact derivatives by their parameters and states."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi

from sgms_observer.effects.effect import INPUTS, Effect
from sgms_observer.formulas import symbolic


@dataclass(frozen=True)
class SymbolicEffect:
    """CasADi functions of one effect; arguments are (inputs in the order of ``INPUTS``, s, p).

    Attributes:
        output: force, level factor, effort or position, from the state after the step.
        output_by_parameters: row of derivatives by ``p``.
        advance: state after the step, or None without state.
        advance_by_parameters: its derivatives by ``p``, or None.
    """

    output: casadi.Function
    output_by_parameters: casadi.Function
    advance: casadi.Function | None
    advance_by_parameters: casadi.Function | None


def over_casadi(formula: Callable[..., Any]) -> Callable[..., Any]:
    """Return the catalogue's ``formula`` with its ``math`` bound to CasADi."""
    bound: Callable[..., Any] = getattr(symbolic(formula.__module__), formula.__name__)
    return bound


def symbolic_effect(effect: Effect) -> SymbolicEffect:
    """Build the symbolic functions of ``effect``.

    Args:
        effect: entry of the catalogue; its formulas live in an importable module, and name the inputs they take.
            ``actuator_delay`` takes neighbours in time instead of inputs and has no symbolic form here: its
            derivative by the delay is minus the effort's rate.

    Returns:
        Functions and exact derivatives.
    """
    inputs = casadi.SX.sym("inputs", len(INPUTS))
    s = casadi.SX.sym("s", len(effect.initial_state))
    p = casadi.SX.sym("p", len(effect.parameters))

    def call(formula: Callable[..., Any]) -> Any:
        names = inspect.signature(formula).parameters
        values = {"s": s, "p": p, **{name: inputs[i] for i, name in enumerate(INPUTS)}}
        return over_casadi(formula)(*(values[name] for name in names))

    arguments = [inputs, s, p]
    output = casadi.SX(call(effect.output))
    value = casadi.Function("output", arguments, [output])
    by_parameters = casadi.Function("output_by_parameters", arguments, [casadi.jacobian(output, p)])
    if effect.advance is None:
        return SymbolicEffect(value, by_parameters, None, None)
    state = casadi.vertcat(*call(effect.advance))
    return SymbolicEffect(
        value,
        by_parameters,
        casadi.Function("advance", arguments, [state]),
        casadi.Function("advance_by_parameters", arguments, [casadi.jacobian(state, p)]),
    )
