"""First values of an axis's settings: those of a template, or estimates from a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from sgms_observer.application.axis_facts import AxisFacts
from sgms_observer.application.bag_info import MAX_UNEXPLAINED, uses_of
from sgms_observer.application.force_balance import ForceBalance
from sgms_observer.effects import catalogue
from sgms_observer.settings.units import REVOLUTE, Units

FRACTIONS = (0.067, 0.056, 0.047, 0.83)
"""Shares of the elements in the sliding force: Table I of Boegli et al."""
_DEFLECTIONS = (1.0 / 200.0, 1.0 / 50.0, 1.0 / 15.0, 1.0)
"""Slip deflections of the elements over the largest one: as Table I, 25 nm to 5 um."""
_LARGEST_DEFLECTION = 0.01
"""Largest slip deflection over the range of the motion: presliding is short."""
_MIN_DEFLECTION_STEPS = 2.0
"""Smallest number of encoder steps in the largest deflection; a shorter one is not measurable."""
_STATIC_OVER_COULOMB = 1.1
_STRIBECK_SHARE = 0.02  # of the peak speed
_ATTRACTION_PER_COULOMB = 12.5  # 1/s, as Table I
_CORRECTION_TIME = 2.0e-3  # s
_WINDOW, _WINDOW_SAMPLES = 3.0e-3, 8  # s, and samples at least
_MIN_GAP_SAMPLES = 5
_UNKNOWN_FRICTION = 0.1
"""Coulomb friction over the rms effort, where the recording does not show it."""


@dataclass(frozen=True)
class AxisDraft:
    """First values of one axis, in SI units.

    Attributes:
        name: the axis.
        joint_type: prismatic or revolute.
        position_scale: factor to m or rad.
        effort_scale: factor to N or N m.
        mass: [kg or kg m^2].
        coulomb: Coulomb force [N or N m].
        static: static force [N or N m].
        viscous: viscous coefficient [N s/m or N m s/rad].
        stribeck_velocity: [m/s or rad/s].
        largest_deflection: slip deflection of the softest element [m or rad].
        effects: name of the effect to its parameters.
        step: of the encoder [m or rad].
        noise: standard deviation of the position's noise [m or rad].
        speed: largest speed [m/s or rad/s].
        stroke: range of the motion [m or rad].
        effort: largest effort [N or N m].
        residual: effort that mass and friction leave unexplained, rms [N or N m].
        period: time between two samples [s].
        is_held: the effort acts until the next one.
        remarks: setting to the source of its value.
        warnings: sentences about values that the recording does not show.
    """

    name: str
    joint_type: str
    position_scale: float = 1.0
    effort_scale: float = 1.0
    mass: float = 10.0
    coulomb: float = 4.0
    static: float = 4.5
    viscous: float = 20.0
    stribeck_velocity: float = 1.0e-3
    largest_deflection: float = 5.0e-6
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    step: float = 1.0e-9
    noise: float = 5.0e-9
    speed: float = 6.0e-3
    stroke: float = 4.0e-4
    effort: float = 100.0
    residual: float = 0.1
    period: float = 1.0e-3
    is_held: bool = True
    remarks: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def element_stiffness(self) -> tuple[float, ...]:
        """Stiffness of each element [N/m or N m/rad]: its share of the static force over its slip deflection."""
        return tuple(
            share * self.static / (length * self.largest_deflection)
            for share, length in zip(FRACTIONS, _DEFLECTIONS, strict=True)
        )

    @property
    def attraction_rate(self) -> float:
        """Attraction parameter of the GMS model [N/s or N m/s]."""
        return _ATTRACTION_PER_COULOMB * self.coulomb

    @property
    def window(self) -> float:
        """Window of the filter [s]."""
        return max(_WINDOW, _WINDOW_SAMPLES * self.period)

    @property
    def correction_every(self) -> int:
        """Samples from one correction to the next."""
        return max(1, round(_CORRECTION_TIME / self.period))

    def pause(self, shortest: float) -> float:
        """Return a pause that is long compared with the sample period [s]."""
        return max(shortest, _MIN_GAP_SAMPLES * self.period)


def template_draft(name: str, joint_type: str) -> AxisDraft:
    """Return first values without a recording, of the axis of a table or the joint of a robot."""
    if joint_type != REVOLUTE:
        return AxisDraft(name, joint_type)
    return AxisDraft(
        name, joint_type, mass=1.0, coulomb=10.0, static=11.0, viscous=10.0, stribeck_velocity=1.0e-2,
        largest_deflection=1.0e-3, step=1.0e-6, noise=1.0e-6, speed=1.0, stroke=0.5, effort=200.0, residual=0.5,
    )  # fmt: skip


def recorded_draft(facts: AxisFacts, joint_type: str, position_scale: float, effort_scale: float) -> AxisDraft:
    """Return first values from a recording; a value that it does not show is a guess, with a warning.

    Args:
        facts: what the recording shows, in SI units.
        joint_type: prismatic or revolute.
        position_scale: factor from the bag's positions to SI units.
        effort_scale: factor from the bag's efforts to SI units.
    """
    template = template_draft(facts.name, joint_type)
    draft = replace(template, position_scale=position_scale, effort_scale=effort_scale)
    if facts.period > 0.0:
        draft = replace(draft, period=float(f"{facts.period:.6g}"))
    draft, has_motion = _with_motion(draft, facts)
    if not has_motion:
        warning = f"{facts.name}: the position never changes; everything but names and rates is the template's"
        return replace(draft, warnings=(warning,))
    balance = facts.balance
    if balance is None or balance.unexplained > MAX_UNEXPLAINED or balance.sign < 0:
        why = next((use.reason for use in uses_of(facts) if use.reason), "its motion does not separate them")
        warning = f"{facts.name}: mass and friction are not identifiable from this recording and are guesses: {why}"
        rms = facts.effort_rms
        if not np.isfinite(rms) or rms <= 0.0:
            return replace(draft, warnings=(warning,))
        guess = _UNKNOWN_FRICTION * rms
        coulomb, static, viscous = _friction(guess, facts)
        return replace(draft, coulomb=coulomb, static=static, viscous=viscous, residual=guess, warnings=(warning,))
    return _with_balance(draft, facts, balance)


def _with_motion(draft: AxisDraft, facts: AxisFacts) -> tuple[AxisDraft, bool]:
    """Return the draft with values from the positions, and whether they contain a motion."""
    if not facts.stroke > 0.0:
        return draft, False
    speed = facts.peak_speed if facts.peak_speed > 0.0 else facts.stroke
    remarks = {"speed": "from the bag"}
    if facts.encoder_step > 0.0:
        remarks["step"] = "from the bag"
    step = facts.encoder_step or 1.0e-6 * facts.stroke
    effort = max(map(abs, facts.effort_range))
    return (
        replace(
            draft,
            step=step,
            noise=max(step / math.sqrt(12.0), facts.position_noise),
            speed=speed,
            stroke=facts.stroke,
            stribeck_velocity=_STRIBECK_SHARE * speed,
            largest_deflection=max(_LARGEST_DEFLECTION * facts.stroke, _MIN_DEFLECTION_STEPS * step),
            effort=2.0 * effort if effort > 0.0 else draft.effort,
            remarks=remarks,
        ),
        True,
    )


def _friction(coulomb: float, facts: AxisFacts) -> tuple[float, float, float]:
    """Return Coulomb and static force, and a viscous coefficient with the same force at the peak speed."""
    speed = facts.peak_speed if facts.peak_speed > 0.0 else facts.stroke
    return coulomb, _STATIC_OVER_COULOMB * coulomb, coulomb / speed


def _with_balance(draft: AxisDraft, facts: AxisFacts, balance: ForceBalance) -> AxisDraft:
    """Return the draft with values from the force balance."""
    units = Units(draft.joint_type)
    remarks, warnings = dict(draft.remarks), []
    values: dict[str, float] = {}
    sources = (
        ("mass", "mass", units.mass),
        ("coulomb", "coulomb_force", units.effort),
        ("viscous", "viscous_coefficient", units.damping),
    )
    for key, name, unit in sources:
        value, error = balance.value(name), balance.std_error(name)
        if value > 0.0 and balance.is_significant(name):
            values[key] = value
            remarks[key] = f"from the bag: +- {error:.2g} {unit}"
            continue
        remarks[key] = "a guess: not identifiable from this recording"
        warnings.append(
            f"{facts.name}: the recording does not show {name} ({value:.3g} +- {error:.2g} {unit}); the file holds a"
            " guess"
        )
    guess = max(_UNKNOWN_FRICTION * facts.effort_rms, 1e-9)
    coulomb, static, _ = _friction(values.get("coulomb", guess), facts)
    effects: dict[str, dict[str, float]] = {}
    sine, cosine = balance.value("gravity_sin"), balance.value("gravity_cos")
    if balance.is_significant("gravity_sin") or balance.is_significant("gravity_cos"):
        effects["gravity"] = {"amplitude": math.hypot(sine, cosine), "angle": math.atan2(cosine, sine)}
    if balance.is_significant("offset"):
        effects["offset"] = {"force": balance.value("offset")}
    for name in [name for name, given in effects.items() if not _is_possible(name, given)]:
        del effects[name]
        warnings.append(f"{facts.name}: {name} is left out, for it is larger than the catalogue of effects allows")
    return replace(
        draft,
        mass=values.get("mass", draft.mass),
        coulomb=coulomb,
        static=static,
        viscous=values.get("viscous", 0.0),
        effects=effects,
        residual=max(balance.residual, 1e-9),
        remarks=remarks,
        warnings=tuple(warnings),
    )


def _is_possible(name: str, values: Mapping[str, float]) -> bool:
    """Return whether the catalogue allows an effect's values."""
    allowed = {parameter.name: parameter for parameter in catalogue.effect(name).parameters}
    return all(allowed[key].minimum <= value <= allowed[key].maximum for key, value in values.items())
