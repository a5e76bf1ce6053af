"""The first step: topics, rates, signs and limits on the live graph."""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.application.commission.motion import Motion, sign_motion
from sgms_observer.application.commission.session import Session
from sgms_observer.application.commission.table import LEAD, STROKE_MARGIN, WRONG_SIGN, Guard, Topics, stall
from sgms_observer.application.commission.tracking import MAX_DELAY, Tracker
from sgms_observer.application.init import FIRST_LIMIT_SHARE
from sgms_observer.errors import ConfigurationError, DataError
from sgms_observer.settings.axis import AxisSettings

LISTEN = 1.5
"""Time of listening to the topics before the first motion [s]."""
RATE_TOLERANCE = 0.05
"""Largest difference of the median period of the stamps from sample_period, as a share."""
MISSING_SHARE = 0.02
"""Largest share of positions without an effort of the same stamp."""
MIN_MOVED_SHARE = 0.5
"""An axis that covers less than this share of the small motion does not follow."""
LIMIT_MARGIN = 1.1
"""Largest limit of the compensation over the recommended one without a warning; the friction is a guess."""
OWN_LAG = 5.0e-3
"""Smallest delay between set-point and motion that is not tracking error [s]."""


def topic_faults(topics: Topics, axis: AxisSettings, period: float) -> list[str]:
    """Return one sentence for every fault that prevents a commissioning of the axis.

    Args:
        topics: messages and nodes on the graph.
        axis: the axis.
        period: nominal sample period [s].
    """
    faults = []
    for topic in ("position", "control_effort"):
        names = topics.names.get(topic)
        if names is None:
            faults.append(
                f"no message of {topic} arrives; start the machine, or check its namespace, --topic and ROS_DOMAIN_ID"
            )
        elif axis.name not in names:
            faults.append(f"{topic} names {', '.join(names)} and not {axis.name}; correct axes in the YAML")
    stamps = topics.samples.stamp_ns
    if not faults and len(stamps) < 10:
        faults.append(
            f"only {len(stamps)} positions arrived in {topics.seconds:.1f} s; check the rate of the machine's node"
        )
    if faults:
        return faults
    median = float(np.median(np.diff(stamps))) * 1e-9
    if abs(median / period - 1.0) > RATE_TOLERANCE:
        faults.append(
            f"position comes every {1e3 * median:.4g} ms, and sample_period is {1e3 * period:.4g} ms; write"
            f" sample_period: {median:.4g} into the YAML"
        )
    missing = float(np.mean(~np.isfinite(topics.samples.effort)))
    if missing > MISSING_SHARE:
        faults.append(
            f"{100 * missing:.0f} % of the positions have no control_effort of the same stamp; stamp both with the"
            " sample time"
        )
    if topics.reference_readers == 0:
        faults.append("no node subscribes to reference; start the machine so that it follows the topic reference")
    if topics.reference_senders > 0:
        faults.append("another node publishes reference; stop it, or the axis gets two set-points")
    if topics.compensation_senders > 0:
        faults.append("another node publishes friction_compensation; stop the observer that runs already")
    return faults


def warn_of_limit(session: Session, axis: AxisSettings) -> None:
    """Warn where the limit of the compensation does not fit the static force."""
    limit, static, readable = axis.compensation.limit, axis.friction.static_force, axis.units.readable
    if static <= limit <= LIMIT_MARGIN * FIRST_LIMIT_SHARE * static:
        return
    session.warn(
        f"Warning: compensation.limit = {readable(limit, 'N')} does not fit the static force of"
        f" {readable(static, 'N')}; {FIRST_LIMIT_SHARE:g} times it, {readable(FIRST_LIMIT_SHARE * static, 'N')}, is"
        " safe and enough."
    )


def connect(session: Session) -> str:
    """Check the topics without a motion, and store the position of the axis.

    Returns:
        The result, one sentence.

    Raises:
        ConfigurationError: one sentence per fault.
    """
    topics = session.table.listen(LISTEN)
    faults = topic_faults(topics, session.axis, session.plan.settings.sample_period)
    if faults:
        raise ConfigurationError(faults)
    session.table.lead = float(session.ledger.facts.get("lead", LEAD))
    here = float(np.median(topics.samples.position))
    origin = session.ledger.facts.setdefault("origin", here)
    readable, stroke = session.axis.units.readable, session.plan.limits.stroke
    if abs(here - origin) > (0.5 + STROKE_MARGIN) * stroke:
        raise ConfigurationError(
            [
                f"axis {session.axis.name} stands at {readable(here)}, outside the stroke of {readable(stroke)} around"
                f" {readable(origin)} where its commissioning began; move it back to go on, or start anew with"
                " --overwrite"
            ]
        )
    warn_of_limit(session, session.axis)
    rate = (len(topics.samples.stamp_ns) - 1) / max(float(np.ptp(topics.samples.stamp_ns)) * 1e-9, 1e-9)
    return f"{rate:.4g} samples per second, axis {session.axis.name} at {readable(here)}"


def _sign_run(session: Session, motion: Motion) -> tuple[Guard, Tracker]:
    """Play the motion; return the guard, which knows the sign, and the samples."""
    slack = MAX_DELAY * motion.peak_speed
    guards: list[Guard] = []

    def fresh_guard() -> Guard:
        guards.append(Guard(session.axis, session.plan.limits, session.origin, 0.0, slack))
        return guards[-1]

    tracker = session.play(motion, guard=fresh_guard)
    guard = guards[-1]
    way, gone = float(np.ptp(motion.position)), float(np.ptp(tracker.tracking(0.0).position))
    if gone < MIN_MOVED_SHARE * way:
        raise stall(session.axis, way, gone)
    if guard.sign < WRONG_SIGN:
        raise DataError(
            f"control_effort acts against the motion of axis {session.axis.name} (correlation {guard.sign:.2f}): its"
            f" sign is wrong; reverse the sign of {session.axis.name}.effort_scale, or of position_scale"
        )
    return guard, tracker


def check(session: Session) -> tuple[str, list[str]]:
    """Play a small motion to check that the axis follows and that position and effort have the right signs.

    Args:
        session: the session, connected.

    Returns:
        The result and the files.

    Raises:
        DataError: a sign is wrong, or the axis does not follow.
    """
    table, limits, period = session.table, session.plan.limits, session.plan.settings.sample_period
    motion = sign_motion(limits, period)
    session.confirm_motion(motion, "check of the signs")
    table.lead = LEAD
    guard, tracker = _sign_run(session, motion)
    delay = tracker.best_delay()
    if delay < -0.5 * LEAD:  # the machine follows a set-point on arrival, not at its stamp
        table.lead = 0.0
        guard, tracker = _sign_run(session, motion)
        delay = tracker.best_delay()
    session.ledger.facts["lead"] = table.lead
    session.ledger.facts["delay"] = delay if abs(delay) > OWN_LAG else 0.0
    error = tracker.tracking(session.delay)
    if not math.isfinite(error.rms):
        raise DataError("position is not finite during the motion; check the sensor and start again")
    return (
        f"{'set-points act at their stamps' if session.ledger.facts['lead'] else 'set-points act when they arrive'};"
        f" effort and velocity agree in sign (correlation {guard.sign:.2f}), the axis follows within"
        f" {session.axis.units.readable(error.peak)}",
        ["commission.json"],
    )
