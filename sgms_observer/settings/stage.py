"""Settings of the simulated stage: controller, reference, encoder, noise."""

from __future__ import annotations

from dataclasses import dataclass

from sgms_observer.settings.declaration import section, setting

REFERENCES = ("sine", "multi_sine", "point_to_point", "file", "topic")
INTERPOLATIONS = ("linear", "cubic")


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
    """What the stage is asked to follow."""

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
    """How the position is measured."""

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
