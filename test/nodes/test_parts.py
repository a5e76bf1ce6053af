"""The parts of the nodes that need no ROS: intake, pace, statistics, reports, rows to publish."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, replace
from itertools import cycle

import numpy as np
import pytest

from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.diagnostics_cdr import ERROR, WARN
from sgms_observer.nodes.engine import Engine, parameter_changes
from sgms_observer.nodes.intake import Intake, IntakeCounts
from sgms_observer.nodes.pace import MAX_CATCH_UP, Pace
from sgms_observer.nodes.report import NO_SAMPLES, axis_entry
from sgms_observer.nodes.statistics import AxisStatistics, Growth, Sentences, StepClock
from sgms_observer.nodes.transport import claim_domain
from sgms_observer.observer.outgoing import COMPENSATION, ELEMENTS, ESTIMATE, Outgoing, OutgoingBlock
from sgms_observer.observer.pairing import PairingCounts
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.load import settings_from_tree
from sgms_observer.settings.units import Scales
from sgms_observer.status import Status

SECOND = 1_000_000_000


def estimates(stamps: list[int], status: Status = Status.RUNNING) -> Estimates:
    """Return made-up estimates with these stamps."""
    n = len(stamps)
    ramp = np.arange(n, dtype=float)
    return Estimates(
        stamp_ns=np.array(stamps, dtype=np.int64),
        **{
            name: ramp + i
            for i, name in enumerate(("position", "velocity", "acceleration", "friction", "friction_std"))
        },
        element_force=np.tile(ramp[:, None], (1, 4)),
        element_deflection=np.tile(ramp[:, None], (1, 4)),
        parameters=np.ones((n, 1)),
        parameter_std=np.ones((n, 1)),
        innovation=np.full(n, 2.0),
        innovation_std=np.ones(n),
        compensation=ramp,
        status=np.full(n, status, dtype=np.uint8),
    )


def complete_samples(intake: Intake) -> Iterator[tuple[int, Samples]]:
    """Yield the number of an axis and its complete samples, until there are no more."""
    for number, pairing in enumerate(intake.pairings):
        while (samples := pairing.pop()) is not None:
            yield number, samples


class TestIntake:
    """Names, order of arrival, and messages that are wrong."""

    def test_axes_are_found_by_name_in_any_order(self) -> None:
        intake = Intake(["x", "y"], 1.0e-3)
        for names, position in ((("y", "z", "x"), (2.0, 9.0, 1.0)), (("x", "y"), (1.0, 2.0))):
            stamp = SECOND * len(names)
            intake.effort(JointStateEncoder(names, ("effort",)).encode(stamp, position))
            intake.position(JointStateEncoder(names, ("position",)).encode(stamp, position))
        found = {number: samples.position.tolist() for number, samples in complete_samples(intake)}
        assert found == {0: [1.0], 1: [2.0]} or found == {0: [1.0, 1.0], 1: [2.0, 2.0]}

    @pytest.mark.parametrize("message", [b"", b"\x00\x01\x00\x00", b"\x00\x01" + bytes(20) + b"\xff" * 30])
    def test_garbage_is_counted(self, message: bytes) -> None:
        intake = Intake(["x"], 1.0e-3)
        for take in (intake.position, intake.effort, intake.position_and_effort, intake.reference):
            assert not take(message)
        assert intake.counts.malformed == 4 and not list(complete_samples(intake))

    def test_foreign_and_short_messages_are_counted_and_told(self) -> None:
        intake = Intake(["x"], 1.0e-3)
        assert not intake.position(JointStateEncoder(["other"], ("position",)).encode(1, [1.0]))
        intake.position(JointStateEncoder(["x"], ("effort",)).encode(2, [1.0]))
        assert (intake.counts.foreign, intake.counts.short) == (1, 1)
        assert len(intake.counts.sentences(["x"])) == 2

    def test_nothing_is_counted_of_good_messages(self) -> None:
        intake = Intake(["x"], 1.0e-3)
        assert asdict(intake.counts) == dict.fromkeys(asdict(intake.counts), 0) and intake.counts.sentences(["x"]) == ()
        assert not intake.reference(JointStateEncoder(["x"], ("position", "velocity")).encode(SECOND, [3.0], [4.0]))
        assert not intake.effort(JointStateEncoder(["x"], ("effort",)).encode(SECOND, [2.0]))
        assert intake.position(JointStateEncoder(["x"], ("position",)).encode(SECOND, [1.0]))
        ((number, samples),) = complete_samples(intake)
        columns = samples.position, samples.effort, samples.reference_position, samples.reference_velocity
        assert (number, [column.tolist() for column in columns]) == (0, [[1.0], [2.0], [3.0], [4.0]])
        assert asdict(intake.counts) == {**dict.fromkeys(asdict(intake.counts), 0), "messages": 3}

    @pytest.mark.parametrize("name", [name for name in asdict(IntakeCounts()) if name != "messages"])
    def test_each_trouble_is_told_in_one_sentence_with_its_count(self, name: str) -> None:
        (sentence,) = IntakeCounts(messages=9, **{name: 3}).sentences(["x"])
        assert sentence.startswith("3 ") and len(sentence.split()) > 5

    def test_one_topic_may_carry_position_and_effort(self) -> None:
        intake = Intake(["y", "x"], 1.0e-3)
        both = JointStateEncoder(["x", "other"], ("position", "effort"))
        assert intake.position_and_effort(both.encode(SECOND, [1.0, 9.0], [2.0, 9.0]))
        ((number, samples),) = complete_samples(intake)
        assert (number, samples.position.tolist(), samples.effort.tolist()) == (1, [1.0], [2.0])
        assert (intake.counts.short, intake.counts.foreign) == (0, 0)
        for fields in (("position",), ("effort",), ("velocity",)):
            intake.position_and_effort(JointStateEncoder(["x"], fields).encode(2 * SECOND, [1.0]))
        assert (intake.counts.short, intake.pairings[1].counts.samples) == (3, 2)

    @pytest.mark.parametrize("topic", ["position", "effort", "reference"])
    def test_a_number_that_a_name_has_not_is_short_and_nothing_else(self, topic: str) -> None:
        intake = Intake(["x", "y"], 1.0e-3)
        field = "effort" if topic == "effort" else "position"
        take = getattr(intake, topic)
        take(JointStateEncoder(["a", "x"], (field,)).encode(SECOND, [5.0, 6.0]))
        assert intake.counts.short == 0
        take(JointStateEncoder(["a", "x"], ("velocity",)).encode(2 * SECOND, [5.0, 6.0]))
        take(JointStateEncoder(["x", "a"], ("velocity",)).encode(3 * SECOND, [5.0, 6.0]))
        assert intake.counts.short == 2 and sum(asdict(intake.pairings[1].counts).values()) == 0

    def test_a_set_point_may_leave_its_velocity_out(self) -> None:
        intake = Intake(["x"], 1.0e-3)
        intake.reference(JointStateEncoder(["x"], ("position",)).encode(SECOND, [3.0]))
        intake.effort(JointStateEncoder(["x"], ("effort",)).encode(SECOND, [2.0]))
        intake.position(JointStateEncoder(["x"], ("position",)).encode(SECOND, [1.0]))
        ((_, samples),) = complete_samples(intake)
        assert samples.reference_position.tolist() == [3.0] and np.isnan(samples.reference_velocity).all()

    def test_an_axis_that_is_named_twice_counts_once_with_its_first_entry(self) -> None:
        intake = Intake(["x", "y"], 1.0e-3)
        for names in (("y", "x", "x"), ("y", "x", "x"), ("z", "z", "x", "y")):
            intake.position(JointStateEncoder(names, ("position",)).encode(SECOND, list(range(len(names)))))
        assert intake.counts.repeated_names == 1  # of a list of names, not of every message with it
        intake.effort(JointStateEncoder(["x"], ("effort",)).encode(SECOND, [2.0]))
        ((number, samples),) = complete_samples(intake)
        assert (number, samples.position.tolist()) == (0, [1.0])

    def test_samples_are_in_si(self) -> None:
        intake = Intake({"x": Scales(2.0, 10.0)}, 1.0e-3)
        intake.position_and_effort(JointStateEncoder(["x"], ("position", "effort")).encode(SECOND, [1.0], [1.0]))
        ((_, samples),) = complete_samples(intake)
        assert (samples.position.tolist(), samples.effort.tolist()) == ([2.0], [10.0])

    def test_memory_of_names_is_bounded(self) -> None:
        intake = Intake(["x"], 1.0e-3)
        for i in range(300):
            intake.position(JointStateEncoder([f"a{i}", "x"], ("position",)).encode(i + 1, [0.0, 1.0]))
        assert len(intake._known) < 100 and intake.counts.short == 0


class TestPace:
    """Samples due by the clock, whatever it does."""

    def test_late_turns_give_every_sample_once(self) -> None:
        pace = Pace(1.0e-4, 5)
        generator = np.random.default_rng(1)
        now, total = 5, 0
        for _ in range(500):
            total += pace.due(now)
            assert pace.stamp_ns(total - 1) <= now < pace.stamp_ns(total)
            now += int(generator.integers(0, 20_000_000))
        assert pace.done == total and pace.skipped == 0

    def test_a_clock_that_stands_gives_nothing_more(self) -> None:
        pace = Pace(1.0e-3, 0)
        assert [pace.due(0), pace.due(0), pace.due(10)] == [1, 0, 0]

    def test_a_leap_is_not_caught_up(self) -> None:
        pace = Pace(1.0e-3, 0)
        pace.due(0)
        leap = int(3 * MAX_CATCH_UP * SECOND)
        assert pace.due(leap) == 1 and pace.skipped > 1000
        assert pace.stamp_ns(0) == leap

    def test_a_clock_that_goes_back_starts_anew(self) -> None:
        pace = Pace(1.0e-3, 10 * SECOND)
        pace.due(11 * SECOND // 1)
        assert pace.due(2 * SECOND) == 1
        assert pace.done == 1 and pace.stamp_ns(0) == 2 * SECOND


class TestOutgoing:
    """Which rows leave, and with whom."""

    @pytest.mark.parametrize("split", [1, 2, 7, 100])
    def test_every_third_row_for_any_split(self, split: int) -> None:
        settings = settings_from_tree({"publish_every": 3})
        outgoing = Outgoing(settings)
        stamps: list[int] = []
        compensated = 0
        for first in range(0, 100, split):
            for block in outgoing.blocks({0: estimates(list(range(first, min(100, first + split))))}):
                stamps += block.stamp_ns.tolist() if block.topic == ESTIMATE else []
                compensated += len(block.stamp_ns) if block.topic == "friction_compensation" else 0
        assert stamps == list(range(0, 100, 3)) and compensated == 100

    def test_axes_share_a_message_only_where_their_stamps_agree(self) -> None:
        outgoing = Outgoing(settings_from_tree({"axes": ["x", "y"]}))
        blocks = outgoing.blocks({0: estimates([1, 2, 3]), 1: estimates([2, 3, 4])})
        found = [(block.names, block.stamp_ns.tolist()) for block in blocks if block.topic == ESTIMATE]
        assert found == [(("x", "y"), [2, 3]), (("x",), [1]), (("y",), [4])]
        names = next(block.names for block in blocks if block.topic == ELEMENTS)
        assert names == tuple(f"{axis}/{i}" for axis in "xy" for i in range(1, 5))

    def test_parameters_are_reported_ten_times_per_second(self) -> None:
        outgoing = Outgoing(settings_from_tree({"x": {"estimator": {"parameters": ["kappa"]}}}))
        stamps = [i * 1_000_000 for i in range(1000)]
        reports = [r for i in range(0, 1000, 7) for r in outgoing.reports({0: estimates(stamps[i : i + 7])})]
        assert [report.stamp_ns for report in reports] == list(range(0, SECOND, SECOND // 10))


class TestStatistics:
    """What diagnostics say."""

    def test_counts_and_worst_status(self) -> None:
        statistics = AxisStatistics()
        statistics.add(estimates([1, 2], Status.SAMPLE_REJECTED))
        statistics.add(estimates([3, 4, 5]))
        assert (statistics.samples, statistics.rejected, statistics.worst) == (5, 2, Status.SAMPLE_REJECTED)
        assert statistics.nis == 4.0
        entry = axis_entry("node", "x", statistics, PairingCounts(late=1, invalid=2), PairingCounts(), 2.5)
        assert entry.level == WARN and entry.message == Status.SAMPLE_REJECTED.sentence
        assert dict(entry.values)["rate [Hz]"] == "2" and dict(entry.values)["dropped"] == "3"
        statistics.start_anew()
        assert statistics.worst is Status.RUNNING and math.isnan(statistics.nis)
        nothing = PairingCounts()
        entry = axis_entry("node", "x", statistics, nothing, nothing, 1.0)
        assert (entry.level, entry.message, dict(entry.values)["state"]) == (ERROR, NO_SAMPLES, "without samples")
        entry = axis_entry("node", "x", AxisStatistics(), nothing, nothing, 1.0)
        assert (entry.level, entry.message, dict(entry.values)["state"]) == (WARN, NO_SAMPLES, "starting")
        assert "NaN" in axis_entry("node", "x", statistics, nothing, PairingCounts(invalid=2), 1.0).message

    def test_what_is_over_is_counted_but_not_told_again(self) -> None:
        growth, counts = Growth(), PairingCounts(late=3)
        assert growth.take("x", counts) == PairingCounts(late=3)
        counts.late, counts.invalid = 4, 7
        assert growth.take("x", counts) == PairingCounts(late=1, invalid=7)
        assert growth.take("x", counts) == PairingCounts()
        assert growth.take("y", counts) == PairingCounts(late=4, invalid=7)

    def test_steps_slower_than_their_samples_are_misses(self) -> None:
        clock = StepClock(1.0e-3)
        clock.add(0.5e-3, 1)
        clock.add(1.5e-3, 1)
        clock.add(1.5e-3, 2)
        times = clock.take()
        assert clock.deadline_misses == 1 and times.longest == 1.5e-3
        assert math.isnan(clock.take().median)

    def test_a_sentence_is_said_once_until_it_was_gone(self) -> None:
        sentences = Sentences()
        assert sentences.new(["1 late"]) == ["1 late"]
        assert sentences.new(["5 late", "other"]) == ["other"]
        assert sentences.new([]) == []
        assert sentences.new(["6 late"]) == ["6 late"]


def test_what_was_learnt_goes_where_it_belongs() -> None:
    axis = settings_from_tree({}).axes[0]
    changes = parameter_changes(axis, {"kappa": 0.5, "coulomb_force": 3.0, "mass": 12.0, "offset": 0.2}, added_mass=1.0)
    assert changes["friction.element_stiffness"] == [0.5 * kappa for kappa in axis.friction.element_stiffness]
    assert changes["friction.coulomb_force"] == 3.0 and changes["mass"] == 11.0
    assert changes["effects.names"] == ["offset"] and changes["effects.offset.force"] == 0.2


def test_the_engine_starts_a_new_block_when_the_clock_was_reset() -> None:
    engine = Engine(settings_from_tree({"sample_period": 1.0e-3, "x": {"filter": {"window": 8.0e-3}}}))
    pairing = engine.intake.pairings[0]
    for origin in (100 * SECOND, 5 * SECOND):
        for i in range(50):
            pairing.push_position(origin + i * 1_000_000, 1.0e-6 * i)
            pairing.push_effort(origin + i * 1_000_000, 0.1)
    processed = engine.process()
    stamps = [stamp for block in processed.blocks if block.topic == ESTIMATE for stamp in block.stamp_ns.tolist()]
    assert len(stamps) == 100 and stamps[0] == 100 * SECOND and stamps[-1] == 5 * SECOND + 49_000_000
    assert engine.statistics[0].total == 100


@pytest.mark.parametrize("effects", [{}, {"effects": {"names": ["cogging"]}}], ids=["plain", "effects"])
def test_a_sample_that_was_prepared_for_gives_the_bits_of_a_block(effects: dict[str, object]) -> None:
    """One at a time, several at a time, without effort, and with other settings in between."""
    tree = {"sample_period": 1.0e-3, "x": {"filter": {"window": 8.0e-3}, "compensation": {"enabled": True}, **effects}}
    settings = settings_from_tree(tree)
    axis = settings.axes[0]
    slower = replace(axis.compensation, look_ahead=2.0 * axis.compensation.look_ahead)
    tuned = replace(settings, axes=(replace(axis, compensation=slower),))
    count, change, lost = 5000, 3000, 1000  # a block of arrays holds 4096 samples
    seconds = 1.0e-3 * np.arange(count)
    position, effort = 1.0e-4 * np.sin(40.0 * seconds), np.sign(np.cos(40.0 * seconds))
    live, whole = Engine(settings), Engine(settings)
    sent: list[tuple[int, float]] = []
    is_read = cycle([True, False])

    def send(block: OutgoingBlock) -> None:
        sent.extend(zip(block.stamp_ns.tolist(), block.values["effort"][:, 0].tolist(), strict=True))

    blocks = []
    for i in range(count):
        if i == change:
            blocks += whole.process().blocks
        for engine in (live, whole):
            if i == change:
                engine.tune_compensation(tuned)
            engine.intake.pairings[0].push_position(SECOND + i * 1_000_000, float(position[i]))
            if i != lost:
                engine.intake.pairings[0].push_effort(SECOND + i * 1_000_000, float(effort[i]))
        if i % 7:  # else the next one comes along
            live.process(send, lambda: next(is_read))
            live.prepare(lambda stamp, forces: sent.append((stamp, *forces)))
    live.process(send)
    blocks += whole.process().blocks
    wanted = [block for block in blocks if block.topic == COMPENSATION]
    assert [stamp for stamp, _ in sent] == np.concatenate([block.stamp_ns for block in wanted]).tolist()
    assert [force for _, force in sent] == np.concatenate([b.values["effort"][:, 0] for b in wanted]).tolist()
    assert live.statistics[0].totals == whole.statistics[0].totals and len(sent) == count


def test_two_runs_never_share_a_domain() -> None:
    code = "from sgms_observer.nodes.transport import claim_domain; print(claim_domain(), flush=True); input()"
    others = [
        subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(5)
    ]
    domains = [int(other.stdout.readline()) for other in others]
    domains += [claim_domain(), claim_domain(), int(os.environ["ROS_DOMAIN_ID"])]
    for other in others:  # until here: the domain of a process that ended is free again
        other.communicate("\n")
    assert len(set(domains)) == len(domains)
    assert all(1 <= domain <= 100 for domain in domains)
