"""The files in config/ and the reference page are what they say."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml

from sgms_observer.settings.document import PAGE, page
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).parents[2]


def test_the_papers_file_is_table_i() -> None:
    settings = load_settings(ROOT / "config" / "paper.yaml")
    (axis,) = settings.axes
    f = axis.friction
    assert settings.sample_period == 1e-4
    assert f.element_stiffness == (12e6, 2.5e6, 0.71e6, 0.79e6)
    assert f.element_fraction == (0.067, 0.056, 0.047, 0.83)
    assert f.element_damping == (0.0, 0.0, 0.0, 0.0)
    assert (f.viscous_coefficient, f.static_force, f.coulomb_force, f.stribeck_velocity) == (20.0, 4.5, 4.0, 1e-3)
    assert (f.attraction_rate, f.smoothing_lambda, f.smoothing_zeta, f.smoothing_gamma) == (50.0, 1e3, 0.98, 1e2)
    assert (f.model, f.reset) == ("sgms", "paper")
    assert axis.stage_friction is not None and axis.stage_friction.model == "gms"
    reference = axis.stage.reference
    assert (reference.kind, reference.amplitude, reference.frequency) == ("sine", 2e-4, 5.0)
    e = axis.estimator
    assert (e.correction_every, e.horizon, e.iterations, e.measurement_std, e.parameters) == (20, 4, 2, 0.1, ("kappa",))
    assert (axis.filter.kind, axis.filter.cutoff, axis.filter.align_effort) == ("lowpass", 500.0, True)


def test_the_joint_is_revolute_under_gravity_and_every_value_has_its_comment() -> None:
    path = ROOT / "config" / "joint.yaml"
    (axis,) = load_settings(path).axes
    assert axis.units.is_revolute and not axis.compensation.enabled
    assert [effect.name for effect in axis.effects] == ["gravity"]
    lines = path.read_text(encoding="utf-8").splitlines()
    bare = {line.strip() for line in lines if line.strip() and "#" not in line}
    groups = {"elbow:", "ros__parameters:", "estimator:", "controller:", "reference:", "encoder:", "friction:"}
    assert bare <= groups | {"kind: savgol"}
    prismatic = re.compile(r"# .*(?<![A-Za-z])(N/m|N s/m|(?<!N )m/s|N,|kg,|(?<!N )m,)")
    assert not [line for line in lines if prismatic.search(line)]


def test_the_table_has_two_axes_and_every_line_its_comment() -> None:
    path = ROOT / "config" / "table.yaml"
    settings = load_settings(path)
    assert [axis.name for axis in settings.axes] == ["x", "y"]
    assert not any(axis.compensation.enabled for axis in settings.axes)
    lines = path.read_text(encoding="utf-8").splitlines()
    first_axis = lines[: next(i for i, line in enumerate(lines) if line.startswith('    "y":'))]
    bare = [line for line in first_axis if line.strip() and "#" not in line]
    groups = {"ros__parameters:", "estimator:", "controller:", "reference:", "encoder:", "friction:"}
    explained_above = {"damping_ratio: 0.7", "parameter_maximum: 3.0"}
    assert {line.strip() for line in bare} <= groups | explained_above


def test_emps_holds_the_published_values() -> None:
    settings = load_settings(ROOT / "config" / "emps.yaml")
    (axis,) = settings.axes
    assert settings.sample_period == 1e-3
    assert (axis.mass, axis.friction.viscous_coefficient) == (95.1089, 203.5034)
    assert axis.friction.static_force == axis.friction.coulomb_force == 20.3935
    assert [(effect.name, effect.values) for effect in axis.effects] == [("offset", (-3.1648,))]


@pytest.mark.parametrize("name", ["paper", "table", "emps", "joint"])
def test_plain_pyyaml_reads_the_shipped_files_alike(name: str) -> None:
    path = ROOT / "config" / f"{name}.yaml"
    tree = yaml.safe_load(path.read_text(encoding="utf-8"))

    def lists(value: object) -> list[list[object]]:
        if isinstance(value, dict):
            return [found for entry in value.values() for found in lists(entry)]
        return [value] if isinstance(value, list) else []

    assert all(len({type(entry) for entry in found}) <= 1 for found in lists(tree))  # rcl takes no mixed lists


#: Every ROS node has these, and nobody records them for us.
OF_ROS = {"/rosout", "/parameter_events", "/clock"}
#: ros2_control's, in the place of position and control_effort.
OF_ROS2_CONTROL = {"/joint_states"}


def topics_of_nodes() -> set[str]:
    """Return the topics of both nodes by the SROS 2 policy, which a test compares with the nodes on the graph."""
    policy = ElementTree.parse(ROOT / "config" / "sros2" / "policy.xml").getroot()
    found = set()
    for node in ("observer_node", "stage_node"):
        for entry in policy.iterfind(f"enclaves/enclave[@path='/sgms/{node}']/profiles/profile/topics/topic"):
            name = entry.text or ""
            found.add(f"/{node}{name[1:]}" if name.startswith("~/") else f"/{name.lstrip('/')}")
    return {name for name in found - OF_ROS if not name.endswith("/transition_event")}


def test_recording_is_deep_and_reliable_for_every_topic_of_the_nodes() -> None:
    profiles = yaml.safe_load((ROOT / "config" / "record_qos.yaml").read_text(encoding="utf-8"))
    assert set(profiles) == topics_of_nodes() | OF_ROS2_CONTROL
    for topic, profile in profiles.items():
        assert profile == {
            "history": "keep_last",
            "depth": 100 if topic.endswith("_horizon") else 2000,
            "reliability": "reliable",
            "durability": "volatile",
        }, topic


def test_the_reference_page_is_current() -> None:
    written = (ROOT / PAGE).read_text(encoding="utf-8")
    assert written == page(), "run python -m sgms_observer.settings.document"
