"""Every fault through the node's own path without ROS, and any samples whatever through ``AxisObserver.step``."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from fault_streams import FAULTS, PERIOD, SECOND, STEP, Sent, clean, rows
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sgms_observer.nodes.engine import Engine
from sgms_observer.nodes.watchdog import Watchdog
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import Settings
from sgms_observer.settings.load import settings_from_tree
from sgms_observer.status import Status

START = 1_700_000_000 * SECOND
LIMIT, SLEW, TIMEOUT = 3.0, 200.0, 0.05
BEFORE, DURING, AFTER = 800, 300, 1000
FILTERS = {"savgol": "mhe", "kalman": "ekf", "lowpass": "mhe"}


def axis_settings(filter_kind: str, **more: Any) -> Settings:
    """Return settings of an axis at 1 kHz whose compensation is on."""
    axis = {
        "mass": 3.0,
        "filter": {"kind": filter_kind, "window": 8e-3, "position_noise": 1e-6, "lag": 2e-3, "cutoff": 100.0},
        "estimator": {"kind": FILTERS[filter_kind], "correction_every": 2, "parameters": ["kappa"]},
        "compensation": {"enabled": True, "limit": LIMIT, "slew_limit": SLEW, "timeout": TIMEOUT},
    }
    return settings_from_tree({"sample_period": PERIOD, "axes": ["x"], "x": {**axis, **more}})


class Run:
    """An engine that is fed messages; what it publishes is kept.

    Args:
        settings: of the engine.
    """

    def __init__(self, settings: Settings) -> None:
        self.engine = Engine(settings)
        intake = self.engine.intake
        self._take = {
            "position": intake.position,
            "control_effort": intake.effort,
            "reference": intake.reference,
        }

    def feed(self, messages: Iterable[Sent]) -> dict[str, np.ndarray]:
        """Take in messages; return the stamps [ns], forces [N] and frictions [N] that come out."""
        found: dict[str, list[Any]] = {"stamp": [], "force": [], "friction": []}
        for topic, data in messages:
            self._take[topic](data)
        for block in self.engine.process().blocks:
            if block.topic == "friction_compensation":
                found["stamp"] += block.stamp_ns.tolist()
                found["force"] += block.values["effort"][:, 0].tolist()
            if block.topic == "friction_estimate":
                found["friction"] += [value for values in block.values.values() for value in values.ravel().tolist()]
        return {name: np.array(v, np.int64 if name == "stamp" else np.float64) for name, v in found.items()}


def rests_at_zero(*forces: np.ndarray) -> bool:
    """Return whether the force ever rested at zero; passing through on its way it does not meet it exactly."""
    return bool((np.concatenate(forces) == 0.0).any())


@pytest.mark.parametrize("filter_kind", FILTERS)
def test_every_fault(filter_kind: str) -> None:
    run = Run(axis_settings(filter_kind))
    last_stamp, last_force = START - SECOND, 0.0
    for number, fault in enumerate(FAULTS):
        during = DURING * fault.factor
        samples = rows(START + number * 60 * SECOND, 0, BEFORE + during + AFTER)
        before = run.feed(clean(samples[:BEFORE]))
        found = run.feed(fault.make(samples[BEFORE : BEFORE + during]))
        after = run.feed(clean(samples[BEFORE + during :]))
        for part in (before, found, after):
            assert np.isfinite(part["friction"]).all(), fault.name
            assert np.isfinite(part["force"]).all(), fault.name
            assert np.abs(part["force"]).max(initial=0.0) <= LIMIT, fault.name
            steps = np.abs(np.diff(part["force"], prepend=last_force))
            seconds = np.diff(part["stamp"], prepend=last_stamp) * 1e-9
            allowed = np.where((seconds > 0.0) & (seconds <= 0.02), seconds, PERIOD)
            assert (steps <= SLEW * allowed * (1.0 + 1e-6)).all(), fault.name
            if len(part["force"]):
                last_stamp, last_force = part["stamp"][-1], part["force"][-1]
        assert np.abs(before["force"]).max() == LIMIT
        if fault.ends_trust and not fault.is_slow:
            assert rests_at_zero(found["force"], after["force"]), f"{fault.name}: the compensation did not end"
        assert run.engine.statistics[0].latest is Status.RUNNING, fault.name
        assert np.abs(after["force"][-500:]).max() == LIMIT, f"{fault.name}: the compensation did not recover"
        slides = math.copysign(4.06, samples[-1].set_velocity)
        assert after["friction"][-1] == pytest.approx(slides, abs=0.25), fault.name


def test_faults_are_counted() -> None:
    run = Run(axis_settings("savgol"))
    for number, fault in enumerate(FAULTS):
        samples = rows(START + number * 60 * SECOND, 0, BEFORE)
        counts = _counts(run)
        run.feed(clean(samples[:400]))
        run.feed(fault.make(samples[400:700]))
        run.feed(clean(samples[700:]))
        if fault.sentence and fault.name != "the publisher is gone":
            assert _counts(run) != counts, f"{fault.name} was not counted"


def _counts(run: Run) -> tuple[object, ...]:
    """Return everything that tells of trouble."""
    pairing = run.engine.intake.pairings[0].counts
    intake = run.engine.intake.counts
    statistics = run.engine.statistics[0]
    kinds = [Status.PREDICTING, Status.SAMPLE_REJECTED, Status.RESTARTED_AFTER_JUMP, Status.TOO_DENSE]
    high_nis = statistics.nis > 5.0
    statistics.start_anew()
    return (
        *pairing.sentences(), *intake.sentences(["x"]), high_nis, *[statistics.totals.get(kind, 0) for kind in kinds]
    )  # fmt: skip


anything = st.floats(allow_nan=True, allow_infinity=True)
near = st.floats(-1e-2, 1e-2)
values = st.one_of(near, anything, st.sampled_from([math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324]))
steps_ns = st.one_of(
    st.just(1_000_000), st.integers(0, 3_000_000), st.integers(-(2**40), 2**40), st.integers(-(2**62), 2**62)
)
blocks = st.lists(st.tuples(steps_ns, values, values, values, values), max_size=40)

_OBSERVERS = {
    kind: AxisObserver(axis_settings(kind, effects=effects).axes[0], PERIOD)
    for kind, effects in (("savgol", {"names": ["cogging", "offset"]}), ("kalman", {}), ("lowpass", {"names": []}))
}


def is_used(position: float) -> bool:
    """Return whether a position is one that the filters take: only then does time go on for them."""
    return abs(position) < 1.0e9


@settings(max_examples=600, deadline=None, suppress_health_check=list(HealthCheck))
@given(kind=st.sampled_from(list(FILTERS)), good=st.integers(0, 120), parts=st.lists(blocks, min_size=1, max_size=4))
def test_no_samples_whatever_pass_the_last_stage(kind: str, good: int, parts: list[list[tuple[Any, ...]]]) -> None:
    """From any point of a good motion on, anything: NaN, infinities, any stamps, in any blocks."""
    observer = _OBSERVERS[kind]
    observer.reset()
    observer.compensator.continue_from(0.0)
    stamp, latest = START, None
    previous = 0.0
    motion = [(STEP, r.position, r.effort, r.set_point, r.set_velocity) for r in rows(0, 0, good)]
    for part in [motion, *parts]:
        stamps = []
        for step, *_ in part:
            stamp = min(max(stamp + step, -(2**62)), 2**62)
            stamps.append(stamp)
        columns = [np.array([row[i] for row in part], dtype=float) for i in range(1, 5)]
        estimates = observer.step(Samples(np.array(stamps, dtype=np.int64), *columns))
        for at, position, force in zip(stamps, columns[0].tolist(), estimates.compensation.tolist(), strict=True):
            assert math.isfinite(force)
            assert abs(force) <= LIMIT
            elapsed = None if latest is None else (at - latest) * 1e-9
            is_new = elapsed is None or abs(elapsed) > 0.02
            allowed = SLEW * (PERIOD if is_new else max(elapsed, 0.0))
            assert abs(force - previous) <= allowed * (1.0 + 1e-6) + 1e-12
            previous = force
            if is_used(position) and (elapsed is None or elapsed > 0.0 or elapsed < -1.0):
                latest = at


def test_a_silent_axis_ends_at_zero_beside_a_busy_one() -> None:
    tree = {"enabled": True, "limit": LIMIT, "slew_limit": SLEW, "timeout": TIMEOUT}
    both = settings_from_tree({"axes": ["x", "y"], "x": {"compensation": tree}, "y": {"compensation": tree}})
    watchdog = Watchdog(both.axes, 0.0)
    now = 0.0
    watchdog.feed(0, 2.0, now)
    watchdog.feed(1, -2.0, now)
    told: list[float] = []
    while now < 0.2:
        now += 0.01
        watchdog.feed(0, 2.0, now)
        forces = watchdog.silent(now)
        assert set(forces) <= {1}
        told += [forces[1]] if forces else []
    assert told == [0.0], "200 N/s bring 2 N to zero in the first 60 ms"
    assert watchdog.outputs == [2.0, 0.0]
    slow = settings_from_tree({"x": {"compensation": {**tree, "slew_limit": 10.0}}})
    watchdog = Watchdog(slow.axes, 0.0)
    watchdog.feed(0, 2.0, 0.0)
    outputs = [watchdog.outputs[0]]
    for i in range(1, 40):
        watchdog.silent(0.01 * i)
        outputs.append(watchdog.outputs[0])
    assert outputs[5] == 2.0 and outputs[-1] == 0.0
    assert np.abs(np.diff(outputs[7:])).max() <= 0.1 + 1e-12


def test_the_compensation_goes_on_from_what_really_went_out() -> None:
    """After the watchdog let go, the first samples may not bring the old force back at once."""
    run = Run(axis_settings("savgol"))
    samples = rows(START, 0, 3000)
    force = run.feed(clean(samples[:1000]))["force"][-1]
    assert abs(force) == LIMIT
    run.engine.continue_compensation(0, 0.0)
    after = run.feed(clean(samples[1300:]))["force"]
    assert abs(after[0]) <= SLEW * PERIOD
    assert np.abs(after).max() == LIMIT
