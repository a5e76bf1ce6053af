"""Settings of one axis and of the whole package, as checked frozen dataclasses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from sgms_observer.effects.effect import EffectSettings as EffectSettings
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.declaration import section, setting
from sgms_observer.settings.units import JOINT_TYPES, PRISMATIC, Scales, Units

MODELS = ("sgms", "gms")
RESETS = ("paper", "rate_independent")

FILTERS = ("lowpass", "savgol", "kalman")
ESTIMATORS = ("ekf", "mhe")
ESTIMABLE = ("kappa", "viscous_coefficient", "coulomb_force", "static_force", "stribeck_velocity", "mass", "offset")

REFERENCES = ("sine", "multi_sine", "point_to_point", "file", "topic")
INTERPOLATIONS = ("linear", "cubic")

#: Where ~/save_parameters writes unless the parameter file says otherwise.
SAVE_FILE = "learnt.yaml"


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
        "modes of a GMS model: as simulated, with the stick-slip event inside a step and again in each MHE iteration; "
        "or by the paper's a-priori rules, decided at each sample from the prediction and fixed in the MHE's window",
        choices=("simulated", "predicted"),
    )
    deadline: float = setting(
        0.0, "computing time after which the next correction is made by the EKF; 0 counts misses only", "s", minimum=0.0
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
        "speed below which a motion may be noise and does not change the compensation; 0 derives it from"
        " position_noise and the filter, or is 0 along a reference",
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


@dataclass(frozen=True)
class ControllerSettings:
    """Position controller: PD on the position error with integral action, gains from mass and bandwidth."""

    bandwidth: float = setting(100.0, "closed-loop bandwidth", "Hz", above=0.0)
    damping_ratio: float = setting(0.7, "damping of the closed loop", above=0.0)
    integral_rate: float = setting(0.0, "integral action as a corner frequency; 0 for none", "Hz", minimum=0.0)
    feedforward_mass: float = setting(
        0.0, "share of mass times reference acceleration fed forward", minimum=0.0, maximum=1.5
    )
    effort_limit: float = setting(1.0e3, "largest effort of the actuator", "N", above=0.0)


@dataclass(frozen=True)
class ReferenceSettings:
    """Set-point of the simulated stage."""

    kind: str = setting(
        "sine",
        "shape of the reference; topic: rest until set-points come on the topic reference, then follow them",
        choices=REFERENCES,
    )
    amplitude: float = setting(2.0e-4, "sine: amplitude; point_to_point: stroke", "m", minimum=0.0)
    frequency: float = setting(5.0, "sine: frequency", "Hz", above=0.0)
    amplitudes: tuple[float, ...] = setting((), "multi_sine: amplitude of each sine", "m", minimum=0.0)
    frequencies: tuple[float, ...] = setting((), "multi_sine: frequency of each sine", "Hz", above=0.0)
    phases: tuple[float, ...] = setting((), "multi_sine: phase of each sine; empty for zero", "rad")
    velocity: float = setting(0.05, "point_to_point: largest velocity", "m/s", above=0.0)
    acceleration: float = setting(1.0, "point_to_point: largest acceleration", "m/s^2", above=0.0)
    jerk: float = setting(50.0, "point_to_point: largest jerk", "m/s^3", above=0.0)
    dwell: float = setting(0.2, "point_to_point: rest at each end", "s", minimum=0.0)
    file: str = setting("", "file: CSV with columns time [s] and position [m]; repeated when it ends")
    interpolation: str = setting("cubic", "file: how to go from one point to the next", choices=INTERPOLATIONS)


@dataclass(frozen=True)
class EncoderSettings:
    """Position measurement of the simulated stage."""

    resolution: float = setting(0.0, "quantisation step of the encoder; 0 for none", "m", minimum=0.0)
    noise: float = setting(0.0, "standard deviation of the position noise", "m", minimum=0.0)


@dataclass(frozen=True)
class StageSettings:
    """The simulated stage of one axis; friction and mass are the axis's own unless given here."""

    controller: ControllerSettings = section(ControllerSettings, "position controller")
    reference: ReferenceSettings = section(ReferenceSettings, "set-point")
    encoder: EncoderSettings = section(EncoderSettings, "position measurement")
    mass: float = setting(0.0, "true moving mass where it differs from the axis's; 0 for the same", "kg", minimum=0.0)
    force_noise: float = setting(
        0.0, "standard deviation of the noise on the published effort, per sample", "N", minimum=0.0
    )
    disturbance_noise: float = setting(
        0.0, "standard deviation of a white force on the mass, per sample", "N", minimum=0.0
    )
    substeps: int = setting(10, "integration steps per 0.1 ms", minimum=1, maximum=1000)
    accept_compensation: bool = setting(True, "add friction_compensation to the controller's output")
    actuation_delay: float = setting(
        0.0, "delay from the controller's output to the force", "s", minimum=0.0, maximum=0.1
    )
    seed: int = setting(1, "seed of every random number of this stage", minimum=0)


