"""The steps with the observer: check its standard deviations, compensate with rising gain, before and after."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.application.commission.check import warn_of_limit
from sgms_observer.application.commission.learn import Found, load_motion
from sgms_observer.application.commission.ledger import (
    AFTER_BAG,
    BEFORE_BAG,
    CANDIDATE,
    COMMISSIONED,
    OWN_BAG,
    OWN_MOTION,
    SHORTFALL,
)
from sgms_observer.application.commission.session import Session
from sgms_observer.application.commission.table import Heard
from sgms_observer.application.commission.tracking import Tracking
from sgms_observer.bags.reader import BagSamples
from sgms_observer.errors import DataError
from sgms_observer.observer.all_axes import AllAxes
from sgms_observer.settings.axis import Settings
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.write import write_settings
from sgms_observer.status import MAX_NIS, Status

MAX_STD_SHARE = 0.5
"""Largest standard deviation of the estimated friction, as a share of the Coulomb force. Two standard deviations reach
that force then: beyond it not even the sign of the friction is known."""


@dataclass(frozen=True)
class Consistency:
    """Consistency of an observer over a recording.

    Attributes:
        nis: mean normalised innovation squared [-]; NaN without a correction.
        std_share: median standard deviation of the friction over the Coulomb force [-].
    """

    nis: float
    std_share: float

    @property
    def is_inconsistent(self) -> bool:
        """Return whether the innovations are larger than the observer expects."""
        return self.nis > MAX_NIS


def consistency_of(bag: Path, config: Path, name: str) -> Consistency:
    """Return the consistency of the observer over a recording, from the numbers that the node would publish.

    Args:
        bag: the recording.
        config: parameter file of the observer.
        name: of the axis.

    Raises:
        DataError: the observer has no estimate.
    """
    settings = load_settings(config)
    axis = settings.wanted_axes([name], str(config))[0]
    observer = AllAxes([axis], settings.sample_period)
    squares, spreads = list[np.ndarray](), list[np.ndarray]()
    for _, samples in BagSamples(bag, {name: settings.scales[name]}, settings.sample_period):
        estimates = observer.step({0: samples})[0]
        corrected = np.isfinite(estimates.innovation) & (estimates.innovation_std > 0.0)
        squares.append((estimates.innovation[corrected] / estimates.innovation_std[corrected]) ** 2)
        runs = (estimates.status == Status.RUNNING) & np.isfinite(estimates.friction_std)
        spreads.append(estimates.friction_std[runs])
    square, spread = (np.concatenate(parts) if parts else np.zeros(0) for parts in (squares, spreads))
    if not spread.size:
        raise DataError(f"the observer estimates nothing over {bag}; run sgms replay on it to see why")
    nis = float(np.mean(square)) if square.size else math.nan
    return Consistency(nis, float(np.median(spread)) / axis.friction.coulomb_force)


GAIN_STEPS = (1.0 / 3.0, 2.0 / 3.0, 1.0)
"""Shares of the file's gain, in the order of the trials."""
MAX_PEAK_RATIO = 1.5
"""A tracking error this many times the largest one without compensation takes the compensation to zero at once."""
MAX_ERROR_RATIO = 1.02
"""Largest rms or peak over that of the gain before for a gain to be accepted; repetitions differ by 2 %."""
MIN_IMPROVEMENT = 0.98
"""The compensated rms must be below this multiple of the one without for the file to be of use."""
MAX_CORRECTIONS = 3
"""Largest number of corrections of estimator.measurement_std by the root of NIS."""
OBSERVER_START = 10.0
"""Time from the start of an observer until it is active [s]."""


def time_to_compensate(session: Session) -> float:
    """Return the expected time of the steps from ``observe`` to ``before_and_after`` [s]."""
    motion_seconds = session.duration_of(load_motion(session, OWN_MOTION))
    return (1 + len(GAIN_STEPS) + 2) * motion_seconds + 2.0 * OBSERVER_START


class TrackingWatch:
    """Takes the compensation to zero at once where the tracking error is much larger than without it.

    Args:
        session: the session.
        largest: the largest tracking error without compensation [m].
        gain: of the compensation, a share of the predicted friction [-].
    """

    def __init__(self, session: Session, largest: float, gain: float) -> None:
        self._session, self._largest, self._gain = session, largest, gain
        self.worst = 0.0

    def begin(self) -> None:
        """Switch the compensation on, and reset the largest tracking error."""
        self.worst = 0.0
        self._session.table.compensate(self._gain)

    @property
    def has_released(self) -> bool:
        """Return whether the compensation was taken to zero."""
        return self.worst > MAX_PEAK_RATIO * self._largest

    def __call__(self, heard: Heard) -> None:
        """Check the newest samples."""
        if self.has_released or not len(heard.time):
            return
        samples = heard.samples
        behind = self._session.delay * samples.reference_velocity
        error = np.abs(samples.position - samples.reference_position + behind)[heard.time >= 0.0]
        self.worst = max(self.worst, float(np.max(error, initial=0.0)))
        if self.has_released:
            self._session.table.release()


