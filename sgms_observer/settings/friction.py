"""Settings of the friction model (Table I of Boegli et al. by default)."""

from __future__ import annotations

from dataclasses import dataclass

from sgms_observer.settings.declaration import setting

MODELS = ("sgms", "gms")
RESETS = ("paper", "rate_independent")


@dataclass(frozen=True)
class FrictionSettings:
    """GMS or S-GMS friction of one axis; the lists have one entry per element."""

    model: str = setting("sgms", "friction model", choices=MODELS)
    reset: str = setting(
        "rate_independent", "reset function of eq. 7: as in the paper, or right at every speed", choices=RESETS
    )
    element_stiffness: tuple[float, ...] = setting(
        (12.0e6, 2.5e6, 0.71e6, 0.79e6), "stiffness kappa of each element", "N/m", above=0.0
    )
    element_fraction: tuple[float, ...] = setting(
        (0.067, 0.056, 0.047, 0.83), "share nu of the sliding force that each element carries; sums to 1", above=0.0
    )
    element_damping: tuple[float, ...] = setting(
        (0.0, 0.0, 0.0, 0.0), "micro-viscous damping sigma of each element", "N s/m", minimum=0.0
    )
    viscous_coefficient: float = setting(20.0, "viscous friction sigma_v", "N s/m", minimum=0.0)
    static_force: float = setting(4.5, "static force f_S, the Stribeck curve at rest", "N", above=0.0)
    coulomb_force: float = setting(4.0, "Coulomb force f_C, the Stribeck curve at speed", "N", above=0.0)
    stribeck_velocity: float = setting(1.0e-3, "Stribeck velocity v_s", "m/s", above=0.0)
    attraction_rate: float = setting(50.0, "attraction parameter C of the GMS model", "N/s", above=0.0)
    smoothing_lambda: float = setting(1000.0, "slope lambda of the stick-slip transition (eq. 6)", above=0.0)
    smoothing_zeta: float = setting(
        0.98, "ratio zeta at which an element starts to slip (eq. 6)", above=0.0, maximum=1.0
    )
    smoothing_gamma: float = setting(100.0, "slope gamma of the reset (eq. 7)", above=0.0)
