"""Start values of a contact with unknown elements: share of the friction that slips at each deflection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.fit import RefitSetup, limits
from sgms_observer.diagnosis.model import COULOMB, STATIC, VISCOUS, predict
from sgms_observer.settings.axis import EffectSettings


def contact_start(setup: RefitSetup, effects: Sequence[EffectSettings]) -> Floats:
    """Return logarithms of the nominal parameters for which the shares of the elements fit the recordings.

    With given slip deflections the friction is linear in the shares. Each element gives a column of a bounded
    least-squares problem, which has one solution. The viscous coefficient is one more unknown.

    Args:
        setup: setup of the fit; its nominal model has the elements.
        effects: effects of the model.

    Source: Al-Bender, Lampaert, Swevers 2005, IEEE Trans. Automatic Control 50(11) (elements in parallel).
    """
    data, nominal = setup.data, setup.nominal
    friction, names = nominal.friction, nominal.parameter_names()
    bound = limits(nominal, setup.tolerance, setup.freedom)
    shares = np.array(friction.element_fraction)
    first = len(names) - len(shares)
    columns, target = [], np.zeros(0)
    for kappa, share in zip(friction.element_stiffness, shares, strict=True):
        alone = replace(friction, element_stiffness=(kappa / share,), element_fraction=(1.0,), element_damping=(0.0,))
        predicted = [predict(replace(nominal, friction=alone).with_effects(effects), motion) for motion in data.motions]
        column = data.whitened([one.friction for one in predicted])
        columns.append(column)
        target = data.whitened([one.residual for one in predicted]) + column
    viscous = data.whitened([friction.viscous_coefficient * motion.velocity for motion in data.motions])
    low = np.append(shares * np.exp(-bound[first:]), np.expm1(-bound[VISCOUS]))
    high = np.append(shares * np.exp(bound[first:]), np.expm1(bound[VISCOUS]))
    high = np.maximum(high, low + 1e-9)
    found = lsq_linear(np.column_stack([*columns, viscous]), target, bounds=(low, high)).x
    total = float(np.sum(found[:-1]))
    logs = np.zeros(len(names))
    logs[VISCOUS] = np.log1p(found[-1])
    logs[COULOMB] = logs[STATIC] = np.log(total)
    ratio = found[:-1] / total / shares
    logs[first - len(shares) : first] = np.log(ratio)  # stiffness follows the share: the deflection stays
    logs[first:] = np.log(ratio)
    return np.asarray(np.clip(logs, -bound, bound), dtype=np.float64)
