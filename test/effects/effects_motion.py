"""A motion with reversals, rests and speeds over decades, and values at which every effect acts."""

import numpy as np

PERIOD = 1.0e-3
VALUES = {
    "cogging": (1.4, 0.01, 0.3, 0.4, -0.2),
    "spring": (30.0, 0.01),
    "offset": (0.7,),
    "gravity": (56.0, 0.4, 3.0),
    "asymmetric_viscous": (5.0,),
    "nonlinear_viscous": (1.2, 0.6, 0.05),
    "quadratic_drag": (40.0,),
    "eddy_current": (2.0, 0.04, 0.5),
    "periodic_disturbance": (0.5, 7.0, 0.1),
    "cross_axis_coupling": (1.5, 3.0),
    "presliding": (0.8, 2.0e-5),
    "mass_error": (0.5,),
    "flexible_mode": (1.0, 40.0, 0.05),
    "position_periodic_friction": (0.2, 0.008, 0.4),
    "position_dependent_friction": (0.4, 0.01, 0.005),
    "asymmetric_coulomb": (0.15,),
    "stribeck": (0.3, 0.01),
    "load_dependent_friction": (0.1,),
    "thermal_drift": (-0.3, 5.0, 0.6, 0.03),
    "wear_step": (0.2, 0.1, 0.02),
    "dwell_breakaway": (0.4, 0.3, 5.0e-5, 1.0e-4),
    "frictional_lag": (60.0, 2.0e-5),
    "backlash": (1.0e-5, 0.5, 3.0e-5),
    "actuator_gain": (1.1,),
    "actuator_saturation": (3.0,),
    "actuator_dead_zone": (0.4,),
    "actuator_delay": (2.6e-3,),
    "encoder_interpolation_error": (2.0e-7, 2.0e-5, 0.5),
    "quantisation": (1.0e-7,),
}


def motion(n: int = 4000) -> dict[str, np.ndarray]:
    """Return the inputs of the formulas by their names."""
    t = np.arange(n) * PERIOD
    gate = np.where((t % 2.0) < 1.6, 1.0, 0.0)
    q = np.zeros(n)
    v = gate * (0.05 * np.sin(2 * np.pi * 0.9 * t) + 0.002 * np.sin(2 * np.pi * 6.3 * t))
    q[1:] = np.cumsum(v[1:]) * PERIOD
    a = np.gradient(v, PERIOD)
    return {
        "q": q, "v": v, "a": a, "t": t, "u": 5.0 * np.sin(3.0 * t), "h": np.full(n, PERIOD),
        "level": 4.0 + 0.5 * np.exp(-((v / 1e-3) ** 2)), "v2": np.cos(2.0 * t), "a2": -2.0 * np.sin(2.0 * t),
    }  # fmt: skip
