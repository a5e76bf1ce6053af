"""A process that gives out one message for each sample of two topics, with nothing computed, until it is stopped."""

from __future__ import annotations

import argparse
import sys

import rclpy
from sensor_msgs.msg import JointState

from sgms_observer.nodes.spin import spin_until_interrupted
from sgms_observer.nodes.topics import SAMPLE_QOS, subscribe
from sgms_observer.nodes.transport import prepare_transport

_STAMP = slice(4, 12)  # seconds and nanoseconds in a message that begins with a header


def relay(topic: str) -> None:
    """Send the effort's message on as soon as the position of the same stamp is there too, or the other way round."""
    prepare_transport()
    rclpy.init(args=[])
    node = rclpy.create_node("bench_relay")
    publish = node.create_publisher(JointState, topic, SAMPLE_QOS).publish
    waiting: dict[bytes, str] = {}

    def take(source: str, message: bytes) -> None:
        stamp = bytes(message[_STAMP])
        if waiting.setdefault(stamp, source) != source:
            del waiting[stamp]
            publish(message)

    subscribe(node, "position", lambda message: take("position", message))
    subscribe(node, "control_effort", lambda message: take("control_effort", message))
    spin_until_interrupted(node)


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("topic")
    relay(parser.parse_args().topic)
    return 0


if __name__ == "__main__":
    sys.exit(main())
