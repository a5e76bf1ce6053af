"""Hypotheses on values of the owner's file: friction, elements, sharpness or contact law let go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgms_observer.diagnosis.candidates import LAST_STEPS, Candidate
from sgms_observer.diagnosis.contact_start import contact_start
from sgms_observer.diagnosis.fit import Refit, RefitSetup
from sgms_observer.diagnosis.search import CONTACT_SHARE

START_LAG = 0.01
"""Start of the time in which sliding elements follow the Stribeck curve, where the file's contact has none [s]."""
MAX_DEFLECTION_RATIO = 10.0
"""Factor by which the slip deflections of a contact may differ from the file's."""
CHANGE_HYPOTHESES = ("changed friction", "changed elements", "unsmoothed contact", "changed contact law")
"""Hypotheses on values of the file, in the order of how much they let go."""


def freed_setup(setup: RefitSetup, name: str) -> RefitSetup:
    """Return refits in which values of the owner's file are let go.

    Args:
        refits: so far.
        name: one of ``CHANGE_HYPOTHESES``.
    """
    if name == CHANGE_HYPOTHESES[0]:
        return replace(setup, freedom=replace(setup.freedom, friction=True))
    if name == CHANGE_HYPOTHESES[1]:
        model = setup.nominal.with_log_spaced_elements(*deflections(setup))
        return replace(setup, nominal=model, freedom=replace(setup.freedom, friction=True, elements=True))
    if name == CHANGE_HYPOTHESES[2]:
        return replace(setup, nominal=replace(setup.nominal, is_unsmoothed=True))
    whole = with_damping(freed_setup(setup, CHANGE_HYPOTHESES[1]))
    friction = whole.nominal.friction
    if friction.model == "gms":
        return whole
    attraction = friction.coulomb_force / START_LAG
    return replace(
        whole, nominal=replace(whole.nominal, friction=replace(friction, model="gms", attraction_rate=attraction))
    )


def with_damping(setup: RefitSetup) -> RefitSetup:
    """Return refits in which the elements have a damping of their own, from one sample of relaxation time on."""
    if setup.nominal.relaxation > 0.0:
        return setup
    period = min(motion.period for motion in setup.data.motions)
    return replace(setup, nominal=replace(setup.nominal, relaxation=period))


def deflections(setup: RefitSetup) -> tuple[float, float]:
    """Return the smallest and largest slip deflection that a contact unknown to the file may have.

    From a tenth of the file's smallest to ten times its largest, within what the encoder resolves and what is still a
    contact beside the stroke.

    Args:
        refits: recordings and model so far.
    """
    friction, motions = setup.nominal.friction, setup.data.motions
    slip = np.array(friction.element_fraction) * friction.coulomb_force / np.array(friction.element_stiffness)
    stroke = float(np.ptp(np.concatenate([motion.position for motion in motions])))
    step = max(motion.resolution for motion in motions)
    largest = min(MAX_DEFLECTION_RATIO * float(slip.max()), CONTACT_SHARE * stroke)
    smallest = max(float(slip.min()) / MAX_DEFLECTION_RATIO, 2.0 * step, 1.0e-4 * largest)
    return min(smallest, 0.1 * largest), largest


def can_be_freed(setup: RefitSetup, name: str) -> bool:
    """Return whether values of the file can still be let go."""
    if name == CHANGE_HYPOTHESES[0]:
        return not setup.freedom.friction
    if name == CHANGE_HYPOTHESES[1]:
        return not setup.freedom.elements
    if name == CHANGE_HYPOTHESES[3]:
        return not setup.freedom.elements or setup.nominal.relaxation == 0.0
    return setup.nominal.friction.model != "gms" and not setup.nominal.is_unsmoothed


def changed_candidate(setup: RefitSetup, current: Refit, name: str) -> Candidate:
    """Return the hypothesis that values of the owner's file changed.

    Args:
        refits: so far.
        current: fit so far.
        name: one of ``CHANGE_HYPOTHESES``.
    """
    free = freed_setup(setup, name)
    is_same = free.nominal.parameter_names() == setup.nominal.parameter_names() and not free.freedom.elements
    start = current.logs if is_same else contact_start(free, current.effects)
    return Candidate(name, free, free.fit(current.effects, start, LAST_STEPS), 1)
