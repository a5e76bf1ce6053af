"""Which samples got their compensation late is computed from what was sent and what was applied."""

from __future__ import annotations

import numpy as np

from sgms_observer.report.recorded import RECOVERY, Sent, judge_lateness

MS = 1_000_000


def test_in_time_is_what_was_meant_for_that_time() -> None:
    stamps = np.arange(400, dtype=np.int64) * MS
    sent = np.sin(np.arange(400) * 0.3)
    applied = np.concatenate([np.zeros(5), sent[:-5]])
    way = judge_lateness(stamps, stamps, applied, Sent(stamps, sent, 5e-3))
    assert way.is_known and not way.is_late.any() and way.is_clear.all()


def test_held_forces_are_late_and_so_is_what_follows_for_a_while() -> None:
    stamps = np.arange(400, dtype=np.int64) * MS
    sent = np.sin(np.arange(400) * 0.3)
    applied = np.concatenate([np.zeros(5), sent[:-5]])
    applied[200:210] = applied[199]
    way = judge_lateness(stamps, stamps, applied, Sent(stamps, sent, 5e-3))
    assert np.flatnonzero(way.is_late).tolist() == list(range(200, 210))
    blocked = np.flatnonzero(~way.is_clear)
    assert blocked[0] == 200 and blocked[-1] == 209 + round(RECOVERY * 1e3) - 1


def test_a_recording_that_does_not_tell_is_not_judged() -> None:
    stamps = np.arange(10, dtype=np.int64) * MS
    way = judge_lateness(stamps, stamps, np.full(10, np.nan), Sent(stamps, np.ones(10), 0.0))
    assert not way.is_known and not way.is_late.any()


def test_what_a_horizon_says_of_the_time_is_in_time() -> None:
    stamps = np.arange(400, dtype=np.int64) * MS
    single = np.zeros(400)
    horizons = [(begin * MS + np.arange(0, 120, 2) * MS, np.arange(begin, begin + 120, 2.0)) for begin in (0, 50, 100)]
    applied = np.concatenate([np.arange(200) + 0.5, np.zeros(200)])
    applied[150] = 7.0
    way = judge_lateness(stamps, stamps, applied, Sent(stamps, single, 5e-3, horizons, 0.5e-3))
    assert np.flatnonzero(way.is_late).tolist() == [150]
