"""A ROS package with a chainable ros2_control controller around the exported C source."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from sgms_observer.export.c_target import NAME, prefix_of
from sgms_observer.export.pieces import fill
from sgms_observer.settings.axis import AxisSettings

PACKAGE = "sgms_friction_compensation"

_FILES = {
    "package.xml": "package.xml",
    "CMakeLists.txt": "CMakeLists.txt",
    f"{PACKAGE}.xml": "plugin.xml",
    "config/controllers.yaml": "controllers.yaml",
    f"include/{PACKAGE}/friction_compensation.hpp": "friction_compensation.hpp",
    "src/friction_compensation.cpp": "friction_compensation.cpp",
}


def controller_files(axes: Sequence[AxisSettings], sources: Mapping[str, str], sample_period: float) -> dict[str, str]:
    """Return the files of the package.

    Args:
        axes: the exported axes.
        sources: files of the C folder; its test comes along in ``test_c``.
        sample_period: of the parameter file [s].
    """
    entries = [
        {
            "name": axis.name,
            "prefix": prefix_of(axis, len(axes)),
            "scales": (axis.position_scale, axis.effort_scale),
        }
        for axis in axes
    ]
    values = {
        "package": PACKAGE,
        "name": NAME,
        "axes": entries,
        "joints": [axis.name for axis in axes],
        "rate": round(1.0 / sample_period),
    }
    files = {path: fill(f"ros2_control/{template}", **values) for path, template in _FILES.items()}
    for name, text in sources.items():
        if name in (f"{NAME}.c", f"{NAME}.h"):
            files[f"src/{name}"] = text
        files[f"test_c/{name}"] = text
    return {path: re.sub(r"\n{3,}", "\n\n", text) for path, text in files.items()}
