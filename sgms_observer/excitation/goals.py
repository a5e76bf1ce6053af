"""The goals of a design: Fisher information of each segment about the asked quantities."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import stats

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.excitation.design import Goal
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.question import WEAK, Question, over_time, shapes
from sgms_observer.excitation.segments import Place, Segment
from sgms_observer.excitation.sensitivity import SIZE, Parameters, Sensitivity, contacts
from sgms_observer.formulas.friction import stribeck_level
from sgms_observer.jit import njit
from sgms_observer.settings.axis import AxisSettings, EffectSettings, FrictionSettings

_STEP = 0.15  # of an integration step times the largest natural frequency: symplectic Euler is stable below 2
_MOST_STEPS = 200  # in one sample

_stribeck_level: Callable[..., float] = njit(stribeck_level)

POWER = 0.9
"""Share of such recordings in which an effect is detected, or separated from another one (power)."""
MIN_Z_SCORE = 3.0 + float(stats.norm.ppf(POWER))
"""Smallest expected z-score; with that of the diagnosis only half of the recordings would reach it."""
MIN_INFORMATION = (2.0 * MIN_Z_SCORE) ** 2
"""Information for this z-score: the squared residuals of two models differ by d^2 with a standard error of 2 d, see
``diagnosis.evidence.improvement``."""
_GRID = (np.arange(200) + 0.5) / 200  # times at which effects over time are averaged, as shares of the whole


@njit
def _follow(
    reference: Floats, velocity: Floats, period: float, steps: int, gains: Floats, kappa: Floats, share: Floats,
    curve: Floats, out: Floats,
) -> None:  # fmt: skip
    """Write the position at each sample; ``gains``: mass, position, velocity, acceleration, viscous."""
    n_z = kappa.shape[0]
    force = np.zeros(n_z)
    mass, stiff, damp, ahead, viscous = gains[0], gains[1], gains[2], gains[3], gains[4]
    static, coulomb, v_s = curve[0], curve[1], curve[2]
    step = period / steps
    place, speed = reference[0], 0.0
    out[0] = place
    for k in range(1, reference.shape[0]):
        change = (velocity[k] - velocity[k - 1]) / period
        for j in range(steps):
            time = (j + 0.5) * step
            aim_speed = velocity[k - 1] + change * time
            aim = reference[k - 1] + (velocity[k - 1] + 0.5 * change * time) * time
            total = 0.0
            for i in range(n_z):
                total += force[i]
            effort = stiff * (aim - place) + damp * (aim_speed - speed) + ahead * change
            speed += step * (effort - total - viscous * speed) / mass
            place += step * speed
            level = _stribeck_level(speed, static, coulomb, v_s)
            for i in range(n_z):
                limit = share[i] * level
                force[i] = min(max(force[i] + kappa[i] * step * speed, -limit), limit)
        out[k] = place


def followed(reference: Floats, period: float, axis: AxisSettings, friction: FrictionSettings) -> Floats:
    """Return the position of a table that follows a reference.

    Args:
        reference: set-point [m], shape (n,).
        period: time between two samples [s].
        axis: mass, viscous friction, and the controller of ``stage``.
        friction: of the table.
    """
    controller, mass = axis.stage.controller, axis.mass
    omega = 2.0 * math.pi * controller.bandwidth
    kappa = np.array(friction.element_stiffness)
    gains = np.array([
        mass, mass * omega**2, 2.0 * controller.damping_ratio * omega * mass, controller.feedforward_mass * mass,
        friction.viscous_coefficient,
    ])  # fmt: skip
    fastest = math.sqrt(omega**2 + float(kappa.sum()) / mass)
    steps = min(_MOST_STEPS, max(1, math.ceil(period * fastest / _STEP)))
    curve = np.array([friction.static_force, friction.coulomb_force, friction.stribeck_velocity])
    out = np.empty(len(reference))
    velocity: Floats = np.gradient(reference, period)
    _follow(
        np.ascontiguousarray(reference), velocity, period, steps, gains, kappa, np.array(friction.element_fraction),
        curve, out,
    )  # fmt: skip
    return out


@dataclass(frozen=True)
class Goals:
    """What a design maximises.

    Attributes:
        goals: the goals.
        hidden: effects that are not detectable within the limits.
        inseparable: detectable effects that no reference within the limits separates from similar effects.
    """

    goals: tuple[Goal, ...]
    hidden: tuple[str, ...]
    inseparable: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Pieces:
    """The segments one after the other."""

    position: Floats
    starts: Floats
    period: float

    def products(self, model: Sensitivity, columns: Floats, others: Floats) -> Floats:
        """Return the products of columns with others over each segment, shape (segments, p, k)."""
        edges = -(-self.starts.astype(int) // model.stride)
        return np.array([columns[a:b].T @ others[a:b] for a, b in pairwise(edges.tolist())], dtype=np.float64)


def goals_of(
    question: Question,
    axis: AxisSettings,
    limits: ExcitationLimits,
    place: Place,
    segments: Sequence[tuple[Segment, Floats]],
    period: float,
    seconds: float,
    report: Callable[[float], None],
) -> Goals:
    """Return the goals of a question.

    Args:
        question: the asked parameters and effects.
        axis: settings.
        limits: stroke, speed and acceleration that the table may use.
        place: window and home of the motion.
        segments: with their velocities.
        period: time between two samples of these [s].
        seconds: time of the whole reference [s].
        report: called with the completed share.
    """
    loading = segments[0][1]  # after it the contact has the state that it has between any two segments
    velocity = np.concatenate([loading, *(values for _segment, values in segments)])
    starts = len(loading) + np.concatenate(([0], np.cumsum([len(values) for _segment, values in segments])))
    pieces = _Pieces(place.home + np.cumsum(velocity) * period, starts, period)
    believed = contacts(axis.friction, limits.smallest)
    goals: list[Goal] = []
    hidden: tuple[str, ...] = ()
    inseparable: tuple[str, ...] = ()
    wanted = believed if question.parameters else believed[:1]
    for number, contact in enumerate(wanted):
        report(number / len(wanted))
        position = pieces.position
        if not contact.is_from_file:
            position = followed(position, period, axis, contact.friction)
        model = Sensitivity(axis, contact, position, period)
        found = model.parameters()
        listed_owners, listed = model.slopes_of_listed()
        if question.parameters:
            goals.append(_parameter_goal(pieces, model, found, listed, 1.0 / len(believed)))
        if contact.is_from_file and question.effects:
            durations = np.diff(starts) * period
            goal, hidden, inseparable = _effect_goal(
                question, axis, limits, place, pieces, model, found, listed_owners, listed, durations, seconds
            )
            if goal is not None:
                goals.append(goal)
    return Goals(tuple(goals), hidden, inseparable)


def _parameter_goal(pieces: _Pieces, model: Sensitivity, found: Parameters, listed: Floats, share: float) -> Goal:
    """Return the goal of narrow relative intervals of all parameters."""
    columns = np.column_stack([found.columns, listed])
    names = tuple(found.asked)
    is_element = np.array([name.startswith("element_") for name in names])
    weight = np.where(is_element, np.sum(~is_element) / np.sum(is_element), 1.0)
    wanted = np.zeros((len(names), columns.shape[1]))
    wanted[:, : len(found.names)] = np.array(list(found.asked.values()))
    prior = np.diag([1.0] * len(found.names) + [SIZE**2] * listed.shape[1])
    rivals = np.ones(wanted.shape, dtype=bool)
    information, bias = (pieces.products(model, columns, others) for others in (columns, model.errors()))
    return Goal(names, information, bias, prior, wanted, rivals, weight, False, share)


def _effect_goal(
    question: Question, axis: AxisSettings, limits: ExcitationLimits, place: Place, pieces: _Pieces,
    model: Sensitivity, found: Parameters, listed_owners: Sequence[str], listed: Floats, durations: Floats,
    seconds: float,
) -> tuple[Goal | None, tuple[str, ...], tuple[str, ...]]:  # fmt: skip
    """Return the goal that every effect is separated from parameters and similar effects, and the effects for which
    that is impossible: hidden by the parameters, and hidden by similar effects only."""
    wanted_names = list(dict.fromkeys([*question.effects, *(r for name in question.effects for r in
                                                            question.rivals(name))]))  # fmt: skip
    strength = _strength(question, axis, model)
    owners: list[str] = []
    columns: list[Floats] = []
    growth = [np.ones(len(_GRID))] * (len(found.names) + listed.shape[1])
    for name in wanted_names:
        for settings in shapes(name, axis, place, limits, model.band, seconds, strength or WEAK):
            column = model.level_column() if over_time(name) else model.effect_column(settings)
            rows = model.unit_rows(column, strength or SIZE)
            if not np.any(rows):
                continue
            owners.append(name)
            columns.append(rows)
            growth.append(_growth(settings, seconds) if over_time(name) else np.ones(len(_GRID)))
    first = len(found.names) + listed.shape[1]
    if not columns:
        return None, tuple(question.effects), ()
    stacked = np.column_stack([found.columns, listed, *columns])
    information, bias = (pieces.products(model, stacked, others) for others in (stacked, model.errors()))
    over = np.array(growth)
    bias = bias * np.mean(over, axis=1)[:, None]
    information = information * (over @ over.T / len(_GRID))  # copies of a segment are at any time
    size = information.shape[1]
    prior = np.diag([1.0] * len(found.names) + [SIZE**2] * listed.shape[1] + [(strength or SIZE) ** 2] * len(columns))
    numbers = [k for k, owner in enumerate(owners) if owner in question.effects]
    masks = np.zeros((2, len(numbers), size), dtype=bool)
    for row, k in enumerate(numbers):
        masks[:, row, :first] = True
        masks[:, row, first + k] = True
        for name, effect_name in (("offset", "offset"), ("delay", "actuator_delay")):
            if owners[k] == effect_name:
                masks[:, row, found.names.index(name)] = False
        own_columns = [len(found.names) + j for j, owner in enumerate(listed_owners) if owner == owners[k]]
        masks[:, row, own_columns] = False  # the columns of an effect of the file are separate
        rivals = [first + j for j, owner in enumerate(owners) if owner in question.rivals(owners[k])]
        masks[0, row, rivals] = True
    names = tuple(owners[k] for k in numbers)
    wanted = np.zeros((len(numbers), size))
    wanted[np.arange(len(numbers)), [first + k for k in numbers]] = 1.0
    per_effect = np.array([1.0 / names.count(name) for name in names])

    def goal(mask: Booleans, keep: Ints) -> Goal:
        return Goal(
            tuple(names[k] for k in keep), information, bias, prior, wanted[keep], mask[keep], per_effect[keep],
            True, 1.0,
        )  # fmt: skip

    everything = np.arange(len(numbers))
    is_told, is_seen = (goal(mask, everything).best_alone(seconds, durations) >= MIN_INFORMATION for mask in masks)
    chosen = np.where(is_told[:, None], masks[0], masks[1])
    keep = np.flatnonzero(is_told | is_seen)
    shown = {names[k] for k in keep}
    separable = {names[k] for k in np.flatnonzero(is_told)}
    hidden = tuple(name for name in question.effects if name not in shown)
    inseparable = tuple(name for name in question.effects if name in shown - separable)
    return (goal(chosen, keep) if len(keep) else None), hidden, inseparable


def _strength(question: Question, axis: AxisSettings, model: Sensitivity) -> float | None:
    """Return the largest force, over the Coulomb force, of the weakest effect asked for that the file has, or None.

    Its rivals imitate it, so they are assumed to be as strong.
    """
    if question.is_everything:
        return None
    found = [model.largest_force(model.effect_column(item)) for item in axis.effects if item.name in question.effects]
    return min((force / model.contact.friction.coulomb_force for force in found if force > 0.0), default=None)


def _growth(settings: EffectSettings, seconds: float) -> Floats:
    """Return the share of an effect over time at the times of the grid."""
    if settings.name == "thermal_drift":
        return np.asarray(1.0 - np.exp(-_GRID * seconds / settings.values[1]))
    return np.where(_GRID > 0.5, 1.0, 0.0)
