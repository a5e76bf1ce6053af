"""docs/design.md tells which folder imports which, and the source does as it says."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from rooms import cycle, drawn, files, rooms

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
TABLE = re.findall(r"^\| (`[^|]+) \| [^|]+ \| ([^|]+) \|$", PAGE, re.MULTILINE)
ALLOWED = {name: set(re.findall(r"\w+", imports)) for row, imports in TABLE for name in re.findall(r"`(\w+)/`", row)}
EVERYONES = {path.stem for path in (ROOT / "sgms_observer").glob("*.py")}
IMPORT = re.compile(r"^\s*(?:from|import) (?:sgms_observer\.(\w+)|(sim_plant))", re.MULTILINE)
WITH_ROS = re.compile(r"^\s*(?:from|import) (?:rclpy|\w+_msgs|std_srvs|rcl_interfaces)\b", re.MULTILINE)


def _folder(name: str) -> Path:
    return ROOT / name if name == "sim_plant" else ROOT / "sgms_observer" / name


def test_every_folder_is_in_the_table() -> None:
    folders = {path.parent.name for path in (ROOT / "sgms_observer").glob("*/__init__.py")} | {"sim_plant"}
    assert set(ALLOWED) == folders


def test_folders_import_what_the_table_says() -> None:
    wrong = []
    for name, allowed in ALLOWED.items():
        for path in sorted(_folder(name).rglob("*.py")):
            used = {first or second for first, second in IMPORT.findall(path.read_text(encoding="utf-8"))}
            strange = used - allowed - EVERYONES - {name}
            if strange and "everything" not in allowed:
                wrong.append(f"{path.relative_to(ROOT)} imports {', '.join(sorted(strange))}")
    assert wrong == []


def test_no_rooms_import_each_other_in_a_circle() -> None:
    assert cycle(rooms()) == []


def test_no_files_import_each_other_in_a_circle() -> None:
    """Inside a folder too, and for types too: who reads a file from the bottom up never meets what is above it."""
    assert cycle(files()) == []


def test_a_circle_of_rooms_is_found_with_its_places() -> None:
    there, back = "a/one.py:3 imports b.two", "b/two.py:5 imports a.one"
    assert sorted(cycle({"a": {"b": [there]}, "b": {"a": [back]}, "c": {"a": ["c/three.py:1 imports a.one"]}})) == [
        there, back
    ]  # fmt: skip


def test_the_rooms_are_drawn_as_the_source_has_them() -> None:
    """Where this fails: ``python test/docs/rooms.py`` draws them anew."""
    assert drawn() == PAGE


def test_a_name_with_an_underscore_is_used_in_its_own_file_only() -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {name.name}"
        for folder in ("sgms_observer", "sim_plant")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom)
        for name in node.names
        if re.match(r"_[^_]", name.name)
    ]
    assert wrong == []


def test_only_nodes_and_commands_import_ros() -> None:
    with_ros = {
        path.relative_to(ROOT / "sgms_observer").parts[0]
        for path in (ROOT / "sgms_observer").rglob("*.py")
        if WITH_ROS.search(path.read_text(encoding="utf-8"))
    }
    assert with_ros == {"nodes", "cli", "bench"}
    assert not any(WITH_ROS.search(path.read_text(encoding="utf-8")) for path in (ROOT / "sim_plant").rglob("*.py"))


def test_no_outside_input_is_run_as_code() -> None:
    """docs/security.md: no pickle, eval or unsafe YAML; exec only over glue made from our own numbers."""
    dangers = (r"\bpickle\b", r"(?<![.\w])(?:eval|exec)\(", "allow_pickle=True", "shell=True")
    pattern = re.compile("|".join((*dangers, r"yaml\.(?:unsafe|full)_load")))
    found = {
        str(path.relative_to(ROOT)): pattern.findall(path.read_text(encoding="utf-8"))
        for folder in ("sgms_observer", "sim_plant", "launch")
        for path in (ROOT / folder).rglob("*.py")
    }
    assert {name: hits for name, hits in found.items() if hits} == {"sgms_observer/effects/user_kernels.py": ["exec("]}
    loads = [
        line.strip()
        for path in (ROOT / "sgms_observer").rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if "yaml.load(" in line
    ]
    assert all("SafeLoader" in line or "Loader=_Reader" in line for line in loads), loads
