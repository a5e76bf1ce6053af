"""Places in the plant's parameter vector for what can be hidden in it; zero means absent unless said otherwise.

All SI units. ``*_A`` of a friction factor is a share of the sliding level [-], of an added force a force [N].
"""

from __future__ import annotations

import numpy as np

from sgms_observer.arrays import Floats

COGGING_A, COGGING_PITCH, COGGING_PHASE, COGGING_A2, COGGING_PHASE2 = 0, 1, 2, 3, 4
RIPPLE_A, RIPPLE_PITCH, RIPPLE_PHASE = 5, 6, 7  # friction, periodic in position
SPOT_A, SPOT_PLACE, SPOT_HALF_WIDTH, SPOT_EDGE = 8, 9, 10, 11  # friction, one tight place
SPRING_K1, SPRING_K3, SPRING_REST = 12, 13, 14
OFFSET = 15
SIDED_COULOMB_A = 16
SIDED_VISCOUS_A, SIDED_VISCOUS_SPEED = 17, 18
WEAKENING_A, WEAKENING_SPEED, WEAKENING_POWER = 19, 20, 21  # friction, falls with speed
POWER_A, POWER_SPEED, POWER_EXPONENT = 22, 23, 24  # |v|^n
DRAG_A, DRAG_SPEED = 25, 26
EDDY_A, EDDY_SPEED, EDDY_POWER = 27, 28, 29
AGE_A, AGE_TIME, AGE_DISTANCE = 30, 31, 32  # contact ageing at rest
LAG_TIME = 33  # s of the level's own lag, or LAG_BY_ATTRACTION
HEAT_A, HEAT_TIME, HEAT_POWER = 34, 35, 36
WEAR_A, WEAR_TRAVEL, WEAR_LENGTH = 37, 38, 39
LOAD_A, LOAD_ACCELERATION = 40, 41
EXTRA_MASS = 42
DELAY = 43
GAIN = 44  # 1 when absent
LIMIT = 45  # inf when absent
DEAD_BAND = 46
LINK_MASS, LINK_STIFFNESS, LINK_DAMPING, LINK_GAP, LINK_FRICTION_SHARE = 47, 48, 49, 50, 51
ENCODER_A, ENCODER_PITCH, ENCODER_PHASE, ENCODER_A2 = 52, 53, 54, 55
RESOLUTION = 56  # m, the encoder's step
IRON_SHARE, IRON_WIDTH = 57, 58  # hysteresis of the effort
MEMORY_A, MEMORY_TIME = 59, 60  # friction remembers the direction
COVER_STICK, COVER_SLIP, COVER_STIFFNESS = 61, 62, 63
RIDGE_A, RIDGE_WIDTH = 64, 65  # grease pushed up where the stage rested
COUNT = 66

LAG_BY_ATTRACTION = -1.0
"""Value of ``LAG_TIME`` where the slow attraction of the contact is what is hidden."""

NOMINAL_RESOLUTION = 1.0e-8  # m


def nothing_hidden() -> Floats:
    """Return the parameter vector of a plant without any hidden effect."""
    vector = np.zeros(COUNT)
    vector[GAIN] = 1.0
    vector[LIMIT] = np.inf
    vector[RESOLUTION] = NOMINAL_RESOLUTION
    return vector
