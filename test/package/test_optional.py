"""CasADi and rosbags are optional: nodes and commands work without them, and say so where one would be needed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

#: Runs the code behind it in a process in which neither package can be imported.
WITHOUT = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("casadi", "rosbags"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.modules.update(casadi=None, rosbags=None)
sys.meta_path.insert(0, Missing())
"""


def _run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    command = [sys.executable, "-c", WITHOUT + code]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def test_the_stage_is_simulated_and_its_bag_replayed(tmp_path: Path) -> None:
    config = ROOT / "config" / "demo.yaml"
    code = f"""
from sgms_observer.cli.main import main
assert main(["simulate", "--config", {str(config)!r}, "--out", "stage", "--duration", "0.5"]) == 0
assert main(["replay", "stage", "--config", {str(config)!r}, "--out", "replayed"]) == 0
"""
    done = _run(code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "replayed" / "metadata.yaml").exists()


def test_every_module_of_nodes_and_commands_is_importable(tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    code = """
import importlib, pkgutil
import sgms_observer.cli, sgms_observer.nodes
for package in (sgms_observer.cli, sgms_observer.nodes):
    for module in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
        importlib.import_module(module.name)
"""
    done = _run(code, tmp_path)
    assert done.returncode == 0, done.stderr


def test_bench_says_what_it_leaves_out(tmp_path: Path) -> None:
    code = """
from sgms_observer.cli.main import main
sys.exit(main(["bench", "--only", "accuracy", "peers"]))
"""
    done = _run(code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines() == [
        f"Warning: bench leaves out {part}, because CasADi is not installed; install it with: pip install casadi"
        for part in ("accuracy", "peers")
    ]
    assert "no casadi" in done.stdout


def test_a_foreign_type_is_written_with_a_warning(tmp_path: Path) -> None:
    code = """
from sgms_observer.bags.writer import BagWriter
with BagWriter("bag") as writer:
    writer.write("wrench", "geometry_msgs/msg/WrenchStamped", 1, b"\\x00\\x01\\x00\\x00")
    writer.write("position", "sensor_msgs/msg/JointState", 1, b"\\x00\\x01\\x00\\x00")
print(*writer.warnings, sep="\\n")
"""
    done = _run(code, tmp_path)
    assert done.returncode == 0, done.stderr
    (sentence,) = done.stdout.splitlines()
    assert sentence.startswith("Warning: /wrench") and "rosbags" in sentence