@dataclass(frozen=True)
class AxisSettings:
    """Everything about one axis."""

    name: str = "x"
    joint_type: str = setting(
        PRISMATIC,
        "prismatic: the axis slides (m, N, kg); revolute: it turns, and every unit of the axis follows"
        " (rad, N m, kg m^2)",
        choices=JOINT_TYPES,
    )
    position_scale: float = setting(
        1.0,
        "factor from position, velocity and reference in topics and bags to m or rad; negative reverses the axis,"
        " 0.01745329252 is for degrees",
        is_nonzero=True,
    )
    effort_scale: float = setting(
        1.0,
        "factor from control_effort in topics and bags to N or N m; negative where the sign of"
        " control_effort is reversed relative to position",
        is_nonzero=True,
    )
    mass: float = setting(10.0, "moving mass; of a revolute axis its moment of inertia", "kg", above=0.0)
    coupled_axis: str = setting(
        "",
        "axis whose motion enters cross_axis_coupling; empty for the axis before this one in axes, or the last for the"
        " first",
    )
    friction: FrictionSettings = section(FrictionSettings, "friction model")
    effects: tuple[EffectSettings, ...] = ()
    stage: StageSettings = section(StageSettings, "simulated stage")
    stage_friction: FrictionSettings | None = None  # x.stage.friction: true friction where it differs
    stage_effects: tuple[EffectSettings, ...] | None = None  # x.stage.effects: true effects where they differ
    filter: FilterSettings = section(FilterSettings, "velocity and acceleration filter")
    estimator: EstimatorSettings = section(EstimatorSettings, "estimator")
    compensation: CompensationSettings = section(CompensationSettings, "feedforward compensation")

    @property
    def units(self) -> Units:
        """Return the units that belong to the axis's joint type."""
        return Units(self.joint_type)

    @property
    def scales(self) -> Scales:
        """Return the factors from what topics and bags carry to the axis's units."""
        return Scales(self.position_scale, self.effort_scale)


@dataclass(frozen=True)
class Settings:
    """A whole parameter file: the axes and what they share."""

    axes: tuple[AxisSettings, ...] = (AxisSettings(),)
    sample_period: float = setting(1.0e-4, "nominal time between two samples", "s", minimum=1.0e-6, maximum=1.0)
    publish_every: int = setting(
        1,
        "samples from one published estimate to the next; the compensation follows every sample",
        "samples",
        minimum=1,
    )
    gather_time: float = setting(
        0.0,
        "time for which observer_node gathers samples that come faster than this, to estimate over them together, and "
        "stage_node, to publish them together; keep it well below look_ahead; 0 takes each at once",
        "s",
        minimum=0.0,
        maximum=0.1,
    )
    autostart: bool = setting(True, "configure and activate the node by itself")
    save_file: str = setting(
        SAVE_FILE, "file that ~/save_parameters writes; relative names start at the folder of the parameter file"
    )
    effect_files: tuple[str, ...] = setting((), "Python files with effects of the user's own")
    source: dict[str, Any] = field(default_factory=dict, compare=False)  # the YAML's tree as read, for writing it back
    folder: str = field(default=".", compare=False)  # where relative file names in ``source`` start

    @property
    def scales(self) -> dict[str, Scales]:
        """Return each axis's name with its factors from topics and bags to SI."""
        return {axis.name: axis.scales for axis in self.axes}

    def wanted_axes(self, names: Sequence[str], source: str) -> tuple[AxisSettings, ...]:
        """Return the axes with these names, in their order; all of them where no name is given.

        Args:
            names: what ``--axis`` gave.
            source: the parameter file, for the error.

        Raises:
            ConfigurationError: an axis is not there.
        """
        known = {axis.name: axis for axis in self.axes}
        strange = [name for name in names if name not in known]
        if strange:
            raise ConfigurationError([f"--axis {strange[0]} is not in {source}; it has {', '.join(known)}"])
        return tuple(known[name] for name in dict.fromkeys(names)) or self.axes

    def coupled_to(self, axis: AxisSettings) -> AxisSettings | None:
        """Return the axis whose motion acts on one by ``cross_axis_coupling``; None where there is none."""
        number = coupled_number(self.axes, self.axes.index(axis))
        return None if number is None else self.axes[number]


def coupled_number(axes: Sequence[AxisSettings], number: int) -> int | None:
    """Return the number of the axis whose motion acts on this one by ``cross_axis_coupling``; None without one."""
    if len(axes) < 2:
        return None
    names = [axis.name for axis in axes]
    wanted = axes[number].coupled_axis
    return names.index(wanted) if wanted in names else (number - 1) % len(axes)
