"""Launch files by starting them: what comes up, in which namespace, and that nothing is left where something lacks."""

from __future__ import annotations

import os
import re
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")
pytest.importorskip("launch_ros", reason="launch is not on PyPI: these tests run on a ROS installation")

from rclpy.node import NodeNameNonExistentError
from ros_graph import Graph, wait_until

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 180.0
ONE_AXIS = "/**: {ros__parameters: {axes: [x], sample_period: 1.0e-3, x: {mass: 3.0, filter: {window: 8.0e-3}}}}"
NODES = ("observer_node", "stage_node")
DEBUG = "[DEBUG]"
CONTROLLERS = ("controller_manager", "forward_command_controller", "joint_state_broadcaster")

CODE = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

path, *given = sys.argv[1:]
arguments = [tuple(argument.split(":=", 1)) for argument in given]
service = LaunchService(argv=given)
file = IncludeLaunchDescription(PythonLaunchDescriptionSource(path), launch_arguments=arguments)
service.include_launch_description(LaunchDescription([file]))
sys.exit(service.run())
"""


def _program(path: Path, code: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!{sys.executable}\n{code}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def _package(prefix: Path, name: str) -> None:
    """Make an installed package as the ament index knows it."""
    mark = prefix / "share" / "ament_index" / "resource_index" / "packages" / name
    mark.parent.mkdir(parents=True, exist_ok=True)
    mark.touch()
    (prefix / "share" / name).mkdir(parents=True)


class Launched:
    """A launch file that runs in a process of its own."""

    def __init__(self, prefix: Path, name: str, *arguments: str) -> None:
        self.log = prefix / f"{name}.{time.monotonic_ns()}.log"
        paths = [str(prefix), *filter(None, [os.environ.get("AMENT_PREFIX_PATH")])]
        environment = {
            **os.environ,
            "AMENT_PREFIX_PATH": os.pathsep.join(paths),
            "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path]),
            "PYTHONUNBUFFERED": "1",
            "SGMS_TEST_MARK": str(self.log),
        }
        with self.log.open("w") as file:
            self.process = subprocess.Popen(
                [sys.executable, "-c", CODE, str(ROOT / "launch" / f"{name}.launch.py"), *arguments],
                cwd=prefix, env=environment, stdout=file, stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip

    def text(self) -> str:
        """Return everything that was said."""
        return self.log.read_text(errors="replace")

    def wait(self, pattern: str, count: int = 1) -> None:
        """Wait until something was said so many times."""
        end = time.monotonic() + PATIENCE
        while len(re.findall(pattern, self.text())) < count:
            assert time.monotonic() < end and self.process.poll() is None, self.text()
            time.sleep(0.05)

    def children(self) -> list[int]:
        """Return the processes that this launch left or runs, known by their environment."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                is_ours = f"SGMS_TEST_MARK={self.log}".encode() in (folder / "environ").read_bytes()
            except OSError:
                continue
            if is_ours and int(folder.name) != self.process.pid:
                found.append(int(folder.name))
        return found

    def wait_end(self) -> int:
        """Return the exit code once the launch ended by itself; nothing may be left of it."""
        code = self.process.wait(PATIENCE)
        assert self.children() == [], self.text()
        return code

    def stop(self) -> int:
        """End it as Ctrl-C does."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        return self.wait_end()


Start = Callable[..., Launched]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Return a function that starts a launch file of this tree as if it were installed."""
    _package(tmp_path, "sgms_observer")
    for folder in ("config", "launch"):
        (tmp_path / "share" / "sgms_observer" / folder).symlink_to(ROOT / folder)
    for name, module in (
        ("sgms", "sgms_observer.__main__"),
        ("stage_node", "sgms_observer.nodes.stage_node"),
        ("observer_node", "sgms_observer.nodes.observer_node"),
    ):
        code = f"import sys\nfrom {module} import main\nsys.exit(main())"
        _program(tmp_path / "lib" / "sgms_observer" / name, code)
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    started: list[Launched] = []

    def begin(name: str, *arguments: str) -> Launched:
        started.append(Launched(tmp_path, name, *arguments))
        return started[-1]

    yield begin
    for launched in started:
        for process in [launched.process.pid, *launched.children()]:
            try:
                os.kill(process, signal.SIGKILL)
            except OSError:
                continue
        launched.process.wait()


def _active(node: str) -> str:
    """Return the pattern of what a node in the namespace ``left`` says once it is active."""
    return rf"\[left\.{node}\]: active: axes x"


def _takes_time_from_clock(graph: Graph, node: str) -> bool:
    """Return whether a node in the namespace ``left`` uses simulated time."""
    try:
        topics = graph.node.get_subscriber_names_and_types_by_node(node, "/left")
    except NodeNameNonExistentError:
        return False  # not discovered yet
    return "/clock" in [name for name, _ in topics]


