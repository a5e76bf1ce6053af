"""Faults as streams of messages: good samples in, what a broken machine would publish out."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from sgms_observer.bags.cdr import JointStateEncoder

RATE = 1000.0  # Hz
STEP = 1_000_000  # ns
SECOND = 1_000_000_000
PERIOD = 1.0 / RATE

TOPICS = ("reference", "position", "control_effort")


@dataclass(frozen=True)
class Row:
    """One sample as a sound machine publishes it."""

    stamp: int
    position: float
    effort: float
    set_point: float
    set_velocity: float


Sent = tuple[str, bytes]
"""A topic and a message's bytes."""


def rows(first_stamp: int, first: int, count: int, step: int = STEP) -> list[Row]:
    """Return samples ``first`` .. ``first + count - 1`` of an axis that moves to and fro by 1 mm at 2 Hz."""
    found = []
    for i in range(first, first + count):
        phase = 4.0 * math.pi * i * step * 1e-9
        position = 1.0e-3 * math.sin(phase)
        friction = 4.0 * math.tanh(math.cos(phase) / 0.05)
        effort = friction - 3.0 * (4.0 * math.pi) ** 2 * position
        found.append(Row(first_stamp + i * step, position, effort, position, 4.0e-3 * math.pi * math.cos(phase)))
    return found


def joint_state(stamp: int, names: Iterable[str] = ("x",), **fields: Iterable[float]) -> bytes:
    """Return a JointState with these names and fields, of any lengths."""
    names = tuple(names)
    parts = bytearray(struct.pack("<4xiI", *divmod(stamp, SECOND)))
    parts[:4] = b"\x00\x01\x00\x00"

    def aligned(size: int) -> None:
        parts.extend(b"\x00" * (-(len(parts) - 4) % size))

    def text(word: str) -> None:
        aligned(4)
        content = word.encode() + b"\x00"
        parts.extend(struct.pack("<I", len(content)) + content)

    text("")
    aligned(4)
    parts.extend(struct.pack("<I", len(names)))
    for name in names:
        text(name)
    for field in ("position", "velocity", "effort"):
        values = tuple(fields.get(field, ()))
        aligned(4)
        parts.extend(struct.pack("<I", len(values)))
        if values:
            aligned(8)
            parts.extend(struct.pack(f"<{len(values)}d", *values))
    return bytes(parts)


_position = JointStateEncoder(("x",), ("position",)).encode
_effort = JointStateEncoder(("x",), ("effort",)).encode
_reference = JointStateEncoder(("x",), ("position", "velocity")).encode


def position_of(row: Row, value: float | None = None, stamp: int | None = None) -> Sent:
    """Return the sample's position, or another one."""
    return "position", _position(row.stamp if stamp is None else stamp, (row.position if value is None else value,))


def effort_of(row: Row, value: float | None = None, stamp: int | None = None) -> Sent:
    """Return the sample's effort, or another one."""
    return "control_effort", _effort(row.stamp if stamp is None else stamp, (row.effort if value is None else value,))


def reference_of(row: Row, stamp: int | None = None) -> Sent:
    """Return the sample's set-point."""
    return "reference", _reference(row.stamp if stamp is None else stamp, (row.set_point,), (row.set_velocity,))


def sound(sample: Row, stamp: int | None = None) -> list[Sent]:
    """Return the messages of one sample, with another stamp if one is given."""
    return [reference_of(sample, stamp), position_of(sample, stamp=stamp), effort_of(sample, stamp=stamp)]


