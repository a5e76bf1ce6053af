"""Commands of samples that are too old are zero, and neither the way there nor back is faster than the slew limit."""

from __future__ import annotations

import struct
from types import SimpleNamespace

import pytest

pytest.importorskip("std_msgs.msg")

from sgms_observer.nodes import topics
from sgms_observer.settings.axis import AxisSettings, CompensationSettings, Settings


def test_late_commands_go_to_zero_and_back_within_the_slew_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[float] = []
    publisher = SimpleNamespace(
        get_subscription_count=lambda: 1, publish=lambda data: sent.append(struct.unpack("<d", data[-8:])[0])
    )
    now = [0.0]
    monkeypatch.setattr(topics.time, "monotonic", lambda: now[0])
    axis = AxisSettings(compensation=CompensationSettings(enabled=True, slew_limit=100.0))
    topic = topics.CommandTopic(SimpleNamespace(create_publisher=lambda *_: publisher), Settings(axes=(axis,)))
    for is_late in [False] * 2 + [True] * 5 + [False] * 5:
        now[0] += 0.01
        topic.publish([3.0], is_late)
    assert sent == pytest.approx([3.0, 3.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0])
