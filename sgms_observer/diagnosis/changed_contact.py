"""Hypotheses on values of the owner's file: friction, elements, sharpness or contact law let go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgms_observer.diagnosis.candidates import LAST_STEPS, Candidate
from sgms_observer.diagnosis.contact_start import contact_start
from sgms_observer.diagnosis.fit import Refit, Refits
from sgms_observer.diagnosis.search import CONTACT_SHARE

START_LAG = 0.01
"""Start of the time in which sliding elements follow the Stribeck curve, where the file's contact has none [s]."""
SLACK_OF_CONTACT = 10.0
"""Factor by which the slip deflections of a contact may differ from the file's."""
CHANGED = ("changed friction", "changed elements", "unsmoothed contact", "changed contact law")
"""Hypotheses on values of the file, in the order of how much they let go."""


def changed_refits(refits: Refits, name: str) -> Refits:
    """Return refits in which values of the owner's file are let go.

    Args:
        refits: so far.
        name: one of ``CHANGED``.
    """
    if name == CHANGED[0]:
        return replace(refits, freedom=replace(refits.freedom, friction=True))
    if name == CHANGED[1]:
        model = refits.nominal.spread(*deflections(refits))
        return replace(refits, nominal=model, freedom=replace(refits.freedom, friction=True, elements=True))
    if name == CHANGED[2]:
        return replace(refits, nominal=replace(refits.nominal, is_sharp=True))
    whole = with_damping(changed_refits(refits, CHANGED[1]))
    friction = whole.nominal.friction
    if friction.model == "gms":
        return whole
    attraction = friction.coulomb_force / START_LAG
    return replace(
        whole, nominal=replace(whole.nominal, friction=replace(friction, model="gms", attraction_rate=attraction))
    )


def with_damping(refits: Refits) -> Refits:
    """Return refits in which the elements have a damping of their own, from one sample of relaxation time on."""
    if refits.nominal.relaxation > 0.0:
        return refits
    period = min(motion.period for motion in refits.judged.motions)
    return replace(refits, nominal=replace(refits.nominal, relaxation=period))


def deflections(refits: Refits) -> tuple[float, float]:
    """Return the smallest and largest slip deflection that a contact unknown to the file may have.

    From a tenth of the file's smallest to ten times its largest, within what the encoder resolves and what is still a
    contact beside the stroke.

    Args:
        refits: recordings and model so far.
    """
    friction, motions = refits.nominal.friction, refits.judged.motions
    reach = np.array(friction.element_fraction) * friction.coulomb_force / np.array(friction.element_stiffness)
    stroke = float(np.ptp(np.concatenate([motion.position for motion in motions])))
    step = max(motion.resolution for motion in motions)
    largest = min(SLACK_OF_CONTACT * float(reach.max()), CONTACT_SHARE * stroke)
    smallest = max(float(reach.min()) / SLACK_OF_CONTACT, 2.0 * step, 1.0e-4 * largest)
    return min(smallest, 0.1 * largest), largest


def is_possible(refits: Refits, name: str) -> bool:
    """Return whether values of the file can still be let go."""
    if name == CHANGED[0]:
        return not refits.freedom.friction
    if name == CHANGED[1]:
        return not refits.freedom.elements
    if name == CHANGED[3]:
        return not refits.freedom.elements or refits.nominal.relaxation == 0.0
    return refits.nominal.friction.model != "gms" and not refits.nominal.is_sharp


def changed_candidate(refits: Refits, current: Refit, name: str) -> Candidate:
    """Return the hypothesis that values of the owner's file changed.

    Args:
        refits: so far.
        current: fit so far.
        name: one of ``CHANGED``.
    """
    free = changed_refits(refits, name)
    is_same = free.nominal.parameter_names() == refits.nominal.parameter_names() and not free.freedom.elements
    start = current.logs if is_same else contact_start(free, current.effects)
    return Candidate(name, free, free.of(current.effects, start, LAST_STEPS), 1)
