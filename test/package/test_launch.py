"""Launch files, as far as they can be checked without launch: they compile, and name what exists."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAUNCH_FILES = sorted((ROOT / "launch").glob("*.launch.py"))
EXECUTABLES = set(re.findall(r'"(\w+) = sgms_observer', (ROOT / "setup.py").read_text()))


def _calls(path: Path, name: str) -> list[dict[str, ast.expr]]:
    """Return the keyword arguments of every call of ``name`` in a file; positional ones are numbered."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name:
            numbered = {str(i): value for i, value in enumerate(node.args)}
            found.append({**numbered, **{keyword.arg: keyword.value for keyword in node.keywords if keyword.arg}})
    return found


def test_the_promised_files_are_there() -> None:
    assert {"demo.launch.py", "table.launch.py", "replay.launch.py"} <= {path.name for path in LAUNCH_FILES}


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
class TestLaunchFile:
    """Every launch file."""

    def test_it_compiles_and_imports_launch_only(self, path: Path) -> None:
        tree = ast.parse(path.read_text(), str(path))
        roots = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                roots |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom):
                roots.add((node.module or "").partition(".")[0])
        assert roots <= {"launch", "launch_ros", "__future__", "pathlib", "os"}
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert "generate_launch_description" in functions

    def test_it_starts_executables_that_exist(self, path: Path) -> None:
        nodes = [*_calls(path, "Node"), *_calls(path, "LifecycleNode")]
        own = [ast.literal_eval(n["executable"]) for n in nodes if ast.literal_eval(n["package"]) == "sgms_observer"]
        assert (own or "table.launch.py" in path.read_text()) and set(own) <= EXECUTABLES

    def test_the_files_it_names_are_installed(self, path: Path) -> None:
        names = re.findall(r'"([\w-]+\.(?:yaml|xml|rviz|json))"', path.read_text())
        assert all((ROOT / "config" / name).is_file() for name in names)

    def test_every_argument_is_declared_with_its_meaning(self, path: Path) -> None:
        declared = _calls(path, "DeclareLaunchArgument")
        used = {ast.literal_eval(call["0"]) for call in _calls(path, "LaunchConfiguration")}
        assert used <= {ast.literal_eval(call["0"]) for call in declared}
        assert all("description" in call for call in declared)

    def test_every_topic_moves_with_the_namespace(self, path: Path) -> None:
        defaults = [call["default_value"] for call in _calls(path, "DeclareLaunchArgument") if "default_value" in call]
        texts = [ast.literal_eval(value) for value in defaults if isinstance(value, ast.Constant)]
        assert [text for text in texts if text.startswith("/")] == []

    @pytest.mark.skipif(importlib.util.find_spec("launch_ros") is None, reason="launch is not on PyPI")
    def test_launch_takes_it(self, path: Path) -> None:
        spec = importlib.util.spec_from_file_location(path.stem.replace(".", "_"), path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.generate_launch_description().entities