def test_the_observer_in_a_namespace_and_again_after_it_was_killed(start: Start, tmp_path: Path) -> None:
    launched = start("table", f"params_file:={tmp_path / 'axis.yaml'}", "namespace:=left", "respawn:=true")
    launched.wait(_active("observer_node"))
    (observer,) = launched.children()
    os.kill(observer, signal.SIGKILL)
    launched.wait(_active("observer_node"), count=2)
    assert DEBUG not in launched.text()
    launched.stop()


@pytest.mark.parametrize(
    ("name", "nodes", "more"),
    [
        ("table", ["observer_node"], []),
        ("demo", ["observer_node", "stage_node"], []),
        ("ros2_control", ["observer_node"], ["spawn:=false"]),
    ],
    ids=["table", "demo", "ros2_control"],
)
def test_log_level_and_simulated_time_reach_the_nodes(
    name: str, nodes: list[str], more: list[str], start: Start, graph: Graph, tmp_path: Path
) -> None:
    file = f"params_file:={tmp_path / 'axis.yaml'}"
    launched = start(name, file, "namespace:=left", "log_level:=debug", "use_sim_time:=true", *more)
    for node in nodes:
        launched.wait(_active(node))
        wait_until(partial(_takes_time_from_clock, graph, node), f"/clock to be read by {node}")
    launched.wait(re.escape(DEBUG), count=len(nodes))
    launched.stop()


def test_a_mistyped_file_starts_nothing(start: Start) -> None:
    launched = start("table", "params_file:=/no/such/file.yaml")
    launched.wait_end()
    assert "check the path of the parameter file" in launched.text()
    assert "active" not in launched.text()


def test_the_demonstration(start: Start) -> None:
    launched = start("demo", "namespace:=left", "respawn:=true")
    for node in NODES:
        launched.wait(_active(node))
    for process in launched.children():
        os.kill(process, signal.SIGKILL)
    for node in NODES:
        launched.wait(_active(node), count=2)
    launched.stop()


def test_a_bag_is_played_into_a_namespace_and_everything_ends_with_it(start: Start, tmp_path: Path) -> None:
    config = str(ROOT / "config" / "demo.yaml")
    simulate = [tmp_path / "lib" / "sgms_observer" / "sgms", "simulate", "--config", config, "--out", tmp_path / "bag"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    subprocess.run([*simulate, "--duration", "2.0"], check=True, env=environment)
    launched = start("replay", f"bag:={tmp_path / 'bag'}", f"params_file:={config}", "namespace:=left")
    launched.wait_end()
    assert re.search(_active("observer_node"), launched.text())
    assert re.search(r"played \d+ messages", launched.text())
    assert "without subscribers" not in launched.text()


def test_in_a_namespace_the_observer_is_on_the_topics_of_its_controllers(start: Start, graph: Graph) -> None:
    launched = start("ros2_control", "namespace:=left", "spawn:=false")
    launched.wait(_active("observer_node"))

    def topics() -> tuple[set[str], set[str]]:
        node = ("observer_node", "/left")
        subscribed = graph.node.get_subscriber_names_and_types_by_node(*node)
        published = graph.node.get_publisher_names_and_types_by_node(*node)
        return {name for name, _ in subscribed}, {name for name, _ in published}

    def is_connected() -> bool:
        try:
            subscribed, published = topics()
        except NodeNameNonExistentError:
            return False  # not discovered yet
        return "/left/joint_states" in subscribed and "/left/friction_controller/commands" in published

    wait_until(is_connected, "joint_states and the controller's commands in the namespace")
    launched.stop()


def test_without_ros2_control_nothing_starts(start: Start) -> None:
    launched = start("ros2_control")
    assert launched.wait_end() != 0
    assert "controller_manager is not installed, so nothing was started" in launched.text()
    assert "process started with pid" not in launched.text()


@pytest.mark.parametrize("code", [0, 1])
def test_the_observer_ends_unless_the_controllers_were_loaded(start: Start, tmp_path: Path, code: int) -> None:
    for name in CONTROLLERS:
        _package(tmp_path, name)
    _program(
        tmp_path / "lib" / "controller_manager" / "spawner",
        f"import sys, time\nprint('spawner', *sys.argv[1:], flush=True)\ntime.sleep(3.0)\nsys.exit({code})",
    )
    launched = start("ros2_control", "namespace:=left", "respawn:=true")
    launched.wait("spawner joint_state_broadcaster friction_controller --param-file .*ros2_control.yaml")
    if code == 0:
        launched.wait(_active("observer_node"))
        launched.wait(r"\[spawner-\d+\]: process has finished cleanly")  # with its kernels cached the node is faster
        (observer,) = launched.children()
        os.kill(observer, signal.SIGKILL)
        launched.wait(_active("observer_node"), count=2)
        assert "__ns:=/left" in launched.text()
        launched.stop()
    else:
        launched.wait_end()
        assert "the controllers could not be loaded" in launched.text()
