"""The SROS 2 policy allows each node what it needs and nothing else, compared with the nodes on the real graph."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from rclpy.node import NodeNameNonExistentError
from ros_graph import ONE_AXIS, Graph, Start, wait_until

ROOT = Path(__file__).resolve().parents[2]
POLICY = ElementTree.parse(ROOT / "config" / "sros2" / "policy.xml").getroot()
#: Used only with simulated time.
SPARE = {"subscribe": {"/clock"}}
ATTRIBUTES = {"topics": {"publish", "subscribe"}, "services": {"reply", "request"}}


def _allowed(enclave: str, node: str) -> dict[str, set[str]]:
    """Return the full names that a node of an enclave may use, by what it may do with them."""
    found: dict[str, set[str]] = {"publish": set(), "subscribe": set(), "reply": set(), "request": set()}
    profile = POLICY.find(f"enclaves/enclave[@path='/sgms/{enclave}']/profiles/profile[@node='{node}']")
    assert profile is not None
    for group in profile:
        for deed in ATTRIBUTES[group.tag] & set(group.keys()):
            assert group.get(deed) == "ALLOW"
            found[deed] |= {_full(entry.text or "", node) for entry in group}
    return found


def _full(name: str, node: str) -> str:
    return name if name.startswith("/") else f"/{node}{name[1:]}" if name.startswith("~/") else f"/{name}"


@pytest.mark.parametrize("name", ["observer_node", "stage_node"])
def test_policy_is_what_the_node_uses(name: str, start: Start, graph: Graph) -> None:
    start(name, ONE_AXIS)
    node = graph.node

    def used() -> dict[str, set[str]]:
        try:
            return {
                "publish": {topic for topic, _ in node.get_publisher_names_and_types_by_node(name, "/")},
                "subscribe": {topic for topic, _ in node.get_subscriber_names_and_types_by_node(name, "/")},
                "reply": {service for service, _ in node.get_service_names_and_types_by_node(name, "/")},
                "request": {service for service, _ in node.get_client_names_and_types_by_node(name, "/")},
            }
        except NodeNameNonExistentError:
            return {}  # not discovered yet

    wanted = {deed: names - SPARE.get(deed, set()) for deed, names in _allowed(name, name).items()}
    try:
        wait_until(lambda: used() == wanted, "the node to use what the policy allows, no more and no less")
    except AssertionError:
        assert used() == wanted


def test_every_enclave_is_made_by_the_commands_in_the_documentation() -> None:
    text = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
    made = re.search(r"for enclave in (.+?); do", text)
    assert made is not None
    paths = [enclave.get("path") for enclave in POLICY.iter("enclave")]
    assert paths == [f"/sgms/{name}" for name in made.group(1).split()]


def test_only_the_observer_may_publish_a_compensation() -> None:
    publishers = [
        enclave.get("path")
        for enclave in POLICY.iter("enclave")
        for group in enclave.iter("topics")
        if group.get("publish") == "ALLOW" and "friction_compensation" in [entry.text for entry in group]
    ]
    assert publishers == ["/sgms/observer_node"]


def test_recorder_and_operator_publish_nothing_of_ours() -> None:
    for enclave, node in (("recorder", "sgms_record"), ("recorder", "rosbag2_recorder"), ("operator", "operator")):
        allowed = _allowed(enclave, node)
        assert allowed["publish"] <= {"/rosout", "/parameter_events", "/events/write_split"}
