"""The friction of a simulated table that identification is tested on."""

from sgms_observer.settings.axis import FrictionSettings

FRICTION = FrictionSettings(
    element_stiffness=(5.0e6, 0.8e6),
    element_fraction=(0.2, 0.8),
    element_damping=(0.0, 0.0),
    viscous_coefficient=30.0,
    static_force=5.2,
    coulomb_force=4.0,
    stribeck_velocity=2.0e-3,
)
