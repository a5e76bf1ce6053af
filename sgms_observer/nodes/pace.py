"""How many samples are due: computed from the elapsed time, never one per tick. No ROS in here."""

from __future__ import annotations

LONGEST_CATCH_UP = 0.5
"""A clock that leaps further than this [s] was stopped, set or asleep: the samples in between are given up."""

LONGEST_LAG_OF_FOLLOWER = 60.0
"""The same for an axis that follows set-points: it may lag behind the clock, but what it is to follow must not leap."""

AGE_SENTENCE = "the compensation arrived"
"""How the stage node's note on the way's delay begins, for those who quote it."""


class Pace:
    """Follows a clock that may stand still, run slow, leap or go back.

    Args:
        sample_period: time between two samples [s].
        start_ns: the clock's time of the first sample [ns].
        longest_catch_up: samples that are due for longer than this are given up [s].
    """

    def __init__(self, sample_period: float, start_ns: int, longest_catch_up: float = LONGEST_CATCH_UP) -> None:
        self._longest_ns = longest_catch_up * 1e9
        self._period_ns = sample_period * 1e9
        self._start_ns = start_ns
        self._done = 0
        self._latest_ns = start_ns
        self.skipped = 0
        self.resets = 0

    def due(self, now_ns: int, most: int | None = None) -> int:
        """Return how many samples are due now, and count them as done.

        Args:
            now_ns: the clock's time [ns].
            most: the samples beyond this many stay due; None for all of them.
        """
        if now_ns < self._latest_ns:
            self.resets += 1
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
