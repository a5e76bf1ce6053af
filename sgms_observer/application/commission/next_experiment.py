"""The next experiment: made, run and diagnosed, while effects are ambiguous that a motion can separate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sgms_observer.application.commission.learn import Found, diagnose_bags_of
from sgms_observer.application.commission.motion import Motion, checked
from sgms_observer.application.commission.session import LEARN_BAG, Session
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.question import NO_REFERENCE_SHOWS
from sgms_observer.excitation.reference import design_excitation
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.load import load_settings

EXPERIMENT_SECONDS = 15.0
"""Length of one experiment [s]."""
MOST_EXPERIMENTS = 3
"""Experiments at most: what three designed recordings do not separate, motion does not separate."""
DIAGNOSIS_MARGIN = 1.5
"""Time of a diagnosis with one more recording, as a multiple of the one before."""
TIME_TO_COMPENSATE = 90.0
"""Time that observer and compensation need behind the last diagnosis [s]."""


def separable_pair(effects: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return an effect and its rivals, as far as a motion can tell them apart; empty where it cannot.

    Args:
        effects: as in result.json.
    """
    for effect in effects:
        if effect["alternatives"]:
            names = (effect["name"], *effect["alternatives"])
            shown = tuple(name for name in names if name not in NO_REFERENCE_SHOWS)
            if shown:
                return shown
    return ()


def experiment(
    pair: Sequence[str], axis: AxisSettings, limits: ExcitationLimits, origin: float, period: float, seconds: float
) -> Motion:
    """Return the motion that makes effects most distinguishable.

    Args:
        pair: names of the effects.
        axis: the model so far.
        limits: what the table may do.
        origin: middle of the stroke [m].
        period: time between two samples [s].
        seconds: longest duration [s].
    """
    designed = design_excitation(axis, limits, pair, origin, seconds, 1.0 / period, origin)
    return Motion(period, designed.position - origin)


def next_experiment(session: Session) -> Found:
    """Separate what is ambiguous, experiment by experiment."""
    ledger, plan = session.ledger, session.plan
    bags, files, told = [LEARN_BAG], [], []
    for number in range(1, MOST_EXPERIMENTS + 1):
        pair = separable_pair(ledger.effects)
        if not pair:
            break
        needed = EXPERIMENT_SECONDS + DIAGNOSIS_MARGIN * float(ledger.facts["diagnosis_seconds"]) + TIME_TO_COMPENSATE
        if session.seconds_left < needed:
            told.append(f"no time is left to separate {', '.join(pair)} (about {needed:.0f} s)")
            break
        model = load_settings(session.path(f"{ledger.facts['diagnosis']}/augmented.yaml"))
        axis = next(one for one in model.axes if one.name == session.axis.name)
        period = plan.settings.sample_period
        motion = experiment(pair, axis, plan.limits, session.origin, period, EXPERIMENT_SECONDS)
        checked(motion, plan.limits, session.origin, "the experiment")
        bag, out = f"recordings/experiment_{number}", f"diagnosis_{number}"
        motion.write(session.path(f"experiment_{number}.csv"))
        session.confirm_motion(motion, f"experiment {number}, to tell {', '.join(pair)} apart")
        session.record(motion, bag)
        bags.append(bag)
        sentence, written = diagnose_bags_of(session, bags, out)
        files += [bag, *written]
        told.append(f"experiment {number} for {', '.join(pair)}: {sentence}")
    if not told:
        return "nothing is ambiguous that a motion could separate", ["commission.json"]
    return "; ".join(told), [*files, "commission.json"]
