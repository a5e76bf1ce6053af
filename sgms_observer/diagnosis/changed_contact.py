"""Hypotheses that values of the file changed: friction, elements, smoothing or contact law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgms_observer.diagnosis.candidates import Candidate
from sgms_observer.diagnosis.contact_start import contact_start
from sgms_observer.diagnosis.fit import FRICTION_VALUES, Refit, RefitSetup
from sgms_observer.diagnosis.search import CONTACT_SHARE

MAX_DEFLECTION_RATIO = 10.0
"""Largest ratio between the slip deflections of the contact and those of the file."""
CHANGED_CONTACT_LAW = "changed contact law"
CHANGE_HYPOTHESES = ("changed friction", "changed elements", "unsmoothed contact", CHANGED_CONTACT_LAW)
"""Hypotheses on values of the file. Later ones free more parameters."""


def freed_setup(setup: RefitSetup, name: str) -> RefitSetup:
    """Return the setup in which values of the file are free.

    A file without GMS attraction gets none: its rate is a frictional lag, which is an effect and has a name.

    Args:
        setup: setup so far.
        name: one of ``CHANGE_HYPOTHESES``.
    """
    if name == CHANGE_HYPOTHESES[0]:
        return replace(setup, freedom=replace(setup.freedom, friction=FRICTION_VALUES))
    if name == CHANGE_HYPOTHESES[1]:
        model = setup.nominal.with_log_spaced_elements(*deflections(setup))
        return replace(setup, nominal=model, freedom=replace(setup.freedom, friction=FRICTION_VALUES, elements=True))
    if name == CHANGE_HYPOTHESES[2]:
        return replace(setup, nominal=replace(setup.nominal, is_unsmoothed=True))
    whole = with_damping(freed_setup(setup, CHANGE_HYPOTHESES[1]))
    return whole if whole.nominal.friction.model == "gms" else freed_setup(whole, CHANGE_HYPOTHESES[2])


def with_damping(setup: RefitSetup) -> RefitSetup:
    """Return the setup in which the elements have damping. The relaxation time starts at one sample."""
    if setup.nominal.relaxation > 0.0:
        return setup
    period = min(motion.period for motion in setup.data.motions)
    return replace(setup, nominal=replace(setup.nominal, relaxation=period))


def deflections(setup: RefitSetup) -> tuple[float, float]:
    """Return the smallest and largest slip deflection of a contact whose elements are unknown [m].

    The range is from a tenth of the smallest to ten times the largest slip deflection of the file, limited by the
    encoder resolution and by a share of the stroke.

    Args:
        setup: setup so far.
    """
    friction, motions = setup.nominal.friction, setup.data.motions
    slip = np.array(friction.element_fraction) * friction.coulomb_force / np.array(friction.element_stiffness)
    stroke = float(np.ptp(np.concatenate([motion.position for motion in motions])))
    step = max(motion.resolution for motion in motions)
    largest = min(MAX_DEFLECTION_RATIO * float(slip.max()), CONTACT_SHARE * stroke)
    smallest = max(float(slip.min()) / MAX_DEFLECTION_RATIO, 2.0 * step, 1.0e-4 * largest)
    return min(smallest, 0.1 * largest), largest


def can_be_freed(setup: RefitSetup, name: str) -> bool:
    """Return whether the values of a hypothesis are not free yet."""
    if name == CHANGE_HYPOTHESES[0]:
        return not setup.freedom.friction
    if name == CHANGE_HYPOTHESES[1]:
        return not setup.freedom.elements
    if name == CHANGE_HYPOTHESES[3]:
        return not setup.freedom.elements or setup.nominal.relaxation == 0.0
    return setup.nominal.friction.model != "gms" and not setup.nominal.is_unsmoothed


def changed_candidate(setup: RefitSetup, current: Refit, name: str) -> Candidate:
    """Return the fitted hypothesis that values of the file changed.

    Args:
        setup: setup so far.
        current: fit so far.
        name: one of ``CHANGE_HYPOTHESES``.
    """
    free = freed_setup(setup, name)
    is_same = free.nominal.parameter_names() == setup.nominal.parameter_names() and not free.freedom.elements
    start = current.logs if is_same else contact_start(free, current.effects)
    return Candidate(name, free, free.fit(current.effects, start), 1)
