"""The next experiment: made, run and diagnosed, while effects are ambiguous that a motion can separate."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from sgms_observer.application.commission.compensate import time_to_compensate
from sgms_observer.application.commission.learn import Found, diagnose_bags_of, residual_of
from sgms_observer.application.commission.ledger import DIAGNOSED, EXPERIMENTS, LEARN_BAG
from sgms_observer.application.commission.motion import Motion, checked
from sgms_observer.application.commission.session import OutOfTime, Session
from sgms_observer.diagnosis.gap import effort_rms
from sgms_observer.diagnosis.whitened import MIN_NOISE_SHARE
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.question import NO_REFERENCE_SHOWS, is_possible
from sgms_observer.excitation.reference import HiddenError, design_excitation
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.load import load_settings

EXPERIMENT_SECONDS = (15.0, 45.0)
"""Lengths of an experiment; the first one in which the effects are expected to be told apart is taken [s]."""
MAX_EXPERIMENTS = 3
"""Experiments for one set of effects: what three designed recordings do not separate, motion does not separate."""
LEFT_OUT = "left_out"
"""Key of a fact: the diagnosis with this experiment predicted worse than the one before."""
DIAGNOSIS_MARGIN = 1.5
"""Time of a diagnosis with one more recording, as a multiple of the one before."""


@dataclass(frozen=True)
class Experiment:
    """A motion that tells effects apart.

    Attributes:
        effects: their names.
        motion: the motion, relative to the middle of the stroke.
    """

    effects: tuple[str, ...]
    motion: Motion


def ambiguous_sets(effects: Sequence[Mapping[str, Any]], axis: AxisSettings) -> list[tuple[str, ...]]:
    """Return the sets of effects that a motion may tell apart: each effect with all its rivals, then with each."""
    found: list[tuple[str, ...]] = []
    for effect in effects:
        name, rivals = effect["name"], effect["alternatives"]
        if not rivals:
            continue
        for names in ((name, *rivals), *((name, rival) for rival in rivals)):
            shown = tuple(one for one in names if one not in NO_REFERENCE_SHOWS and is_possible(one, axis))
            if shown and shown not in found:
                found.append(shown)
    return found


def with_noise_of(bag: str, axis: AxisSettings) -> AxisSettings:
    """Return the model with the rms residual that it leaves in a recording as its ``estimator.measurement_std``."""
    rest = residual_of(bag, axis)
    noise = max(rest.rms, MIN_NOISE_SHARE * effort_rms(rest.motions, rest.weights))
    return replace(axis, estimator=replace(axis.estimator, measurement_std=noise))


def separating(
    sets: Sequence[Sequence[str]], axis: AxisSettings, limits: ExcitationLimits, origin: float, period: float
) -> Experiment | None:
    """Return the motion for the first set of effects that a motion within the limits tells apart; None if none does.

    What counts is the expected evidence for the first effect of a set, as strong as the model has it, in the noise of
    the model (``estimator.measurement_std``).

    Args:
        sets: names of effects, the most urgent first.
        axis: the model so far.
        limits: what the machine may do.
        origin: middle of the stroke [m].
        period: time between two samples [s].
    """
    for names, seconds in product(sets, EXPERIMENT_SECONDS):
        try:
            designed = design_excitation(axis, limits, names, origin, seconds, 1.0 / period, origin)
        except HiddenError:
            continue
        if names[0] not in (*designed.hidden, *designed.inseparable):
            return Experiment(tuple(names), Motion(period, designed.position - origin))
    return None


def next_experiment(session: Session) -> Found:
    """Separate what is ambiguous, experiment by experiment; a rerun goes on with what is recorded already."""
    ledger = session.ledger
    done = [one for one in ledger.facts.get(EXPERIMENTS, []) if session.path(one["bag"]).exists()]
    ledger.facts[EXPERIMENTS] = done
    reason = ""
    while not reason:
        if done and not _is_diagnosed(session, done[-1]):
            reason = _diagnose_again(session, done)
            ledger.write()
            session.say(f"  {done[-1].get('sentence', reason)}")
        else:
            reason = _run_another(session, done)
    sentences = [one["sentence"] for one in done if "sentence" in one]
    files = [name for one in done for name in (one["bag"], f"{one['diagnosis']}/result.json")]
    if done:
        files.append(f"{done[-1]['diagnosis']}/augmented.yaml")
    return "; ".join([*sentences, reason]), [*files, "commission.json"]


def _is_diagnosed(session: Session, experiment: Mapping[str, Any]) -> bool:
    """Return whether an experiment was diagnosed, together with those before it."""
    return "sentence" in experiment and session.path(f"{experiment['diagnosis']}/augmented.yaml").exists()


def _diagnose_again(session: Session, done: list[dict[str, Any]]) -> str:
    """Diagnose with the last experiment too; return why no other one follows, or nothing.

    Where the diagnosis before predicts the user's own motion significantly better, it is used again and the recording
    is left out from then on.
    """
    ledger = session.ledger
    earlier: dict[str, Any] = {name: ledger.facts.get(name) for name in DIAGNOSED}
    effects = ledger.effects
    bags = [LEARN_BAG, *(one["bag"] for one in done if not one.get(LEFT_OUT))]
    session.reserved = time_to_compensate(session)
    try:
        sentence, _ = diagnose_bags_of(session, bags, done[-1]["diagnosis"])
    except OutOfTime:
        return (
            f"the diagnosis with experiment {len(done)} did not end in the time that the compensation does not need, so"
            " the diagnosis before goes on; start again with a larger --time to include the experiment"
        )
    finally:
        session.reserved = 0.0
    done[-1]["sentence"] = f"experiment {len(done)} for {', '.join(done[-1]['effects'])}: {sentence}"
    now, before = ledger.facts["gap"], earlier["gap"]
    is_worse = now["unweighted"]["after"] > before["unweighted"]["after"]  # the weights of the two may differ
    error = math.hypot(before["interval_after"][1] - before["after"], now["after"] - now["interval_after"][0])
    if now["after"] - before["after"] <= error or not is_worse:
        return ""
    ledger.facts |= earlier
    ledger.effects = effects
    done[-1][LEFT_OUT] = True
    done[-1]["sentence"] += (
        f"; the diagnosis before predicts your own motion better (gap {earlier['gap']['after']:.3g} %) and is used"
    )
    return ""


def _run_another(session: Session, done: list[dict[str, Any]]) -> str:
    """Design and record one more experiment; return why there is none, or nothing."""
    ledger, plan = session.ledger, session.plan
    tried = [tuple(one["effects"]) for one in done]
    failed = {tuple(one["effects"]) for one in done if one.get(LEFT_OUT)}
    ambiguous = ambiguous_sets(ledger.effects, session.axis)
    if not ambiguous:
        return "nothing is ambiguous that a motion could separate"
    sets = [one for one in ambiguous if tried.count(one) < MAX_EXPERIMENTS and one not in failed]
    sets.sort(key=tried.count)  # stable: what is not tried goes first
    if not sets:
        count = f"{len(done)} experiments" if len(done) > 1 else "one experiment"
        return f"{', '.join(ambiguous[0])} stay ambiguous after {count}"
    names = ", ".join(sets[0])
    model = load_settings(session.path(f"{ledger.facts['diagnosis']}/augmented.yaml"))
    axis = with_noise_of(str(session.path(LEARN_BAG)), next(a for a in model.axes if a.name == session.axis.name))
    found = separating(sets, axis, plan.limits, session.origin, plan.settings.sample_period)
    if found is None:
        return (
            f"no motion within these limits separates {names} in {EXPERIMENT_SECONDS[-1]:g} s; allow more stroke, speed"
            " or acceleration, or accept that"
        )
    diagnosis = DIAGNOSIS_MARGIN * float(ledger.facts["diagnosis_seconds"])
    needed = session.duration_of(found.motion) + diagnosis + time_to_compensate(session)
    if session.seconds_left < needed:
        return (
            f"no time was left to separate {names}, which takes about {needed:.0f} s with the compensation behind it;"
            " to do that, start anew with a larger --time"
        )
    number = len(done) + 1
    bag = f"recordings/experiment_{number}"
    motion = checked(found.motion, plan.limits, session.origin, "the experiment")
    motion.write(session.path(f"experiment_{number}.csv"))
    session.confirm_motion(motion, f"experiment {number}, to tell {', '.join(found.effects)} apart")
    session.record(motion, bag)
    done.append({"effects": list(found.effects), "bag": bag, "diagnosis": f"diagnosis_{number}"})
    ledger.write()
    return ""