def clean(samples: Iterable[Row]) -> list[Sent]:
    """Return what a sound machine publishes."""
    return [message for sample in samples for message in sound(sample)]


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes:
        name: for people.
        make: turns samples into what arrives.
        sentence: part of what the node says of it.
        counter: value in the diagnostics that grows; of the axis, or of the node if it begins with ``node:``.
        ends_trust: whether the compensation has to reach zero while it lasts.
        is_slow: whether it has to be made in real time: the node sees it by the clock only.
        factor: samples that the fault lasts, over those of the other faults.
    """

    name: str
    make: Callable[[list[Row]], list[Sent]]
    sentence: str
    counter: str
    ends_trust: bool = True
    is_slow: bool = False
    factor: int = 1


def _each(change: Callable[[Row], list[Sent]]) -> Callable[[list[Row]], list[Sent]]:
    """Return a fault that turns each sample into messages by itself."""
    return lambda samples: [message for sample in samples for message in change(sample)]


def _now_and_then(change: Callable[[Row], list[Sent]]) -> Callable[[list[Row]], list[Sent]]:
    """Return a fault that meets one sample in ten."""

    def make(samples: list[Row]) -> list[Sent]:
        return [m for i, sample in enumerate(samples) for m in (change(sample) if i % 10 == 5 else sound(sample))]

    return make


def _as_position(value: float) -> Callable[[Row], list[Sent]]:
    return lambda row: [reference_of(row), position_of(row, value), effort_of(row)]


def _as_effort(value: float) -> Callable[[Row], list[Sent]]:
    return lambda row: [reference_of(row), position_of(row), effort_of(row, value)]


def _named(*names: str, fields: Callable[[float], tuple[float, ...]]) -> Callable[[Row], list[Sent]]:
    """Return a fault in names and lengths of position and effort."""
    return lambda row: [
        reference_of(row),
        ("position", joint_state(row.stamp, names, position=fields(row.position))),
        ("control_effort", joint_state(row.stamp, names, effort=fields(row.effort))),
    ]


def _lost(samples: list[Row]) -> list[Sent]:
    """Lose a fifth of each topic's messages on its own."""
    chance = random.Random(20)
    return [message for message in clean(samples) if chance.random() > 0.2]


def _bursts(samples: list[Row]) -> list[Sent]:
    """Let fifty messages of one topic arrive together, then those of the next."""
    bursts = [samples[i : i + 50] for i in range(0, len(samples), 50)]
    return [make(row) for burst in bursts for make in (effort_of, position_of, reference_of) for row in burst]


def _shuffled(samples: list[Row]) -> list[Sent]:
    """Let messages overtake others by up to five samples."""
    chance = random.Random(5)
    messages = [(i + chance.uniform(0.0, 5.0), m) for i, row in enumerate(samples) for m in sound(row)]
    return [message for _, message in sorted(messages, key=lambda item: item[0])]


def _leap(by: int) -> Callable[[list[Row]], list[Sent]]:
    """Return a fault where one stamp leaps ahead and the following ones are right again."""

    def make(samples: list[Row]) -> list[Sent]:
        return [m for i, row in enumerate(samples) for m in sound(row, row.stamp + (by if i == 10 else 0))]

    return make


