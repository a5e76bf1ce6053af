"""The package installs both ways: ``pip install .`` fills bin, ``colcon build`` fills lib/sgms_observer."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

import sgms_observer

ROOT = Path(__file__).resolve().parents[2]
EXECUTABLES = ("sgms", "stage_node", "observer_node")
SHARED = ("package.xml", "config", "launch")


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the tree without what builds leave behind."""
    copy = tmp_path_factory.mktemp("source") / "sgms_observer"
    skipped = shutil.ignore_patterns(".*", "build", "install", "log", "out", "dist", "*.egg-info", "__pycache__")
    shutil.copytree(ROOT, copy, ignore=skipped)
    return copy


def _run(command: list[str], folder: Path) -> None:
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr


def _check_share(prefix: Path) -> None:
    share = prefix / "share" / "sgms_observer"
    assert all((share / name).exists() for name in SHARED)
    assert {path.name for path in (share / "config").iterdir()} == {path.name for path in (ROOT / "config").iterdir()}
    assert (prefix / "share/ament_index/resource_index/packages/sgms_observer").exists()


def _check_version(executable: Path, prefix: Path) -> None:
    packages = next(prefix.glob("lib/python3*/*-packages"))
    environment = {**os.environ, "PYTHONPATH": f"{packages}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    result = subprocess.run([executable, "--version"], env=environment, capture_output=True, text=True, cwd=prefix)
    assert result.stdout.strip() == f"sgms {sgms_observer.__version__}", result.stderr


def test_pip_puts_the_executables_on_path(source: Path, tmp_path: Path) -> None:
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--ignore-installed", "--quiet"]
    _run([sys.executable, "-m", "pip", "install", *options, "--prefix", str(tmp_path), "."], source)
    prefix = tmp_path / "local" if (tmp_path / "local").exists() else tmp_path
    assert all((prefix / "bin" / name).exists() for name in EXECUTABLES)
    _check_share(prefix)
    _check_version(prefix / "bin" / "sgms", prefix)


_HAS_COLCON = importlib.util.find_spec("colcon_ros") is not None


@pytest.mark.skipif(not _HAS_COLCON, reason="colcon is not installed")
def test_colcon_puts_the_executables_where_ros2_run_looks(source: Path, tmp_path: Path) -> None:
    bases = ["--build-base", str(tmp_path / "build"), "--install-base", str(tmp_path / "install")]
    _run([sys.executable, "-m", "colcon", "--log-base", str(tmp_path / "log"), "build", *bases], source)
    prefix = tmp_path / "install" / "sgms_observer"
    assert all(os.access(prefix / "lib" / "sgms_observer" / name, os.X_OK) for name in EXECUTABLES)
    _check_share(prefix)
    _check_version(prefix / "lib" / "sgms_observer" / "sgms", prefix)


@pytest.mark.skipif(not _HAS_COLCON, reason="colcon is not installed")
def test_colcon_test_runs_the_tests(source: Path, tmp_path: Path) -> None:
    """One that is quick and one that is not: by default colcon runs the quick one, with ``--whole`` both."""
    bases = ["--build-base", str(tmp_path / "build"), "--install-base", str(tmp_path / "install")]
    colcon = [sys.executable, "-m", "colcon", "--log-base", str(tmp_path / "log")]
    _run([*colcon, "build", *bases], source)
    slow = "test/cli/test_progress.py::test_terminal_shows_a_bar_and_clears_it"
    chosen = ["test/package/test_metadata.py::test_versions_agree", slow]
    for options, count in (([], 1), ([" --whole"], 2)):
        _run([*colcon, "test", *bases, "--pytest-args", *chosen, *options], source)
        (suite,) = ElementTree.parse(tmp_path / "build" / "sgms_observer" / "pytest.xml").getroot().iter("testsuite")
        assert (suite.get("tests"), suite.get("errors"), suite.get("failures")) == (str(count), "0", "0")
