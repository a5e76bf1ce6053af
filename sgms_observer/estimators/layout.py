"""How a friction model and the estimated parameters p are laid out in the kernels' flat arrays.

``model`` holds scalars at the indices below, ``elements`` the rows kappa, nu, sigma. Estimated parameters are
shares of their nominal value (the offset: newton over ``offset_scale``), so that everything a kernel handles is near 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit_bare
from sgms_observer.settings.axis import ESTIMABLE, MODELS, EstimatorSettings, FrictionSettings

MODEL, RESET, VISCOUS, COULOMB, STATIC, STRIBECK, ATTRACTION, LAMBDA, ZETA, GAMMA, MASS, OFFSET, MODEL_SIZE = range(13)
SGMS, GMS = range(2)
PAPER_RESET, RATE_INDEPENDENT_RESET = range(2)
KAPPA, NU, SIGMA = range(3)

P_KAPPA, P_VISCOUS, P_COULOMB, P_STATIC, P_STRIBECK, P_MASS, P_OFFSET = range(7)
SLOT = (-1, VISCOUS, COULOMB, STATIC, STRIBECK, MASS, OFFSET)


class ModelArrays(NamedTuple):
    """A friction model with mass and offset, for the kernels.

    Attributes:
        scalars: shape (MODEL_SIZE,), SI units.
        elements: rows kappa [N/m], nu [-], sigma [N s/m]; shape (3, n_z).
    """

    scalars: Floats
    elements: Floats


class ParameterArrays(NamedTuple):
    """Which parameters are estimated and on what scale.

    Attributes:
        kinds: P_* code of each entry of p, shape (n_p,).
        scale: SI value of one unit of each entry, shape (n_p,).
        start: initial value in those units: 1, or 0 for the offset, shape (n_p,).
        lower: lower bound (14e), shape (n_p,).
        upper: upper bound (14e), shape (n_p,).
    """

    kinds: Floats
    scale: Floats
    start: Floats
    lower: Floats
    upper: Floats


def model_arrays(friction: FrictionSettings, mass: float, offset: float = 0.0) -> ModelArrays:
    """Lay a checked friction model out for the kernels.

    Args:
        friction: checked settings.
        mass: moving mass [kg].
        offset: constant force [N].
    """
    scalars = np.zeros(MODEL_SIZE)
    scalars[MODEL] = MODELS.index(friction.model)
    scalars[RESET] = PAPER_RESET if friction.reset == "paper" else RATE_INDEPENDENT_RESET
    scalars[VISCOUS] = friction.viscous_coefficient
    scalars[COULOMB] = friction.coulomb_force
    scalars[STATIC] = friction.static_force
    scalars[STRIBECK] = friction.stribeck_velocity
    scalars[ATTRACTION] = friction.attraction_rate
    scalars[LAMBDA] = friction.smoothing_lambda
    scalars[ZETA] = friction.smoothing_zeta
    scalars[GAMMA] = friction.smoothing_gamma
    scalars[MASS] = mass
    scalars[OFFSET] = offset
    elements = np.array([friction.element_stiffness, friction.element_fraction, friction.element_damping], dtype=float)
    return ModelArrays(scalars, elements)


def parameter_arrays(settings: EstimatorSettings, model: ModelArrays) -> ParameterArrays:
    """Lay out the estimated parameters p.

    Args:
        settings: checked estimator settings.
        model: the nominal model.
    """
    kinds = np.array([ESTIMABLE.index(name) for name in settings.parameters], dtype=np.float64)
    count = len(kinds)
    scale, start = np.ones(count), np.ones(count)
    lower = np.full(count, settings.parameter_minimum)
    upper = np.full(count, settings.parameter_maximum)
    for j, kind in enumerate(kinds):
        if kind == P_OFFSET:
            scale[j] = settings.offset_scale
            start[j] = model.scalars[OFFSET] / settings.offset_scale
            lower[j], upper[j] = start[j] - 10.0, start[j] + 10.0
        elif kind != P_KAPPA:
            scale[j] = max(float(model.scalars[SLOT[int(kind)]]), 1e-12)
    return ParameterArrays(kinds, scale, start, lower, upper)


@njit_bare
def copy_vector(source: Floats, target: Floats) -> None:
    """Copy a vector entry by entry: a slice assignment would make room for a copy on the way."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@njit_bare
def copy_matrix(source: Floats, target: Floats) -> None:
    """Copy a matrix entry by entry, see ``copy_vector``."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@njit_bare
def apply_parameters(scalars: Floats, elements: Floats, kinds: Floats, scale: Floats, p: Floats,
                     scalars_out: Floats, elements_out: Floats) -> None:  # fmt: skip
    """Write the model with the estimated parameters in place.

    Args:
        scalars: nominal model scalars.
        elements: nominal element rows.
        kinds: P_* code of each entry of p.
        scale: SI value of one unit of each entry.
        p: estimated parameters in those units.
        scalars_out: the model with p applied.
        elements_out: the element rows with p applied.
    """
    copy_vector(scalars, scalars_out)
    copy_matrix(elements, elements_out)
    for j in range(kinds.shape[0]):
        kind = kinds[j]
        value = p[j] * scale[j]
        if kind == P_KAPPA:
            for i in range(elements.shape[1]):
                elements_out[KAPPA, i] = elements[KAPPA, i] * p[j]
        elif kind == P_VISCOUS:
            scalars_out[VISCOUS] = value
        elif kind == P_COULOMB:
            scalars_out[COULOMB] = value
        elif kind == P_STATIC:
            scalars_out[STATIC] = value
        elif kind == P_STRIBECK:
            scalars_out[STRIBECK] = value
        elif kind == P_MASS:
            scalars_out[MASS] = value
        else:
            scalars_out[OFFSET] = value
