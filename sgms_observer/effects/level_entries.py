"""Catalogue entries of the factors on the Stribeck level."""

from __future__ import annotations

import math

from sgms_observer.effects.effect import Effect, EffectParameter, Place
from sgms_observer.formulas import effects as formula


def _share(description: str, minimum: float = -0.95, maximum: float = 3.0) -> EffectParameter:
    """Declare a strength given as a share of the friction level."""
    return EffectParameter("share", "-", 0.0, minimum, maximum, description, is_strength=True)


LEVEL_EFFECTS = (
    Effect(
        "position_periodic_friction",
        Place.LEVEL_FACTOR,
        (
            _share("amplitude as a share of the level", -0.95, 0.95),
            EffectParameter(
                "pitch",
                "m",
                0.01,
                1.0e-6,
                10.0,
                "period in position, for instance of the balls or the screw",
                acts_on="position",
            ),
            EffectParameter("phase", "rad", 0.0, -2.0 * math.pi, 2.0 * math.pi, "angle at position zero"),
        ),
        "s -> s (1 + A sin(2 pi q / pitch + phase))",
        "periodic over position, flipping its sign with the direction",
        "slow travel over several pitches, both ways",
        ("cogging",),
        "Popovic, Goldenberg 1998, Modeling of friction using spectral analysis, IEEE T. Robotics and Automation 14(1)",
        formula.position_periodic_friction,
        coordinates=("position", "direction"),
        question="Is there friction with a {pitch} pitch?",
    ),
    Effect(
        "position_dependent_friction",
        Place.LEVEL_FACTOR,
        (
            _share("rise at the tightest place"),
            EffectParameter("center", "m", 0.0, -100.0, 100.0, "the tightest place", acts_on="position"),
            EffectParameter(
                "width",
                "m",
                0.01,
                1.0e-6,
                100.0,
                "half width of the tight spot (one standard deviation)",
                acts_on="position",
            ),
        ),
        "s -> s (1 + A exp(-((q - q0) / w)^2 / 2))",
        "more friction at one place, flipping its sign with the direction",
        "travel over the whole stroke, both ways",
        ("spring", "position_periodic_friction"),
        "Huo, Poo 2013 (feed drives, friction over the stroke); Armstrong-Helouvry 1991",
        formula.position_dependent_friction,
        coordinates=("position", "direction"),
        question="Is friction different around {center}?",
    ),
    Effect(
        "asymmetric_coulomb",
        Place.LEVEL_FACTOR,
        (_share("half the difference of the two directions over their mean", -0.95, 0.95),),
        "s -> s (1 + A sgn(v))",
        "a constant force while sliding, nothing at rest",
        "motion both ways around the Stribeck velocity: at a constant sliding force it is an offset",
        ("offset", "asymmetric_viscous"),
        "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7)",
        formula.asymmetric_coulomb,
        coordinates=("direction",),
        question="Does sliding friction differ by direction?",
    ),
    Effect(
        "stribeck",
        Place.LEVEL_FACTOR,
        (
            _share("rise toward zero speed"),
            EffectParameter("velocity", "m/s", 0.01, 1.0e-6, 10.0, "speed over which it fades", acts_on="velocity"),
        ),
        "s -> s (1 + A exp(-(v / v1)^2))",
        "more (or less) friction at low speed than the model's Stribeck curve",
        "constant speeds over two decades around the Stribeck velocity",
        ("dwell_breakaway", "nonlinear_viscous", "frictional_lag"),
        "Stribeck 1902; Bo, Pavelescu 1982, Wear 82(3)",
        formula.stribeck,
        coordinates=("velocity",),
        is_contact_law=True,
        question="Does friction differ from the file at velocities around {velocity}?",
    ),
    Effect(
        "load_dependent_friction",
        Place.LEVEL_FACTOR,
        (
            EffectParameter(
                "coefficient", "s^2/m", 0.0, -1.0, 10.0, "share of the level per acceleration", is_strength=True
            ),
        ),
        "s -> s (1 + c |a|)",
        "more friction while accelerating, in the direction of motion",
        "several accelerations at equal speed, both ways",
        ("mass_error", "nonlinear_viscous"),
        "Waiboer, Aarts, Jonker 2005; Hamon et al. 2010 (load-dependent friction), IEEE/RSJ IROS",
        formula.load_dependent_friction,
        coordinates=("acceleration", "direction"),
        is_contact_law=True,
        question="Does friction grow with the acceleration?",
    ),
    Effect(
        "thermal_drift",
        Place.LEVEL_FACTOR,
        (
            _share("level when warm over level at the start, minus 1"),
            EffectParameter("time_constant", "s", 600.0, 0.1, 1.0e6, "time constant of the warm-up", acts_on="time"),
            EffectParameter(
                "motion_share",
                "-",
                0.0,
                0.0,
                1.0,
                "share of the heat that sliding brings; 0: warms by the clock",
                may_end=True,
            ),
            EffectParameter(
                "reference_velocity",
                "m/s",
                0.1,
                1.0e-5,
                100.0,
                "mean speed at which that share warms in full",
                acts_on="velocity",
            ),
        ),
        "s -> s (1 + A x), dx/dt = (1 - m + m |v| / v_r - x) / tau",
        "friction that falls (or rises) over the recording's time",
        "the same motion repeated for longer than the time constant, from cold",
        ("wear_step",),
        "Simoni et al. 2015, Friction modeling with temperature effects for industrial robot manipulators, IROS",
        formula.thermal_drift,
        formula.thermal_drift_next,
        (0.0,),
        coordinates=("time", "direction"),
        question="Does friction drift over some {time_constant}?",
    ),
    Effect(
        "wear_step",
        Place.LEVEL_FACTOR,
        (
            _share("change of the level"),
            EffectParameter(
                "travel", "m", 1.0, 0.0, 1.0e7, "travelled distance at the middle of the change", acts_on="travel"
            ),
            EffectParameter(
                "width", "m", 0.01, 1.0e-6, 1.0e7, "travelled distance over which it happens", acts_on="travel"
            ),
        ),
        "s -> s (1 + A (1 + tanh((S - S0) / w)) / 2), S = int |v| dt",
        "a step or slope of the friction over the travelled distance",
        "the same motion before and after",
        ("thermal_drift",),
        "Archard 1953, Contact and rubbing of flat surfaces, J. Applied Physics 24(8)",
        formula.wear_step,
        formula.wear_step_next,
        (0.0,),
        coordinates=("time", "direction"),
        question="Does friction change after a travel of {travel}?",
    ),
    Effect(
        "dwell_breakaway",
        Place.LEVEL_FACTOR,
        (
            _share("rise of the static friction after a long rest", minimum=0.0),
            EffectParameter("dwell_time", "s", 1.0, 1.0e-3, 1.0e5, "time constant of its rise at rest", acts_on="time"),
            EffectParameter(
                "memory_distance", "m", 1.0e-4, 1.0e-8, 1.0, "travel over which it is forgotten", acts_on="position"
            ),
            EffectParameter(
                "rest_velocity", "m/s", 1.0e-4, 1.0e-9, 1.0, "speed below which the contact rests", acts_on="velocity"
            ),
        ),
        "s -> s (1 + A x), dx/dt = exp(-(v / v_0)^2) (1 - x) / tau - |v| x / d",
        "a peak at break-away that grows with the rest before it",
        "rests of several lengths before equal motions",
        ("stribeck", "presliding"),
        "Rabinowicz 1958; Dieterich 1979; Armstrong-Helouvry 1991",
        formula.dwell_breakaway,
        formula.dwell_breakaway_next,
        (0.0,),
        coordinates=("dwell", "distance since reversal", "direction"),
        question="Does break-away grow with rests of about {dwell_time}?",
    ),
    Effect(
        "frictional_lag",
        Place.LEVEL_FACTOR,
        (
            EffectParameter(
                "attraction_rate",
                "N/s",
                1.0e6,
                1.0e-2,
                1.0e9,
                "rate C at which the sliding force follows the Stribeck curve; infinite for none",
                is_strength=True,
                may_end=True,
                vanishes_at_infinity=True,
            ),
            EffectParameter(
                "distance",
                "m",
                1.0e-5,
                1.0e-9,
                1.0,
                "travel after a reversal over which the contact still sticks",
                acts_on="position",
                may_end=True,
            ),
        ),
        "s -> L, dL/dt = C (1 - L / s) while sliding",
        "friction that lags changes of speed: a loop over velocity while sliding",
        "speed changes near the Stribeck velocity, fast and slow",
        ("stribeck", "dwell_breakaway"),
        "Hess, Soom 1990; Boegli et al., eq. 2 (attraction parameter C)",
        formula.frictional_lag,
        formula.frictional_lag_next,
        (0.0, 0.0, 0.0),
        coordinates=("velocity", "acceleration"),
        is_contact_law=True,
        question="Does friction lag behind changes of speed?",
    ),
)