def observe(session: Session) -> Found:
    """Move the axis with the observer and without compensation; measure the delay of its compensation."""
    ledger, axis = session.ledger, session.axis
    settings = load_settings(session.path(f"{ledger.facts['diagnosis']}/augmented.yaml"))
    off: dict[str, dict[str, Any]] = {one.name: {"compensation.enabled": False} for one in settings.axes}
    write_settings(settings, session.path(CANDIDATE), off)
    certainty = _consistent(session, settings, off)
    motion = load_motion(session, OWN_MOTION)
    session.need(session.duration_of(motion) + 2.0 * OBSERVER_START, "observe")
    session.table.start_observer(session.path(CANDIDATE))
    session.confirm_motion(motion, "observer, without compensation")
    tracking = session.play(motion).tracking()
    median, worst = session.table.delays()
    if math.isnan(median):
        raise DataError("the observer published no compensation during the motion; see log/observer_node.log")
    ledger.facts["baseline"] = {"rms": tracking.rms, "peak": tracking.peak}
    given = axis.compensation.look_ahead
    wanted = given or min(round(median + 0.5 * session.plan.settings.sample_period - session.delay, 5), 0.1)
    if wanted != given:
        off[axis.name]["compensation.look_ahead"] = max(0.0, wanted)
        write_settings(settings, session.path(CANDIDATE), off)
        session.table.stop_observer()
        session.table.start_observer(session.path(CANDIDATE))
    readable = axis.units.readable
    return (
        f"{certainty}; half of the compensations come within {1e3 * median:.3g} ms of their sample, 99 % within"
        f" {1e3 * worst:.3g} ms; look_ahead {1e3 * wanted:.3g} ms; tracking error without compensation"
        f" {readable(tracking.rms)} rms, {readable(tracking.peak)} peak",
        [CANDIDATE],
    )


def _consistent(session: Session, settings: Settings, changes: dict[str, dict[str, Any]]) -> str:
    """Correct ``measurement_std`` by the NIS over the user's recorded motion; return NIS and friction_std as text.

    Args:
        session: the session.
        settings: of the diagnosis.
        changes: to the settings, in the candidate; a corrected ``measurement_std`` is added.

    Raises:
        DataError: the estimate is too uncertain for a compensation.
    """
    name, candidate = session.axis.name, session.path(CANDIDATE)
    axis = settings.wanted_axes([name], str(candidate))[0]
    warn_of_limit(session, axis)
    deviation, correction = axis.estimator.measurement_std, ""
    found = consistency_of(session.path(OWN_BAG), candidate, name)
    for _ in range(MAX_CORRECTIONS):
        if not found.is_inconsistent:
            break
        deviation = float(f"{deviation * math.sqrt(found.nis):.3g}")
        changes[name]["estimator.measurement_std"] = deviation
        write_settings(settings, candidate, changes)
        readable = session.axis.units.readable(deviation, "N")
        correction = f" with estimator.measurement_std {readable} in place of the file's"
        found = consistency_of(session.path(OWN_BAG), candidate, name)
    if found.std_share > MAX_STD_SHARE:
        raise DataError(
            f"the standard deviation of the estimated friction is {100 * found.std_share:.0f} % of the Coulomb force"
            f" and must be at most {100 * MAX_STD_SHARE:.0f} %; no compensation is switched on with it: lengthen"
            " filter.window, or lower estimator.process_std, and start anew"
        )
    if found.is_inconsistent:
        session.warn(
            f"Warning: NIS is {found.nis:.2g} and should be at most {MAX_NIS:g}; the innovations are larger than the"
            " observer expects: identify the model anew."
        )
    return f"NIS {found.nis:.2g}{correction}, friction_std {100 * found.std_share:.2g} % of the Coulomb force"


