"""Times at which samples and compensations are due, by the elapsed time and not by the arrival. Imports no ROS."""

from __future__ import annotations

import math
import threading
from collections import deque

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.compensation.horizon import EVERY, Horizon
from sgms_observer.settings.axis import AxisSettings

MAX_CATCH_UP = 0.5
"""A clock that jumps further than this [s] was stopped or set: the samples in between are dropped. An observer that is
silent for longer was stopped too: what is held of its compensation is released."""

MAX_LAG_OF_FOLLOWER = 60.0
"""The same for an axis that follows set-points: it may lag behind the clock, but its set-point must not jump."""

AGE_SENTENCE = "the compensation arrived"
"""Beginning of the stage node's note on the delay of the compensation; ``sgms demo`` quotes it."""


class Pace:
    """Counts due samples by a clock that may stand still, run slow, jump or go back.

    Args:
        sample_period: time between two samples [s].
        start_ns: the clock's time of the first sample [ns].
        longest_catch_up: samples that are due for longer than this are dropped [s].
    """

    def __init__(self, sample_period: float, start_ns: int, longest_catch_up: float = MAX_CATCH_UP) -> None:
        self._longest_ns = longest_catch_up * 1e9
        self._period_ns = sample_period * 1e9
        self._start_ns = start_ns
        self._done = 0
        self._latest_ns = start_ns
        self.skipped = 0

    def due(self, now_ns: int, most: int | None = None) -> int:
        """Return how many samples are due now, and count them as done.

        Args:
            now_ns: the clock's time [ns].
            most: largest number to return; further samples stay due. None for no limit.
        """
        if now_ns < self._latest_ns:
            self._anchor(now_ns)
        elif now_ns - self._next_ns() > self._longest_ns:
            self.skipped += int((now_ns - self._next_ns()) / self._period_ns)
            self._anchor(now_ns)
        self._latest_ns = now_ns
        count = max(0, int((now_ns - self._start_ns) / self._period_ns) + 1 - self._done)
        if most is not None:
            count = min(count, most)
        self._done += count
        return count

    @property
    def done(self) -> int:
        """Return the number of samples so far."""
        return self._done

    def stamp_ns(self, number: int) -> int:
        """Return the stamp of a sample [ns].

        Args:
            number: counted from the first.
        """
        return self._start_ns + round(number * self._period_ns)

    def _next_ns(self) -> float:
        """Return when the next sample is due [ns]."""
        return self._start_ns + self._done * self._period_ns

    def _anchor(self, now_ns: int) -> None:
        """Let the next sample be due now."""
        self._start_ns = now_ns
        self._done = 0


_LONG_AGO = -(2**62)  # ns
_KEPT_HORIZONS = 100


