"""package.xml, setup.py and the changelog tell one story."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from selection import ALONE, LIVE, QUICK

import sgms_observer

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = ElementTree.parse(ROOT / "package.xml").getroot()

ROSDEP_KEYS = {
    **{name: f"python3-{name}" for name in ("numpy", "scipy", "numba", "matplotlib", "jinja2")},
    "pyyaml": "python3-yaml",
    "scikit-learn": "python3-sklearn",
}


def _setup_py(field: str) -> list[str]:
    """Return one field of setup.py as setuptools reads it."""
    code = (
        "from distutils.core import run_setup\n"
        f"for entry in run_setup('setup.py', stop_after='config').{field}: print(entry)"
    )
    output = subprocess.run(
        [sys.executable, "-c", "import setuptools\n" + code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return output.stdout.splitlines()


def test_versions_agree() -> None:
    assert MANIFEST.findtext("version") == sgms_observer.__version__


def test_who_wrote_it_is_said_once_and_alike() -> None:
    """A release team looks for author, maintainer, licence and the owner of the copyright."""
    who = _setup_py("get_author().splitlines()")
    assert [element.text for element in MANIFEST.iter("author")] == who == _setup_py("get_maintainer().splitlines()")
    assert [element.text for element in MANIFEST.iter("maintainer")] == who
    licence = MANIFEST.find("license")
    assert licence is not None and licence.text == "Apache-2.0" and (ROOT / licence.attrib["file"]).is_file()
    assert re.search(rf"^Copyright \d{{4}} the {who[0]}$", (ROOT / "NOTICE").read_text(encoding="utf-8"), re.MULTILINE)


def test_every_requirement_has_its_rosdep_key() -> None:
    keys = {element.text for element in MANIFEST.findall("exec_depend")}
    requirements = [re.split(r"[<>=]", line)[0] for line in _setup_py("install_requires")]
    assert requirements
    for name in requirements:
        assert ROSDEP_KEYS[name] in keys


def test_every_requirement_is_a_range() -> None:
    for line in _setup_py("install_requires"):
        assert re.fullmatch(r"[\w-]+<[\d.]+,>=[\d.]+", line), line


def test_rosdep_needs_no_pip() -> None:
    """`rosdep install` refuses pip keys on Ubuntu 24.04, whose Python is managed by apt."""
    keys = [element.text for element in MANIFEST if element.tag.endswith("depend")]
    assert keys and not [key for key in keys if key.endswith("-pip")]


def test_colcon_finds_pytest() -> None:
    """`colcon test` runs pytest only where the package's metadata name it under the extra ``test``."""
    assert any(line.startswith("pytest") for line in _setup_py("extras_require['test']"))


def test_build_type_is_ament_python() -> None:
    assert MANIFEST.findtext("export/build_type") == "ament_python"


def test_manifest_names_every_ros_package_that_is_imported() -> None:
    declared = {element.text for element in MANIFEST if element.tag.endswith("depend")}
    known = {
        "rclpy", "rcl_interfaces", "lifecycle_msgs", "builtin_interfaces", "std_msgs", "std_srvs", "sensor_msgs",
        "diagnostic_msgs", "rosgraph_msgs", "launch", "launch_ros", "ament_index_python", "trajectory_msgs",
    }  # fmt: skip
    pattern = re.compile(r"^\s*(?:from|import) (\w+)", re.MULTILINE)
    sources = [*ROOT.glob("sgms_observer/**/*.py"), *ROOT.glob("sim_plant/**/*.py"), *ROOT.glob("launch/*.py")]
    imported = {name for path in sources for name in pattern.findall(path.read_text(encoding="utf-8"))}
    assert "sgms_observer" in imported
    assert imported & known <= declared


def test_every_quick_and_every_live_test_exists() -> None:
    assert not [name for name in (*QUICK, *LIVE, *ALONE) if not (ROOT / "test" / name).exists()]


def test_every_test_file_has_a_name_of_its_own() -> None:
    """Test folders are no packages, so pytest refuses a second file of one name in any folder when it runs all."""
    names = [path.name for path in (ROOT / "test").rglob("*.py") if path.name != "conftest.py"]
    assert sorted(set(names)) == sorted(names)
