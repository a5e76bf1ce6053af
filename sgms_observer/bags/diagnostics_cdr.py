"""DiagnosticArray as bytes (XCDR1): ``friction_parameters`` and ``/diagnostics`` in bags, without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sgms_observer.bags.cdr import Buffer, Cursor, append_string, append_uint32, begin_message
from sgms_observer.observer.outgoing import ParameterReport

OK, WARN, ERROR = range(3)  # stale is what an aggregator says of a node that reports nothing


@dataclass(frozen=True)
class DiagnosticStatus:
    """One entry of a DiagnosticArray.

    Attributes:
        level: 0 ok, 1 warning, 2 error, 3 stale.
        name: what it is about.
        message: one sentence.
        hardware_id: the device, or empty.
        values: pairs of key and value.
    """

    level: int
    name: str
    message: str
    hardware_id: str = ""
    values: tuple[tuple[str, str], ...] = ()


def encode_diagnostics(stamp_ns: int, statuses: Sequence[DiagnosticStatus]) -> bytes:
    """Return one DiagnosticArray.

    Args:
        stamp_ns: time of the header [ns].
        statuses: its entries.

    Raises:
        DataError: the stamp does not fit a ROS time.
    """
    message = begin_message(stamp_ns)
    append_uint32(message, len(statuses))
    for status in statuses:
        message.append(status.level)
        for text in (status.name, status.message, status.hardware_id):
            append_string(message, text)
        append_uint32(message, len(status.values))
        for key, value in status.values:
            append_string(message, key)
            append_string(message, value)
    return bytes(message)


def decode_diagnostics(message: Buffer) -> tuple[int, tuple[DiagnosticStatus, ...]]:
    """Decode one DiagnosticArray.

    Args:
        message: the whole message with its encapsulation.

    Returns:
        Stamp [ns] and the entries.

    Raises:
        DataError: the bytes are no DiagnosticArray; nothing else is ever raised.
    """
    cursor = Cursor(bytes(message), "DiagnosticArray")
    cursor.text()
    statuses = []
    for _ in range(cursor.length(17)):
        level = cursor.byte()
        name, about, hardware = cursor.text(), cursor.text(), cursor.text()
        pairs = [(cursor.text(), cursor.text()) for _ in range(cursor.length(8))]
        statuses.append(DiagnosticStatus(level, name, about, hardware, tuple(pairs)))
    return cursor.stamp_ns, tuple(statuses)


def parameter_entry(report: ParameterReport) -> DiagnosticStatus:
    """Return what ``friction_parameters`` say of one axis.

    Args:
        report: values and standard deviations.
    """
    values: list[tuple[str, str]] = []
    for name, value, std in zip(report.names, report.values, report.std, strict=True):
        values += [(name, repr(value)), (f"{name}_std", repr(std))]
    sentence = "estimated parameters in SI units; kappa as a share of the nominal stiffness"
    return DiagnosticStatus(OK, report.axis, sentence, report.axis, tuple(values))
