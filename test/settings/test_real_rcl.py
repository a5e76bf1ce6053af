"""The real rcl takes what the loader takes, and the node ends with the same settings and the same sentences."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sgms_observer.settings.axis import Settings
from sgms_observer.settings.load import load_settings, settings_from_tree
from sgms_observer.settings.node_parameters import tree_from_parameters

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
    """Run a node that declares every parameter and prints what became of it."""
    return nodes_with([arguments])


def nodes_with(lines: Sequence[Sequence[str]]) -> subprocess.CompletedProcess[str]:
    """Run such nodes one after the other, each with its arguments; each prints a line."""
    given = (json.dumps(["--ros-args", *arguments]) for arguments in lines)
    command = [sys.executable, str(HERE / "parameter_node.py"), *given]
    return subprocess.run(command, cwd=HERE.parents[1], capture_output=True, text=True, timeout=120, check=False)


def told(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """Return what a node that could start printed."""
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def settings_of(found: dict[str, Any]) -> Settings:
    """Return the settings that the parameters of a node give."""
    own = {name: value for name, value in found["parameters"].items() if name != "use_sim_time"}
    return of_a_stage(settings_from_tree(tree_from_parameters(own)))


def of_a_stage(given: Settings) -> Settings:
    """Return settings where a true friction that does not differ is none of its own, as it is for a node."""
    axes = (replace(a, stage_friction=None if a.stage_friction == a.friction else a.stage_friction) for a in given.axes)
    return replace(given, axes=tuple(axes))


@pytest.mark.parametrize("name", ["table", "as_people_write"])
def test_a_node_and_the_command_line_read_the_same(name: str, tmp_path: Path) -> None:
    path = CONFIG / f"{name}.yaml"
    if name == "as_people_write":
        path = tmp_path / "people.yaml"
        path.write_text(AS_PEOPLE_WRITE, encoding="utf-8")
    found = told(node_with("--params-file", str(path)))
    loaded = load_settings(path, node_names=("observer_node",))
    beside = replace(loaded, save_file=str(path.resolve().parent / loaded.save_file))  # where a node saves
    assert settings_of(found) == of_a_stage(beside)
    assert found["checked"] == [axis.name for axis in loaded.axes]  # once each
    assert found["temporary_files"] == []


def test_values_on_the_command_line_reach_the_node() -> None:
    values = ("axes:=[y]", "y.mass:=3", "y.friction.element_damping:=[0, 0, 1, 0.5]", "use_sim_time:=yes")
    found = told(node_with(*(word for value in values for word in ("-p", value))))
    assert found["parameters"]["use_sim_time"] is True
    (axis,) = settings_of(found).axes
    assert (axis.name, axis.mass, axis.friction.element_damping) == ("y", 3.0, (0.0, 0.0, 1.0, 0.5))


def test_faults_are_said_before_ros_starts() -> None:
    done = node_with("-p", "x.mass:=-3", "-p", "foo:=[1, 2.0]")
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "foo is not a setting; remove it, or look its name up in docs/parameters.md",
        "x.mass = -3 kg must be > 0; raise it",
    ]


SECTIONS = """
/table/eyes: {ros__parameters: {x: {mass: 5.0}}}
observer_node: {ros__parameters: {x: {mass: 2.0}}}
/**: {ros__parameters: {axes: [x], x: {mass: 1.0, friction: {static_force: 7.0}}}}
/*/observer_node: {ros__parameters: {x: {mass: 3.0}}}
/table/*: {ros__parameters: {x: {mass: 4.0, friction: {static_force: 8.0}}}}
"""


NAMED = {
    (): ("/observer_node", 2.0, 7.0),
    ("-r", "__ns:=/left"): ("/left/observer_node", 3.0, 7.0),
    ("-r", "__ns:=/left/table"): ("/left/table/observer_node", 1.0, 7.0),
    ("-r", "__ns:=/table", "-r", "__node:=eyes"): ("/table/eyes", 5.0, 8.0),
    ("-r", "__node:=eyes", "-r", "observer_node:__ns:=/table"): ("/eyes", 1.0, 7.0),
    ("-r", "__node:=eyes", "-r", "eyes:__ns:=/table"): ("/table/eyes", 5.0, 8.0),
    ("-r", "__ns:=/table", "-r", "__ns:=/other"): ("/table/observer_node", 4.0, 8.0),
    ("-r", "other:__ns:=/table", "-r", "__name:=ears"): ("/ears", 1.0, 7.0),
    ("-r", "__ns:=/table", "-p", "x.mass:=6"): ("/table/observer_node", 6.0, 8.0),
    ("-p", "ears:x.mass:=6"): ("/observer_node", 2.0, 7.0),
}
"""Arguments of a node: its full name, and its mass and static force from ``SECTIONS``."""


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, ...], dict[str, Any]]:
    """Return what the nodes of ``NAMED`` print."""
    path = tmp_path_factory.mktemp("sections") / "sections.yaml"
    path.write_text(SECTIONS, encoding="utf-8")
    done = nodes_with([("--params-file", str(path), *arguments) for arguments in NAMED])
    assert done.returncode == 0, done.stderr
    return dict(zip(NAMED, map(json.loads, done.stdout.splitlines()), strict=True))


@pytest.mark.parametrize("arguments", NAMED, ids=" ".join)
def test_the_sections_for_the_name_that_rcl_gives_the_node(
    arguments: tuple[str, ...], named: dict[tuple[str, ...], dict[str, Any]]
) -> None:
    found = named[arguments]
    values = found["parameters"]
    assert (found["name"], values["x.mass"], values["x.friction.static_force"]) == NAMED[arguments]


def test_of_several_files_the_last_decides(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("/**: {ros__parameters: {axes: [x], x: {mass: 1.0}}}")
    (tmp_path / "b.yaml").write_text("observer_node: {ros__parameters: {x: {mass: 2, friction: {static_force: 9}}}}")
    files = [word for name in "ab" for word in ("--params-file", str(tmp_path / f"{name}.yaml"))]
    values = told(node_with(*files))["parameters"]
    assert (values["x.mass"], values["x.friction.static_force"]) == (2.0, 9.0)
