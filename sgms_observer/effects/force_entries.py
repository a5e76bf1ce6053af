"""Catalogue entries of the added forces and of the moving masses."""

from __future__ import annotations

import math

from sgms_observer.effects.effect import Effect, EffectParameter, Place
from sgms_observer.formulas import effects as formula

_PHASE = EffectParameter("phase", "rad", 0.0, -2.0 * math.pi, 2.0 * math.pi, "angle at position (or time) zero")

FORCE_EFFECTS = (
    Effect(
        "cogging",
        Place.ADDED_FORCE,
        (
            EffectParameter("amplitude", "N", 0.0, -1.0e4, 1.0e4, "amplitude of the first harmonic", is_strength=True),
            EffectParameter(
                "pitch",
                "m",
                0.01,
                1.0e-6,
                10.0,
                "period in position, for instance the magnet or screw pitch",
                acts_on="position",
            ),
            _PHASE,
            EffectParameter(
                "second_amplitude", "N", 0.0, -1.0e4, 1.0e4, "amplitude of the second harmonic", is_strength=True
            ),
            EffectParameter("second_phase", "rad", 0.0, -2.0 * math.pi, 2.0 * math.pi, "angle of the second harmonic"),
        ),
        "F = A sin(2 pi q / pitch + phase) + A2 sin(4 pi q / pitch + phase2)",
        "periodic over position, the same in both directions",
        "slow travel over several pitches, both ways",
        ("position_periodic_friction", "spring", "gravity", "periodic_disturbance"),
        "Otten et al. 1997, Linear motor motion control using a learning feedforward controller, T. Mechatronics 2(3)",
        formula.cogging,
        coordinates=("position",),
        question="Is there a {pitch} pitch?",
    ),
    Effect(
        "spring",
        Place.ADDED_FORCE,
        (
            EffectParameter("stiffness", "N/m", 0.0, -1.0e7, 1.0e7, "force per displacement", is_strength=True),
            EffectParameter("rest_position", "m", 0.0, -100.0, 100.0, "position without force", acts_on="position"),
        ),
        "F = k (q - q0)",
        "a slope over position, the same in both directions",
        "travel over the whole stroke, both ways",
        ("position_dependent_friction", "offset", "gravity", "cogging"),
        "Tjahjowidodo et al. 2006, for cable chains; any text on servo axes",
        formula.spring,
        coordinates=("position",),
        question="Is there a spring of {stiffness}?",
    ),
    Effect(
        "offset",
        Place.ADDED_FORCE,
        (
            EffectParameter(
                "force", "N", 0.0, -1.0e4, 1.0e4, "constant force the actuator has to supply", is_strength=True
            ),
        ),
        "F = F0",
        "the same force everywhere and in both directions, at rest as well",
        "motion both ways with rests",
        ("asymmetric_coulomb", "gravity"),
        "Janot, Gautier, Brunot 2019, EMPS benchmark (offset of the amplifier)",
        formula.offset,
        question="Is there a constant force of {force}?",
    ),
    Effect(
        "gravity",
        Place.ADDED_FORCE,
        (
            EffectParameter(
                "amplitude",
                "N",
                0.0,
                -1.0e5,
                1.0e5,
                "weight of the moving mass; on a revolute joint weight times distance of its centre [N m]",
                is_strength=True,
            ),
            EffectParameter(
                "angle",
                "rad",
                0.5 * math.pi,
                -2.0 * math.pi,
                2.0 * math.pi,
                "revolute: angle of the centre of mass at position zero, from hanging down;"
                " prismatic: slope of the axis, pi/2 is vertical",
            ),
            EffectParameter(
                "ratio",
                "-",
                1.0,
                -1.0e3,
                1.0e3,
                "angle of the centre of mass per position: 1 on a revolute joint, 1 over the gear ratio for a position"
                " of the motor",
                prismatic_default=0.0,
            ),
        ),
        "F = A sin(ratio q + angle)",
        "one sine per turn of a revolute joint, the same in both directions; a constant on a prismatic axis",
        "travel over a wide angle, both ways",
        ("offset", "spring", "cogging"),
        "Craig 2005, Introduction to Robotics, 3rd ed., section 6.7 (gravity terms)",
        formula.gravity,
        coordinates=("position",),
        question="Does a weight act on the axis, {amplitude} at most?",
        special_case_of="cogging",
    ),
    Effect(
        "asymmetric_viscous",
        Place.ADDED_FORCE,
        (
            EffectParameter(
                "coefficient",
                "N s/m",
                0.0,
                -1.0e4,
                1.0e4,
                "half the difference of the viscous coefficients; at most the viscous coefficient itself",
                is_strength=True,
            ),
        ),
        "F = c |v|",
        "even in velocity, rising with the speed",
        "several speeds, both ways",
        ("asymmetric_coulomb", "offset"),
        "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7)",
        formula.asymmetric_viscous,
        coordinates=("velocity",),
        question="Does viscous friction differ by direction?",
    ),
    Effect(
        "nonlinear_viscous",
        Place.ADDED_FORCE,
        (
            EffectParameter("force", "N", 0.0, -1.0e4, 1.0e4, "force at the reference velocity", is_strength=True),
            EffectParameter("exponent", "-", 0.5, 0.1, 4.0, "power of the speed; below 1 for shear-thinning"),
            EffectParameter(
                "reference_velocity", "m/s", 0.1, 1.0e-5, 100.0, "speed the force is given at", acts_on="velocity"
            ),
        ),
        "F = F_r sgn(v) |v / v_r|^n",
        "odd in velocity, curved",
        "speeds over a decade",
        ("quadratic_drag", "eddy_current", "stribeck"),
        "Waiboer, Aarts, Jonker 2005 (shear-thinning grease); Bair 2007, High Pressure Rheology",
        formula.nonlinear_viscous,
        coordinates=("velocity",),
        is_contact_law=True,
        question="Is viscous friction curved over velocity?",
    ),
    Effect(
        "quadratic_drag",
        Place.ADDED_FORCE,
        (
            EffectParameter(
                "coefficient", "N s^2/m^2", 0.0, -1.0e5, 1.0e5, "drag over the square of the speed", is_strength=True
            ),
        ),
        "F = c v |v|",
        "odd in velocity, growing with its square",
        "speeds over a decade, with the highest the axis reaches",
        ("nonlinear_viscous", "eddy_current"),
        "Hoerner 1965, Fluid-Dynamic Drag",
        formula.quadratic_drag,
        coordinates=("velocity",),
        question="Does a drag grow with the square of the velocity?",
        special_case_of="nonlinear_viscous",
    ),
    Effect(
        "eddy_current",
        Place.ADDED_FORCE,
        (
            EffectParameter("peak_force", "N", 0.0, 0.0, 1.0e4, "largest drag", is_strength=True),
            EffectParameter(
                "peak_velocity", "m/s", 1.0, 1.0e-4, 1.0e3, "speed of the largest drag", acts_on="velocity"
            ),
            EffectParameter("breadth", "-", 0.0, -1.5, 10.0, "broader peak above 0, sharper below"),
        ),
        "F = F_p (2 + b) r / (1 + b |r| + r^2), r = v / v_p",
        "odd in velocity, viscous at low speed, falling again beyond its peak",
        "speeds on both sides of the peak",
        ("nonlinear_viscous", "quadratic_drag", "stribeck"),
        "Kloss 1929; Wouterse 1991, Critical torque and speed of eddy current brake, IEE Proc. B 138(4)",
        formula.eddy_current,
        coordinates=("velocity",),
        is_contact_law=True,
        question="Is there an eddy-current brake, strongest at {peak_velocity}?",
    ),
    Effect(
        "periodic_disturbance",
        Place.ADDED_FORCE,
        (
            EffectParameter("amplitude", "N", 0.0, -1.0e4, 1.0e4, "amplitude", is_strength=True),
            EffectParameter("frequency", "Hz", 50.0, 1.0e-3, 5.0e3, "frequency in time", acts_on="rate"),
            _PHASE,
        ),
        "F = A sin(2 pi f t + phase)",
        "periodic in time, independent of the motion",
        "any motion, longer than several periods, at more than one speed",
        ("cogging",),
        "Bodson, Douglas 1997, Adaptive algorithms for the rejection of sinusoidal disturbances, Automatica 33(12)",
        formula.periodic_disturbance,
        question="Is there a disturbance of {frequency}?",
    ),
    Effect(
        "cross_axis_coupling",
        Place.ADDED_FORCE,
        (
            EffectParameter(
                "inertia", "kg", 0.0, -1.0e4, 1.0e4, "force per acceleration of the other axis", is_strength=True
            ),
            EffectParameter(
                "viscous", "N s/m", 0.0, -1.0e4, 1.0e4, "force per velocity of the other axis", is_strength=True
            ),
        ),
        "F = m12 a2 + d12 v2",
        "follows the motion of another axis",
        "the other axis moving, also while this one rests",
        ("periodic_disturbance",),
        "Altintas et al. 2011, Machine tool feed drives, CIRP Annals 60(2)",
        formula.cross_axis_coupling,
        question="Does the other axis move this one?",
    ),
    Effect(
        "presliding",
        Place.ADDED_FORCE,
        (
            EffectParameter("force", "N", 0.0, -1.0e4, 1.0e4, "sliding force of what is missing", is_strength=True),
            EffectParameter(
                "distance", "m", 1.0e-5, 1.0e-9, 1.0, "mean distance over which it builds up", acts_on="position"
            ),
        ),
        "F = F_e (z1 + z2) / 2, z_i in -1..1 follows x / d_i, d_1 = d / 2, d_2 = 3 d / 2",
        "hysteresis after each reversal, over a distance the model's elements do not cover",
        "many reversals, small and large strokes",
        ("backlash", "dwell_breakaway"),
        "Iwan 1966; Al-Bender, Lampaert, Swevers 2005 (GMS, distribution of stiffness)",
        formula.presliding,
        formula.presliding_next,
        (0.0, 0.0),
        coordinates=("distance since reversal", "direction"),
        is_contact_law=True,
        question="Is there presliding over {distance}?",
    ),
    Effect(
        "backlash",
        Place.ADDED_FORCE,
        (
            EffectParameter("gap", "m", 1.0e-5, 1.0e-9, 1.0, "play between motor and load", acts_on="position"),
            EffectParameter("share", "-", 0.0, 0.0, 0.9, "share of the friction that is the load's", is_strength=True),
            EffectParameter(
                "stop",
                "m",
                1.0e-6,
                1.0e-9,
                1.0e-3,
                "by how much a wall gives before the load slides",
                acts_on="position",
                may_end=True,
            ),
        ),
        "F = A / (1 - A) s(v) d(x), x = stretch, d = 0 in the play, +-1 where a wall has given by its stop",
        "too little friction over a fixed distance after each reversal, independent of the rest before",
        "many reversals, an encoder on motor and load",
        ("presliding", "dwell_breakaway"),
        "Nordin, Gutman 2002, Controlling mechanical systems with backlash, Automatica 38(10)",
        formula.backlash,
        formula.backlash_next,
        (0.0,),
        coordinates=("distance since reversal", "direction"),
        is_contact_law=True,
        question="Is there backlash of {gap}?",
    ),
    Effect(
        "mass_error",
        Place.PLANT,
        (EffectParameter("mass", "kg", 0.0, -1.0e4, 1.0e4, "mass the model does not have", is_strength=True),),
        "F = dm a",
        "follows the acceleration",
        "accelerations well above friction; a known added mass separates it from an actuator gain",
        ("actuator_gain", "actuator_delay", "flexible_mode"),
        "Janot, Gautier, Brunot 2019, EMPS benchmark",
        formula.mass_error,
        added_mass=1.0,
        coordinates=("acceleration",),
        question="Does the moving mass differ from the file by {mass}?",
    ),
    Effect(
        "flexible_mode",
        Place.PLANT,
        (
            EffectParameter(
                "mass", "kg", 0.0, 0.0, 1.0e4, "share of the moving mass behind the spring", is_strength=True
            ),
            EffectParameter(
                "frequency", "Hz", 50.0, 0.1, 5.0e3, "frequency of that mass with the carriage held", acts_on="rate"
            ),
            EffectParameter("damping_ratio", "-", 0.02, 1.0e-4, 0.99, "its damping"),
        ),
        "F = m2 x'', x'' = -a - 2 zeta omega x' - omega^2 x",
        "ringing after jerks, a force along the acceleration's high frequencies",
        "a chirp or hard jerks up to the mode's frequency",
        ("mass_error", "actuator_delay"),
        "Rankers 1997, Machine dynamics in mechatronic systems, PhD thesis, Twente",
        formula.flexible_mode,
        formula.flexible_mode_next,
        (0.0, 0.0),
        added_mass=-1.0,
        coordinates=("acceleration",),
        question="Is there a resonance at {frequency}?",
    ),
)