class DueForces:
    """The compensation of one axis as the stage applies it.

    ``BumplessForces`` is for a controller with integral action and a load above the friction: see ``due_forces``.

    A horizon gives a value for every time up to its end, so a late horizon changes nothing before the end of the one
    before it. The newest horizon that has begun is used. Where none covers a time, single values are used: a message
    of sample time s predicts the friction at s + ``lead``, and is in time if it arrives by then.

    A late or held value is faded to zero within ``timeout``. When messages return, the value is faded in within
    ``timeout``. A value that may push the wrong way is not used: when the set-point has reversed since the time of the
    value, or when the value acts against the motion.

    A value that arrives after one for a later time is ignored.

    A stamp from before the first sample, or from the future, belongs to another clock. Such a message is used as if it
    were made for its arrival time.

    Args:
        lead: time from a message's stamp to its application [s].
        timeout: time in which a late value is faded to zero [s].
        sample_period: time between two samples [s].
        ahead: time from a sample to the middle of the interval in which its force is applied [s]; horizons are read
            there.
    """

    def __init__(self, lead: float, timeout: float, sample_period: float, ahead: float = 0.0) -> None:
        self._lead_ns = round(lead * 1e9)
        self._timeout_ns = round(timeout * 1e9)
        self._grace_ns = round(1.5 * sample_period * 1e9)
        self._ahead_ns = round(ahead * 1e9)
        self._waiting: deque[tuple[int, float]] = deque(maxlen=100_000)
        self._horizons: deque[Horizon] = deque(maxlen=_KEPT_HORIZONS)
        self._horizon: Horizon | None = None
        self._force = 0.0
        self._due_ns = self._newest_ns = _LONG_AGO
        self._direction = 0
        self._latest_ns = self._turned_ns = _LONG_AGO
        self._share = 1.0
        self._first_ns: int | None = None
        self._lock = threading.Lock()  # messages arrive in one thread, the stage steps in another

    def put(self, stamp_ns: int, force: float, now_ns: int) -> None:
        """Add a single value.

        Args:
            stamp_ns: its stamp [ns].
            force: compensation [N]; ignored unless finite.
            now_ns: the stage's clock [ns].
        """
        if not math.isfinite(force):
            return
        due = stamp_ns + self._lead_ns
        if self._first_ns is None or not self._first_ns <= stamp_ns <= now_ns + self._timeout_ns:
            due = now_ns
        with self._lock:
            if due < self._newest_ns <= now_ns + self._lead_ns + self._timeout_ns:
                return  # a newer one arrived first
            while self._waiting and self._waiting[-1][0] > due:
                self._waiting.pop()  # messages of an earlier clock
            self._waiting.append((due, force))
            self._newest_ns = due

    def put_horizon(self, horizon: Horizon) -> None:
        """Add a horizon.

        Args:
            horizon: the compensation of the time to come; ignored unless all of it is finite and in order.
        """
        if len(horizon.time_ns) and np.isfinite(horizon.effort).all() and (np.diff(horizon.time_ns) > 0).all():
            with self._lock:
                self._horizons.append(horizon)

    def at(self, stamps: Ints, direction: int = 0) -> Floats:
        """Return the force at each sample [N].

        Args:
            stamps: sample times [ns], shape (n,), not before those of the last call.
            direction: sign of the set-point's velocity; 0 at rest or where it is not known.
        """
        if self._first_ns is None and len(stamps):
            self._first_ns = int(stamps[0])
        forces = np.zeros(len(stamps))
        if direction * self._direction < 0:
            self._turned_ns = self._latest_ns
        self._direction = direction or self._direction
        with self._lock:
            for k, stamp in enumerate(stamps.tolist()):
                forces[k] = self._single(stamp)
                value = self._from_horizon(stamp + self._ahead_ns)
                if value is not None:
                    forces[k] = value
                self._latest_ns = stamp
        return forces

    def _from_horizon(self, time_ns: int) -> float | None:
        """Return the value of the newest horizon that has begun [N]; None beyond its end."""
        while self._horizons and int(self._horizons[0].time_ns[0]) <= time_ns:
            found = self._horizons.popleft()
            if self._horizon is None or found.time_ns[0] >= self._horizon.time_ns[0] or self._is_over(time_ns):
                self._horizon = found
        if self._horizon is None or self._is_over(time_ns):
            return None
        times = self._horizon.time_ns
        place = int(np.searchsorted(times, time_ns, side="right"))
        begin, end = self._horizon.effort[place - 1], self._horizon.effort[min(place, len(times) - 1)]
        if place == len(times):
            return float(begin)
        return float(begin + (end - begin) * ((time_ns - times[place - 1]) / (times[place] - times[place - 1])))

    def _is_over(self, time_ns: int) -> bool:
        """Return whether the horizon in use ends before this time."""
        return self._horizon is not None and int(self._horizon.time_ns[-1]) < time_ns

    def _single(self, stamp: int) -> float:
        """Return the force of the single values [N], and advance by one sample."""
        while self._waiting and self._waiting[0][0] <= stamp:
            self._due_ns, self._force = self._waiting.popleft()
        elapsed = min(max(0, stamp - self._latest_ns), self._timeout_ns)
        step = elapsed / self._timeout_ns if self._latest_ns > _LONG_AGO else 0.0
        age = stamp - self._due_ns
        if age <= self._grace_ns or self._due_ns == _LONG_AGO:
            wanted = 1.0
        elif self._force * self._direction < 0.0 or self._turned_ns > self._due_ns:
            wanted = self._share = 0.0
        else:
            wanted = max(0.0, 1.0 - age / self._timeout_ns)
        self._share += min(max(wanted - self._share, -step), step)
        return self._share * self._force


_RELEASE_RATIO = 100.0
"""Time of the release over the controller's integral time [-]. The ramp changes the tracking error by 1 % of the held
force over the controller's position gain."""

_LOADS = frozenset({"offset", "gravity"})
"""Effects whose force hardly changes along a motion; the first value of each is its size."""


