"""A simulated axis whose observer is behind a network that delays, loses and bunches messages."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.compensation.horizon import EVERY, Horizon, KnownMotion
from sgms_observer.nodes.horizons import BEFORE
from sgms_observer.nodes.pace import due_forces
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.settings.axis import AxisSettings, Settings
from sim_plant.table import SimulatedTable

START_NS = 10**12
PERIOD = 5.0e-4
"""Sample period of every axis here [s], also of the demonstration's axis, which has 1 ms in its file."""
SETTLE = 0.2
"""The compensation is on from half of this [s] on, and peaks count from all of it on."""


@dataclass(frozen=True)
class Trouble:
    """What happens to the messages from one time to another.

    Attributes:
        begin: [s].
        length: [s].
        delay: of each message [s].
        jitter: largest further delay, drawn for each message, so that later ones overtake earlier ones [s].
        lost: share of the messages that never come.
        is_bunched: whether all of them come together, ``delay`` after the end.
    """

    begin: float
    length: float
    delay: float = 0.0
    jitter: float = 0.0
    lost: float = 0.0
    is_bunched: bool = False


def delays(troubles: Sequence[Trouble], count: int, seed: int, period: float = PERIOD) -> Floats:
    """Return how long each message takes [s]; NaN for one that is lost."""
    time = period * np.arange(count)
    found = np.full(count, 1e-3)
    draw, further = np.random.default_rng(seed).random((2, count))
    for trouble in troubles:
        inside = (time >= trouble.begin) & (time < trouble.begin + trouble.length)
        found[inside] += trouble.delay + trouble.jitter * further[inside]
        if trouble.is_bunched:
            found[inside] += trouble.begin + trouble.length - time[inside]
        found[inside & (draw < trouble.lost)] = np.nan
    return found


def largest_error(
    axis: AxisSettings,
    seconds: float,
    troubles: Sequence[Trouble] = (),
    *,
    is_compensated: bool = True,
    is_known_ahead: bool = False,
    seed: int = 0,
    period: float = PERIOD,
    settle: float = SETTLE,
) -> float:
    """Return the peak of the tracking error of one run [m].

    Args:
        axis: the axis.
        seconds: length of the run [s].
        troubles: of the network.
        is_compensated: whether the compensation is on from half of ``settle`` on.
        is_known_ahead: whether the observer gets the reference ahead, and gives horizons.
        seed: of losses and jitter.
        period: time between two samples [s].
        settle: errors count from then on [s].
    """
    off = replace(axis, compensation=replace(axis.compensation, enabled=False))
    observer = AxisObserver(off, period)
    table = SimulatedTable(Settings(axes=(off,), sample_period=period), START_NS)
    due = due_forces(axis, period)
    count, every = round(seconds / period), round(EVERY / period)
    way = delays(troubles, count, seed, period)
    arrivals: list[tuple[int, int, float | Horizon]] = []
    direction, error = 0, np.empty(count)
    for k in range(count):
        stamp = START_NS + round(k * period * 1e9)
        while arrivals and arrivals[0][0] <= stamp:
            now, sent, value = heapq.heappop(arrivals)
            if isinstance(value, Horizon):
                due.put_horizon(value)
            else:
                due.put(START_NS + round((sent // 2) * period * 1e9), value, now)
        (record,) = table.step(1, [due.at(np.array([stamp]), direction)])
        direction = int(np.sign(record.reference_velocity[0]))
        error[k] = record.position[0] - record.reference_position[0]
        if is_compensated and k == round(0.5 * settle / period):
            observer.compensator.configure(replace(axis.compensation, enabled=True))
        estimates = observer.step(record.samples)
        if not np.isnan(way[k]):
            arrives = stamp + round(way[k] * 1e9)
            heapq.heappush(arrivals, (arrives, 2 * k, float(estimates.compensation[0])))
            if is_known_ahead and k % every == 0:
                ahead = np.arange(-BEFORE, axis.compensation.horizon + 2 * EVERY, 1e-3)
                position, velocity = table.stages[0].reference_ahead(ahead)
                times = stamp + round(period * 1e9) + np.rint(ahead * 1e9).astype(np.int64)
                horizon = observer.horizon(estimates, KnownMotion(times, position, velocity), axis.compensation.horizon)
                if horizon is not None:
                    heapq.heappush(arrivals, (arrives, 2 * k + 1, horizon))
    return float(np.max(np.abs(error[round(settle / period) :])))