def _went_back(samples: list[Row]) -> list[Sent]:
    """Let the stamps go back by a fifth of a second in the middle."""
    half = len(samples) // 2
    return clean(samples[:half]) + [m for row in samples[half:] for m in sound(row, row.stamp - SECOND // 5)]


def _clock_reset(samples: list[Row]) -> list[Sent]:
    """Let the clock start again at one second in the middle."""
    half = len(samples) // 2
    start = samples[half].stamp - SECOND
    return clean(samples[:half]) + [m for row in samples[half:] for m in sound(row, row.stamp - start)]


def _denser(samples: list[Row]) -> list[Sent]:
    """Publish at ten times the rate."""
    last = samples[-1].stamp + STEP
    return clean([row for row in rows(samples[0].stamp, 0, 10 * len(samples), STEP // 10) if row.stamp < last])


def _second_publisher(shift: int) -> Callable[[list[Row]], list[Sent]]:
    """Return a fault where another machine publishes on the same topics, its stamps shifted by so much."""
    return _each(
        lambda row: sound(row) + [position_of(row, 0.05, row.stamp + shift), effort_of(row, 0.0, row.stamp + shift)]
    )


def _wrap(samples: list[Row]) -> list[Sent]:
    """Let the encoder wrap twice: at the end of its range and back."""
    third = len(samples) // 3
    wrapped = samples[third : 2 * third]
    moved = [m for row in wrapped for m in (reference_of(row), position_of(row, row.position - 0.02), effort_of(row))]
    return clean(samples[:third]) + moved + clean(samples[2 * third :])


def _noise(size: int) -> Callable[[Row], list[Sent]]:
    """Return messages that are no JointState."""
    return lambda row: [(topic, random.Random(row.stamp + size).randbytes(size)) for topic in TOPICS]


NAN, INF = math.nan, math.inf
HUGE = 1.0e308
JUMPED = "jumped by more than filter.jump_speed"
NO_NUMBER = "no number for an axis"
NAN_TOLD = "NaN or infinity"

FAULTS = (
    Fault("position is NaN", _each(_as_position(NAN)), NAN_TOLD, "dropped", is_slow=True),
    Fault("position is infinite", _each(_as_position(-INF)), NAN_TOLD, "dropped", is_slow=True),
    Fault("position is infinite now and then", _now_and_then(_as_position(INF)), NAN_TOLD, "dropped", False),
    Fault(
        "position is huge now and then", _now_and_then(_as_position(HUGE)), "a sample was rejected", "rejected", False
    ),
    Fault("position is far off now and then", _now_and_then(_as_position(1e6)), JUMPED, "samples restarted_after_jump"),
    Fault("effort is NaN", _each(_as_effort(NAN)), NAN_TOLD, "dropped"),
    Fault("effort is infinite now and then", _now_and_then(_as_effort(INF)), NAN_TOLD, "dropped", False),
    Fault(
        "effort is huge now and then", _now_and_then(_as_effort(HUGE)), "no usable effort", "samples predicting", False
    ),
    Fault(
        "effort is far off now and then",
        _now_and_then(_as_effort(1e6)),
        "larger than the model expects",
        "samples",
        False,
    ),
    Fault("arrays are empty", _each(_named("x", fields=lambda value: ())), NO_NUMBER, "node:short", is_slow=True),
    Fault("arrays are short", _each(_named("y", "x", fields=lambda v: (v,))), NO_NUMBER, "node:short", is_slow=True),
    Fault(
        "names are wrong", _each(_named("z", fields=lambda v: (v,))), "none of the axes", "node:foreign", is_slow=True
    ),
    Fault("names are missing", _each(_named(fields=lambda v: (v,))), "none of the axes", "node:foreign", is_slow=True),
    Fault(
        "names come twice",
        _each(_named("x", "x", fields=lambda v: (v, NAN))),
        "axis twice",
        "node:repeated names",
        False,
    ),
    Fault("messages are noise", _each(_noise(40)), "no JointState", "node:malformed", is_slow=True),
    Fault("messages are cut", _each(_noise(4)), "no JointState", "node:malformed", is_slow=True),
    Fault("stamps go back", _went_back, "came after a later one", "dropped", False),
    Fault("stamps come twice", _each(lambda row: sound(row) * 2), "repeated the stamp", "dropped", False),
    Fault(
        "stamps stand still",
        lambda samples: [m for row in samples for m in sound(row, samples[0].stamp)],
        "repeated the stamp",
        "dropped",
        is_slow=True,
    ),
    Fault(
        "one stamp leaps by an hour", _leap(3600 * SECOND), "jumped back by more than a second", "clock resets", False
    ),
    Fault("one stamp leaps by 0.3 s", _leap(3 * SECOND // 10), "came after a later one", "dropped", is_slow=True),
    Fault("the clock is reset", _clock_reset, "jumped back by more than a second", "clock resets", False),
    Fault(
        "stamps are before 1970",
        _each(lambda row: sound(row, row.stamp - 18 * 10**17)),
        "jumped back",
        "clock resets",
        False,
    ),
    Fault("a fifth is lost", _lost, "no control_effort of the same time", "without effort", False),
    Fault("topics arrive in bursts", _bursts, "", "samples", False),
    Fault("messages overtake each other", _shuffled, "came after a later one", "dropped", False),
    Fault("the publisher is gone", lambda samples: [], "no samples arrive", "", is_slow=True, factor=8),
    Fault("the rate is ten times higher", _denser, "less than half of sample_period", "samples too_dense"),
    Fault(
        "two machines publish, stamps between", _second_publisher(STEP // 2 - 1), JUMPED, "samples restarted_after_jump"
    ),
    Fault("two machines publish, same stamps", _second_publisher(0), "check for two publishers", "dropped", False),
    Fault(
        "efforts are missing",
        _each(lambda row: sound(row)[:2]),
        "no control_effort of the same time",
        "without effort",
        factor=4,
    ),
    Fault(
        "efforts have stamps of their own",
        _each(lambda row: [*sound(row)[:2], effort_of(row, stamp=row.stamp - STEP // 2)]),
        "stamp both with the sample time",
        "unmatched efforts",
    ),
    Fault("the encoder wraps", _wrap, JUMPED, "samples restarted_after_jump"),
    Fault("the reference is gone", _each(lambda row: sound(row)[1:]), "", "samples", False),
    Fault(
        "the reference is absurd",
        _each(
            lambda row: [
                *sound(row)[1:],
                ("reference", joint_state(row.stamp, ("x",), position=(HUGE,), velocity=(-HUGE,))),
            ]
        ),
        "",
        "samples",
        False,
    ),
)