class BumplessForces(DueForces):
    """The compensation of one axis as the stage applies it to a controller whose integral action carries a load.

    The integral action supplies the force that the compensation does not. So a constant compensation changes no
    tracking error, even if its value is wrong, but a step of it is a disturbance. A late message causes no step here:

    * While no value for the present has arrived, the last output is held.
    * When values return, or come from another horizon than the next one, the output continues from the last one, and
      the difference decays within ``release``.
    * After ``MAX_CATCH_UP`` without a value the held output decays to zero within ``release``.
    * A value of exactly zero is used at once: the observer is switched off or stops, and has limited the slew itself.

    Args:
        lead: time from a message's stamp to its application [s].
        timeout: the last part of a horizon that is not used [s]; it fades for an observer that has stopped.
        sample_period: time between two samples [s].
        ahead: time from a sample to the middle of the interval in which its force is applied [s].
        release: time in which a held output, or its difference to the values, decays to zero [s].
        limit: largest magnitude of the output [N].
    """

    def __init__(
        self, lead: float, timeout: float, sample_period: float, ahead: float, release: float, limit: float
    ) -> None:
        super().__init__(lead, timeout, sample_period, ahead)
        self._release_ns = round(release * 1e9)
        self._limit = limit
        self._output = self._difference = self._decay = 0.0
        self._covered_ns = _LONG_AGO
        self._is_held = True
        self._source: Horizon | None = None  # of the last value; None for single values

    def at(self, stamps: Ints, direction: int = 0) -> Floats:
        """Return the force at each sample [N].

        Args:
            stamps: sample times [ns], shape (n,), not before those of the last call.
            direction: not used: a held force is right or wrong by a constant, which the integral action supplies.
        """
        if self._first_ns is None and len(stamps):
            self._first_ns = int(stamps[0])
        forces = np.zeros(len(stamps))
        with self._lock:
            for k, stamp in enumerate(stamps.tolist()):
                elapsed = max(0, stamp - self._latest_ns) if self._latest_ns > _LONG_AGO else 0
                forces[k] = self._output = self._next(stamp, elapsed / self._release_ns)
                self._latest_ns = stamp
        return forces

    def _next(self, stamp: int, share: float) -> float:
        """Return the next output [N].

        Args:
            stamp: time of the sample [ns].
            share: elapsed time over the time of the release [-].
        """
        before = self._source
        value = self._present(stamp)
        if value is None:
            if not self._is_held:
                self._is_held, self._decay = True, abs(self._output)
            is_silent = stamp - self._covered_ns > round(MAX_CATCH_UP * 1e9)
            return _toward_zero(self._output, self._decay * share) if is_silent else self._output
        self._covered_ns = stamp
        if value == 0.0:
            self._is_held, self._difference = False, 0.0
            return 0.0
        if self._is_held or self._may_jump(before, stamp + self._ahead_ns):
            self._is_held, self._difference = False, self._output - value
            self._decay = abs(self._difference)
        self._difference = _toward_zero(self._difference, self._decay * share)
        return min(max(value + self._difference, -self._limit), self._limit)

    def _present(self, stamp: int) -> float | None:
        """Return the value that was made for this sample [N]; None if there is none."""
        while self._waiting and self._waiting[0][0] <= stamp:
            self._due_ns, self._force = self._waiting.popleft()
        time_ns = stamp + self._ahead_ns
        value, horizon = self._from_horizon(time_ns), self._horizon
        if value is not None and horizon is not None and time_ns <= horizon.fades_from_ns(self._timeout_ns):
            self._source = horizon
            return value
        if stamp - self._due_ns > self._grace_ns:
            return None
        self._source = None
        return self._force

    def _may_jump(self, before: Horizon | None, time_ns: int) -> bool:
        """Return whether the values come from another source now, and not from the next horizon at its begin.

        A horizon may have replaced another one after its own begin, horizons in between may be missing, and the single
        values after a horizon may be of another state of the observer.
        """
        if before is self._source:
            return False
        if before is None or self._source is None:
            return True
        begin = int(self._source.time_ns[0])
        is_next = round((begin - int(before.time_ns[0])) / (1e9 * EVERY)) <= 1
        return time_ns - begin > self._grace_ns or not is_next


def _toward_zero(value: float, step: float) -> float:
    """Return a value that is smaller in magnitude by ``step``, at least 0."""
    return math.copysign(max(0.0, abs(value) - step), value)


def due_forces(axis: AxisSettings, sample_period: float) -> DueForces:
    """Return what applies the compensation of an axis to its simulated controller.

    The axis may reverse while messages are missing. Held, the compensation is then wrong by twice the static force;
    faded, by the static force and the load. The smaller one is chosen, where integral action can carry a load at all.

    Args:
        axis: the axis.
        sample_period: time between two samples [s].
    """
    compensation, delay = axis.compensation, axis.stage.actuation_delay
    lead, ahead = max(0.0, compensation.look_ahead - delay), delay + 0.5 * sample_period
    rate = axis.stage.controller.integral_rate
    load = sum(abs(effect.values[0]) for effect in axis.effects if effect.name in _LOADS)
    if rate == 0.0 or load <= axis.friction.static_force:
        return DueForces(lead, compensation.timeout, sample_period, ahead)
    release = _RELEASE_RATIO / (2.0 * math.pi * rate)
    return BumplessForces(lead, compensation.timeout, sample_period, ahead, release, compensation.limit)
