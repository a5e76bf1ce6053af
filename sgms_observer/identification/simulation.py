"""Friction of a whole recording with its sensitivities, driven by the measured motion.

Parameters of an element are kappa_i and its Coulomb force a_i = nu_i f_C; all elements share rho = f_S / f_C, the
Stribeck velocity v_s and, for GMS, c = C / f_C. These parameters need no constraint, and forces are linear in the a_i
while sliding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.friction.gms import gms_step_with_slopes
from sgms_observer.friction.sgms import sgms_step_with_slopes
from sgms_observer.jit import njit
from sgms_observer.settings.axis import FrictionSettings

Floats = NDArray[np.float64]

SHARED = 3  # rho, v_s, c
RHO, V_S, RATE = range(SHARED)
_IS_GMS, _LAMBDA, _ZETA, _GAMMA, _IS_PAPER, _FIXED = range(6)


@dataclass(frozen=True)
class ElementShape:
    """Kind and smoothing of the model, which are not fitted.

    Attributes:
        is_gms: GMS instead of S-GMS.
        numbers: fixed numbers for the kernel.
    """

    is_gms: bool
    numbers: Floats

    @staticmethod
    def of(settings: FrictionSettings, model: str) -> ElementShape:
        """Take the smoothing from settings and the kind from ``model`` (``sgms`` or ``gms``)."""
        numbers = np.zeros(_FIXED)
        numbers[_IS_GMS] = float(model == "gms")
        numbers[_LAMBDA] = settings.smoothing_lambda
        numbers[_ZETA] = settings.smoothing_zeta
        numbers[_GAMMA] = settings.smoothing_gamma
        numbers[_IS_PAPER] = float(settings.reset == "paper")
        return ElementShape(model == "gms", numbers)


@njit
def _simulate(
    travel: Floats, factor: Floats, period: float, kappa: Floats, level: Floats, shared: Floats, numbers: Floats,
    out: Floats, slopes: Floats,
) -> None:  # fmt: skip
    """Write the summed element force after each step and its derivatives (kappa.., a.., rho, v_s, c)."""
    n_z = kappa.shape[0]
    force = np.zeros(n_z)
    mode = np.zeros(n_z, dtype=np.int64)
    element_slopes = np.zeros((n_z, 2 + 3))  # d force_i / d (kappa_i, a_i, rho, v_s, c)
    rho, v_s, rate = shared[0], shared[1], shared[2]
    for k in range(travel.shape[0]):
        velocity = travel[k] / period
        ratio = velocity / v_s
        bump = math.exp(-ratio * ratio)
        bump *= factor[k]
        curve = factor[k] + (rho - 1.0) * bump
        curve_v_s = (rho - 1.0) * bump * 2.0 * ratio * ratio / v_s
        gain = numbers[_GAMMA]
        gain_v_s = 0.0
        if numbers[_IS_PAPER] > 0.5:
            gain = numbers[_GAMMA] * abs(velocity) / v_s
            gain_v_s = -gain / v_s
        if velocity != 0.0:
            direction = 1.0 if velocity > 0.0 else -1.0
            for i in range(n_z):
                if numbers[_IS_GMS] > 0.5:
                    after, mode_after, keep, by_kappa, by_curve = gms_step_with_slopes(
                        force[i], mode[i], velocity, period, kappa[i], level[i], curve, rate
                    )
                    mode[i] = mode_after
                    by_level = 0.0
                    by_rate = 0.0
                    if mode_after != 0:
                        by_level = direction * curve * (1.0 - keep)
                        if keep > 0.0:
                            by_rate = -(after - direction * level[i] * curve) * period / curve
                    by_gain = 0.0
                else:
                    limit = level[i] * curve
                    after, keep, by_kappa, by_limit, by_gain = sgms_step_with_slopes(
                        force[i], velocity, period, kappa[i], limit, numbers[_LAMBDA], numbers[_ZETA], gain
                    )
                    by_level = by_limit * curve
                    by_curve = by_limit * level[i]
                    by_rate = 0.0
                force[i] = after
                element_slopes[i, 0] = keep * element_slopes[i, 0] + by_kappa
                element_slopes[i, 1] = keep * element_slopes[i, 1] + by_level
                element_slopes[i, 2] = keep * element_slopes[i, 2] + by_curve * bump
                element_slopes[i, 3] = keep * element_slopes[i, 3] + by_curve * curve_v_s + by_gain * gain_v_s
                element_slopes[i, 4] = keep * element_slopes[i, 4] + by_rate
        total = 0.0
        for j in range(3):
            slopes[k, 2 * n_z + j] = 0.0
        for i in range(n_z):
            total += force[i]
            slopes[k, i] = element_slopes[i, 0]
            slopes[k, n_z + i] = element_slopes[i, 1]
            for j in range(3):
                slopes[k, 2 * n_z + j] += element_slopes[i, 2 + j]
        out[k] = total


@njit
def _simulate_forces(travel: Floats, period: float, kappa: Floats, level: Floats, numbers: Floats, out: Floats) -> None:
    """Write the force of each element by itself on a flat Stribeck curve."""
    n_z = kappa.shape[0]
    force = np.zeros(n_z)
    lam, zeta, gamma = numbers[_LAMBDA], numbers[_ZETA], numbers[_GAMMA]
    for k in range(travel.shape[0]):
        if travel[k] != 0.0:
            for i in range(n_z):
                after, _keep, _by_kappa, _by_limit, _by_gain = sgms_step_with_slopes(
                    force[i], travel[k] / period, period, kappa[i], level[i], lam, zeta, gamma
                )
                force[i] = after
        out[k, :] = force


def friction_and_slopes(
    position: Floats,
    period: float,
    kappa: Floats,
    level: Floats,
    shared: Floats,
    shape: ElementShape,
    factor: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Simulate the elements along a measured motion, from rest without force.

    Args:
        position: position [m], shape (n,).
        period: time between two samples [s].
        kappa: element stiffness [N/m], shape (n_z,).
        level: element Coulomb force a_i [N], shape (n_z,).
        shared: rho [-], v_s [m/s], c [1/s].
        shape: kind of model and its smoothing.
        factor: known effects' factor on the Stribeck level [-], shape (n,); None for 1.

    Returns:
        Summed element force [N], shape (n,); its derivatives by kappa (n_z), a (n_z), rho, v_s, c,
        shape (n, 2 n_z + 3).
    """
    travel = np.diff(position, prepend=position[:1])
    out = np.empty(len(position))
    slopes = np.empty((len(position), 2 * len(kappa) + SHARED))
    ones = np.ones(len(position)) if factor is None else factor
    _simulate(travel, ones, period, kappa, level, shared, shape.numbers, out, slopes)
    return out, slopes


def unit_elements(position: Floats, period: float, slip_deflection: Floats, shape: ElementShape) -> Floats:
    """Simulate elements of 1 N that slip at given deflections, each by itself.

    Args:
        position: position [m], shape (n,).
        period: time between two samples [s].
        slip_deflection: deflection at which each slips [m], shape (k,).
        shape: smoothing of the model.

    Returns:
        Force of each element [N], shape (n, k).
    """
    travel = np.diff(position, prepend=position[:1])
    out = np.empty((len(position), len(slip_deflection)))
    _simulate_forces(travel, period, 1.0 / slip_deflection, np.ones(len(slip_deflection)), shape.numbers, out)
    return out
