"""Which samples got their compensation late is computed from what was sent and what was applied."""

from __future__ import annotations

import numpy as np

from sgms_observer.compensation.horizon import EVERY, Horizon, grid_of
from sgms_observer.nodes.pace import DueForces
from sgms_observer.report.recorded import RECOVERY, Sent, judge_lateness
from sgms_observer.settings.axis import CompensationSettings

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
    horizons = [
        Horizon(begin * MS + np.arange(0, 120, 2) * MS, np.arange(begin, begin + 120, 2.0)) for begin in (0, 50, 100)
    ]
    applied = np.concatenate([np.arange(200) + 0.5, np.zeros(200)])
    applied[150] = 7.0
    way = judge_lateness(stamps, stamps, applied, Sent(stamps, single, 5e-3, horizons, 0.5e-3))
    assert np.flatnonzero(way.is_late).tolist() == [150]


def test_the_fading_end_of_a_horizon_is_late_where_newer_ones_did_not_come() -> None:
    settings, every = CompensationSettings(), round(EVERY * 1e3)
    time, first = grid_of(settings.look_ahead, settings.horizon, 1e-3)
    ahead = np.rint(1e9 * time[first:]).astype(np.int64)
    fading = np.minimum(1.0, (time[-1] - time[first:]) / settings.timeout)
    sent = {begin: Horizon(begin * MS + ahead, fading) for begin in range(0, 1500, every)}
    stamps = np.arange(1500, dtype=np.int64) * MS
    stage = DueForces(settings.look_ahead, settings.timeout, 1e-3)
    applied = np.zeros(1500)
    lost = range(500, 900)  # nothing reaches the stage in this time; all of it is in the recording
    for k in range(1500):
        if k in sent and k not in lost:
            stage.put_horizon(sent[k])
        applied[k] = stage.at(stamps[k : k + 1])[0]
    meant = [one.without_fading_end(settings, 1e-3) for one in sent.values()]
    way = judge_lateness(stamps, stamps, applied, Sent(stamps, np.ones(1500), settings.look_ahead, meant))
    last = max(k for k in sent if k < lost[0])
    fades_ms = last + 1e3 * (settings.horizon - settings.timeout)
    again_ms = lost[-1] + 1 + 1e3 * settings.look_ahead
    assert np.flatnonzero(way.is_late).tolist() == list(range(round(fades_ms) + 1, round(again_ms)))


def test_a_horizon_that_ends_with_its_reference_is_meant_to_fade() -> None:
    settings = CompensationSettings()
    time, first = grid_of(settings.look_ahead, settings.horizon, 1e-3)
    whole = Horizon(np.rint(1e9 * time[first:]).astype(np.int64), np.ones(len(time) - first))
    shorter = Horizon(whole.time_ns[:-1], whole.effort[:-1])
    assert shorter.without_fading_end(settings, 1e-3) is shorter
    rest = whole.without_fading_end(settings, 1e-3)
    assert (whole.time_ns[-1] - rest.time_ns[-1]) == round(settings.timeout * 1e9)
