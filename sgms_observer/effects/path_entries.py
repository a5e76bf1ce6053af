"""Catalogue entries of the effort's path and of the measured position."""

from __future__ import annotations

from sgms_observer.effects.effect import Effect, EffectParameter, Place
from sgms_observer.effects.parameters import length, phase, strength
from sgms_observer.formulas import effects as formula

PATH_EFFECTS = (
    Effect(
        "actuator_gain",
        Place.EFFORT_PATH,
        (EffectParameter("gain", "-", 1.0, 0.1, 10.0, "effort that arrives over effort published", is_strength=True),),
        "u -> g u",
        "scales everything: invisible without a known force or mass",
        "a known added mass or a known force",
        ("mass_error",),
        "Gautier, Briot 2014, Global identification of joint drive gains, J. Dynamic Systems 136(5)",
        formula.actuator_gain,
        inverse=formula.actuator_gain_command,
        question="Is the actuator's gain {gain}?",
    ),
    Effect(
        "actuator_saturation",
        Place.EFFORT_PATH,
        (
            EffectParameter(
                "limit", "N", 1.0e6, 1.0e-6, 1.0e9, "largest effort that arrives", is_strength=True, acts_on="effort"
            ),
        ),
        "u -> min(max(u, -L), L)",
        "residual only at the largest efforts",
        "efforts up to the actuator's limit",
        ("actuator_gain",),
        "Astrom, Hagglund 2006, Advanced PID Control",
        formula.actuator_saturation,
        inverse=formula.actuator_saturation_command,
        question="Does the effort saturate at {limit}?",
    ),
    Effect(
        "actuator_dead_zone",
        Place.EFFORT_PATH,
        (strength("width", "N", "effort that is lost around zero", 0.0, 1.0e6, acts_on="effort"),),
        "u -> u - min(max(u, -d), d)",
        "a constant loss with the sign of the effort, not of the velocity",
        "braking phases, where effort and velocity differ in sign; rests",
        ("stribeck", "presliding"),
        "Tao, Kokotovic 1994, Adaptive control of plants with unknown dead-zones, IEEE T. Automatic Control 39(1)",
        formula.actuator_dead_zone,
        inverse=formula.actuator_dead_zone_command,
        coordinates=("velocity", "effort"),
        question="Is there a dead zone of {width}?",
    ),
    Effect(
        "actuator_delay",
        Place.EFFORT_PATH,
        (strength("delay", "s", "time from the published effort to the force", 0.0, 0.02, acts_on="time"),),
        "u(t) -> u(t - d)",
        "follows the effort's rate of change",
        "a chirp or hard jerks",
        ("mass_error", "flexible_mode"),
        "Janot, Gautier, Brunot 2019, EMPS benchmark (command delay)",
        formula.actuator_delay,
        is_delay=True,
        coordinates=("acceleration",),
        question="Does the effort arrive {delay} late?",
    ),
    Effect(
        "encoder_interpolation_error",
        Place.MEASURED_POSITION,
        (
            strength("amplitude", "m", "amplitude", -1.0e-3, 1.0e-3),
            length("pitch", 2.0e-5, 1.0e-8, 1.0, "signal period of the encoder"),
            phase("angle at position zero"),
        ),
        "q -> q + A sin(2 pi q / pitch + phase)",
        "ripple over position whose force grows with the square of the speed",
        "several constant speeds",
        ("cogging", "quantisation"),
        "Heydemann 1981, Determination and correction of quadrature fringe measurement errors, Applied Optics 20(19)",
        formula.encoder_interpolation_error,
        inverse=formula.encoder_interpolation_correction,
        question="Is there an encoder error with a {pitch} pitch?",
    ),
    Effect(
        "quantisation",
        Place.MEASURED_POSITION,
        (
            EffectParameter(
                "resolution",
                "m",
                1.0e-12,
                1.0e-12,
                1.0e-1,
                "step of the measured position",
                is_strength=True,
                acts_on="position",
            ),
        ),
        "q -> r floor(q / r + 1/2)",
        "the measured positions lie on a grid",
        "any; the grid is read off the position itself",
        ("encoder_interpolation_error",),
        "Widrow, Kollar 2008, Quantization Noise",
        formula.quantisation,
        question="Do the positions lie on a grid of {resolution}?",
    ),
)