def compensate(session: Session) -> Found:
    """Raise the gain step by step while the tracking error falls; zero at once if it does not."""
    ledger, axis = session.ledger, session.axis
    readable = axis.units.readable
    motion = load_motion(session, OWN_MOTION)
    _ensure_observer(session, len(GAIN_STEPS) * session.duration_of(motion), "compensate")
    session.confirm_motion(motion, f"compensation, {len(GAIN_STEPS)} times with rising gain", len(GAIN_STEPS))
    baseline = ledger.facts["baseline"]
    best_gain, best = 0.0, (float(baseline["rms"]), float(baseline["peak"]))
    rms_by_gain = [f"0: {readable(best[0])}"]
    reason = ""
    for share in GAIN_STEPS:
        gain = round(share * axis.compensation.gain, 4)
        watch = TrackingWatch(session, float(baseline["peak"]), gain)
        tracking = session.play(motion, watch, prepare=watch.begin).tracking()
        rms_by_gain.append(f"{gain:.2g}: {readable(tracking.rms)}")
        session.say(f"  gain {gain:.2g}: tracking error {readable(tracking.rms)} rms, {readable(tracking.peak)} peak")
        most_rms, most_peak = MAX_ERROR_RATIO * best[0], MAX_ERROR_RATIO * baseline["peak"]
        if watch.has_released or tracking.rms > most_rms or tracking.peak > most_peak:
            session.table.compensate(0.0)
            reason = f"; gain {gain:.2g} made tracking worse, and the compensation went back to zero at once"
            break
        best_gain, best = gain, (tracking.rms, tracking.peak)
    session.table.compensate(0.0)
    ledger.facts["gain"] = best_gain
    changes: dict[str, Any] = {"compensation.enabled": best_gain > 0.0}
    if best_gain > 0.0:
        changes["compensation.gain"] = best_gain
    head = (
        f"sgms commission: {', '.join(effect['name'] for effect in ledger.effects) or 'no effect'}; gain {best_gain:g}"
    )
    write_settings(load_settings(session.path(CANDIDATE)), session.path(COMMISSIONED), {axis.name: changes}, {"": head})
    ledger.yaml = COMMISSIONED
    return f"rms tracking error by gain: {', '.join(rms_by_gain)}{reason}; gain {best_gain:.2g} is kept", [COMMISSIONED]


def before_and_after(session: Session) -> Found:
    """Play the user's own motion without and then with the compensation."""
    ledger, readable = session.ledger, session.axis.units.readable
    gain = float(ledger.facts["gain"])
    motion = load_motion(session, OWN_MOTION)
    _ensure_observer(session, 2.0 * session.duration_of(motion), "before_and_after")
    session.confirm_motion(motion, "own motion, twice: without and with compensation", 2)
    before = session.record(motion, BEFORE_BAG).tracking()
    watch = TrackingWatch(session, before.peak, gain)
    after = session.record(motion, AFTER_BAG, watch, prepare=watch.begin).tracking()
    session.table.compensate(0.0)
    ledger.tracking = _tracking_json(before, after, session.axis.units.position)
    ledger.facts[SHORTFALL] = shortfall = _shortfall(gain, before, after)
    ledger.is_usable = not shortfall
    return (
        f"tracking error {readable(before.rms)} rms, {readable(before.peak)} peak without compensation;"
        f" {readable(after.rms)} rms, {readable(after.peak)} peak with it:"
        f" {before.rms / after.rms:.1f} and {before.peak / after.peak:.1f} times smaller"
        + (f"; {shortfall}" if shortfall else ""),
        [BEFORE_BAG, AFTER_BAG],
    )


def _shortfall(gain: float, before: Tracking, after: Tracking) -> str:
    """Return the reason why the compensation must not be used; empty without one."""
    if gain == 0.0:
        return "no gain made tracking better, so the compensation stays switched off"
    if after.rms >= MIN_IMPROVEMENT * before.rms:
        return f"the rms tracking error with compensation is not below {MIN_IMPROVEMENT:g} times that without"
    if after.peak > before.peak:
        return "the peak of the tracking error is larger with compensation than without"
    return ""


def _tracking_json(before: Tracking, after: Tracking, unit: str) -> dict[str, Any]:
    """Return the part of commission.json that compares tracking errors, in ``unit``."""
    return {
        "rms_before": before.rms,
        "rms_after": after.rms,
        "peak_before": before.peak,
        "peak_after": after.peak,
        "unit": unit,
    }


def _ensure_observer(session: Session, seconds: float, step: str) -> None:
    """Start the observer unless it runs; raise if there is no time for it and the motions after it [s]."""
    if not session.table.has_observer:
        session.need(seconds + OBSERVER_START, step)
        session.table.start_observer(session.path(CANDIDATE))
