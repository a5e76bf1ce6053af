"""The real rcl takes what the loader takes, and the node ends with the same settings and the same sentences."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from sgms_observer.settings.load import load_settings, settings_from_tree

pytest.importorskip("rclpy", reason="needs ROS 2, from a distribution or its wheels")

HERE = Path(__file__).parent
CONFIG = HERE.parents[1] / "config"
AS_PEOPLE_WRITE = """
/**:
  ros__parameters:
    axes: [x, y]
    sample_period: 1e-4
    x:
      mass: 3
      friction: {element_stiffness: [12.0e6, 2, 3e5], element_fraction: [0.3, 0.3, 0.4], static_force: 5}
      effects: {names: [cogging], cogging: {amplitude: 1}}
      estimator: {parameters: []}
      stage:
        effects: {names: []}
        friction: {model: gms}
        reference: {kind: multi_sine, amplitudes: [1e-4, 1], frequencies: [1, 2]}
/other:
  ros__parameters: {a: [1, 2.0], b: []}
observer_node:
  ros__parameters: {x: {mass: 4}}
"""


def node_with(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a node that declares every parameter and prints the tree of their values."""
    command = [sys.executable, str(HERE / "parameter_node.py"), "--ros-args", *arguments]
    return subprocess.run(command, cwd=HERE.parents[1], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("name", ["table", "as_people_write"])
def test_a_node_and_the_command_line_read_the_same(name: str, tmp_path: Path) -> None:
    path = CONFIG / f"{name}.yaml"
    if name == "as_people_write":
        path = tmp_path / "people.yaml"
        path.write_text(AS_PEOPLE_WRITE, encoding="utf-8")
    done = node_with("--params-file", str(path))
    assert done.returncode == 0, done.stderr
    loaded = load_settings(path, node_names=("observer_node",))
    beside = replace(loaded, save_file=str(path.resolve().parent / loaded.save_file))  # where a node saves
    assert settings_from_tree(json.loads(done.stdout)) == beside


def test_values_on_the_command_line_reach_the_node() -> None:
    done = node_with("-p", "axes:=[y]", "-p", "y.mass:=3", "-p", "y.friction.element_damping:=[0, 0, 1, 0.5]")
    assert done.returncode == 0, done.stderr
    (axis,) = settings_from_tree(json.loads(done.stdout)).axes
    assert (axis.name, axis.mass, axis.friction.element_damping) == ("y", 3.0, (0.0, 0.0, 1.0, 0.5))


def test_faults_are_said_before_ros_starts() -> None:
    done = node_with("-p", "x.mass:=-3", "-p", "foo:=[1, 2.0]")
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "foo is not a setting; remove it, or look its name up in docs/parameters.md",
        "x.mass = -3 kg must be > 0; raise it",
    ]
