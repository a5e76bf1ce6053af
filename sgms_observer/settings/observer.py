"""Settings of the observer: filter (block V), estimator (block Z) and compensation."""

from __future__ import annotations

from dataclasses import dataclass

from sgms_observer.settings.declaration import setting

FILTERS = ("lowpass", "savgol", "kalman")
ESTIMATORS = ("ekf", "mhe")
ESTIMABLE = ("kappa", "viscous_coefficient", "coulomb_force", "static_force", "stribeck_velocity", "mass", "offset")


@dataclass(frozen=True)
class FilterSettings:
    """Block V: velocity and acceleration from the measured position, and the effort on the same delay."""

    kind: str = setting(
        "savgol",
        "lowpass: the paper's finite difference and 2nd-order low-pass; savgol: least-squares polynomial over the"
        " latest samples; kalman: steady tracking filter",
        choices=FILTERS,
    )
    cutoff: float = setting(500.0, "cut-off of the low-pass", "Hz", above=0.0)
    window: float = setting(3.0e-3, "length of the polynomial's window", "s", above=0.0)
    degree: int = setting(3, "degree of the polynomial", minimum=2, maximum=6)
    position_noise: float = setting(
        5.0e-9,
        "standard deviation of the position measurement, the encoder's steps (step / sqrt 12) included",
        "m",
        above=0.0,
    )
    jerk_density: float = setting(
        1.0, "spectral density of the jerk for the kalman filter", "m/s^3/sqrt(Hz)", above=0.0
    )
    lag: float = setting(
        2.0e-3, "how long the kalman filter waits to smooth with later samples", "s", minimum=0.0, maximum=0.1
    )
    effort_is_held: bool = setting(
        True,
        "the effort acts from its stamp to the next one (a sampled controller); false: it is measured at its stamp",
    )
    align_effort: bool = setting(True, "give the effort the same filter and delay as the acceleration (block Y)")
    maximum_gap: float = setting(0.02, "a longer pause between two samples restarts the filters", "s", above=0.0)
    jump_speed: float = setting(
        10.0,
        "a larger change of speed from one sample to the next is a jump of the encoder and restarts the filters",
        "m/s",
        above=0.0,
    )


@dataclass(frozen=True)
class EstimatorSettings:
    """Block Z: EKF or MHE (eqs 11-14)."""

    kind: str = setting("mhe", "extended Kalman filter or moving horizon estimator", choices=ESTIMATORS)
    correction_every: int = setting(20, "samples from one correction to the next", "samples", minimum=1, maximum=1000)
    horizon: int = setting(4, "intervals N in the MHE's window", minimum=1, maximum=128)
    iterations: int = setting(1, "real-time Gauss-Newton iterations per correction", minimum=1, maximum=100)
    converge: bool = setting(False, "iterate to convergence at every correction instead of real-time iterations")
    measurement_std: float = setting(0.1, "standard deviation of the measured friction, sqrt(R)", "N", above=0.0)
    process_std: float = setting(
        0.05, "force drift per correction of each element as a share of nu f_C, sqrt(Q)", minimum=0.0
    )
    initial_std: float = setting(0.5, "initial force uncertainty as a share of nu f_C", above=0.0)
    state_bound: float = setting(1.3, "beta of eq. 14d: elements stay within beta times the Stribeck curve", above=1.0)
    parameters: tuple[str, ...] = setting((), "parameters p estimated with the state", choices=ESTIMABLE)
    parameter_initial_std: float = setting(
        0.2, "initial uncertainty of each parameter as a share of its value", above=0.0
    )
    parameter_walk: float = setting(
        0.0, "drift of each parameter per correction as a share of its value; 0 for constants", minimum=0.0
    )
    parameter_minimum: float = setting(
        0.3, "lower bound of each parameter as a share of its value (eq. 14e)", above=0.0
    )
    parameter_maximum: float = setting(
        3.0, "upper bound of each parameter as a share of its value (eq. 14e)", above=1.0
    )
    offset_scale: float = setting(
        1.0, "unit in which an estimated offset is initialised, walks and is bounded (+-10)", "N", above=0.0
    )
    outlier_nis: float = setting(
        0.0, "innovation squared over its variance above which a sample is rejected; 0 never", minimum=0.0
    )
    gms_modes: str = setting(
        "simulated",
        "modes of a GMS model: as simulated, with the stick-slip event inside a step and anew in each MHE iteration; "
        "or by the paper's a-priori rules, decided at each sample from the prediction and fixed in the MHE's window",
        choices=("simulated", "predicted"),
    )
    deadline: float = setting(
        0.0, "computing time after which the next correction is left to the EKF; 0 only counts", "s", minimum=0.0
    )


@dataclass(frozen=True)
class CompensationSettings:
    """Feedforward: friction of the motion to come, kept safe."""

    enabled: bool = setting(False, "publish a non-zero compensation")
    gain: float = setting(0.9, "share of the predicted friction that is compensated", minimum=0.0, maximum=1.0)
    limit: float = setting(10.0, "largest compensation", "N", minimum=0.0)
    slew_limit: float = setting(2.0e4, "fastest change of the compensation", "N/s", above=0.0)
    look_ahead: float = setting(
        0.0, "delay from measurement to actuation that the prediction bridges", "s", minimum=0.0, maximum=0.1
    )
    standstill_velocity: float = setting(
        0.0,
        "speed up to which a motion may be noise and does not move the compensation; 0 derives it: for a reference"
        " none, without one from position_noise and the filter",
        "m/s",
        minimum=0.0,
    )
    fade_std: float = setting(1.0, "friction_std at which the compensation has faded to zero", "N", above=0.0)
    horizon: float = setting(
        0.3,
        "how far beyond the latest sample compensation_horizon reaches where the reference is known ahead; 0 for none",
        "s",
        minimum=0.0,
        maximum=2.0,
    )
    timeout: float = setting(0.05, "without good samples for this long the compensation goes to zero", "s", above=0.0)
