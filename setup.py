"""Build file of the ament_python package; the one place where versions of dependencies are stated."""

from __future__ import annotations

import re
from pathlib import Path

from setuptools import find_packages, setup

NAME = "sgms_observer"
VERSION = re.search(r'__version__ = "(.+)"', Path(NAME, "__init__.py").read_text(encoding="utf-8")).group(1)

RUNTIME = [
    "jinja2>=3.0,<4",  # brings markupsafe
    "matplotlib>=3.6,<4",
    "numba>=0.58,<1",
    "numpy>=1.26,<3",
    "pyyaml>=6.0,<7",
    "scikit-learn>=1.3,<2",  # brings threadpoolctl
    "scipy>=1.11,<2",
]
# The model as symbols: the converged reference solution and the peers of ``sgms bench`` and of the tests.
SYMBOLIC = ["casadi>=3.6.5,<4"]
# Definitions and type hashes of foreign message types that are recorded beside ours where ROS is not installed.
MESSAGES = ["rosbags>=0.11,<0.12"]
# Real rclpy and Fast DDS for machines without a ROS installation; ask for the jazzy names, plain ones are Kilted.
ROS_WHEELS = [
    "ros-jazzy-common-interfaces>=5.3,<5.4",
    "ros-jazzy-rclpy>=7.1,<7.2",
    "ros-jazzy-rmw-fastrtps-cpp>=8.4,<8.5",
]
DOCUMENTATION = [
    "mkdocs>=1.6,<2",
]
# Peers that ``sgms bench`` and ``benchmarks/blind/baselines.py`` put beside our own, where they are installed.
BENCHMARKS = [*SYMBOLIC, "do-mpc>=4.6,<6", "pysindy>=2,<3"]
# Many recordings at once on a Dask cluster: --scheduler.
FLEET = ["distributed>=2023.5"]
# What `colcon test` looks for: without pytest under this name it runs nothing.
TEST = [
    "hypothesis>=6.98,<7",
    "pytest>=7.4,<10",
]
DEVELOPMENT = [
    *DOCUMENTATION,
    *FLEET,
    *MESSAGES,
    *SYMBOLIC,
    *TEST,
    "colcon-common-extensions>=0.3,<1",
    "coverage[toml]>=7.17,<8",
    "fmpy>=0.3.20,<0.4",
    "mypy>=1.10,<3",
    "pytest-xdist>=3.7,<4",
    "ruff>=0.6,<1",
    "setuptools>=65",
    "wheel>=0.40",
]


def files(pattern: str) -> list[str]:
    """Return the files of ``pattern``, in a fixed order, relative to this folder."""
    return sorted(path.as_posix() for path in Path().glob(pattern) if path.is_file())


setup(
    name=NAME,
    version=VERSION,
    description="Friction observer for positioning stages on the (Smoothed) Generalized Maxwell-Slip model",
    long_description=Path("README.md").read_text(encoding="utf-8") if Path("README.md").exists() else "",
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    author="sgms_observer maintainers",
    author_email="maintainers@users.noreply.github.com",
    maintainer="sgms_observer maintainers",
    maintainer_email="maintainers@users.noreply.github.com",
    python_requires=">=3.11",
    packages=find_packages(include=["sgms_observer", "sgms_observer.*", "sim_plant", "sim_plant.*"]),
    package_data={
        "": [
            "*.html",
            "*.css",
            "*.js",
            "*.json",
            "*.yaml",
            "*.j2",
            "templates/*.j2",
            "templates/*/*.j2",
            "uplot/*",
            "py.typed",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", files("config/*")),
        (f"share/{NAME}/config/layouts", files("config/layouts/*")),
        (f"share/{NAME}/config/sros2", files("config/sros2/*")),
        (f"share/{NAME}/launch", files("launch/*.launch.py")),
    ],
    install_requires=RUNTIME,
    extras_require={
        "bench": BENCHMARKS,
        "dev": DEVELOPMENT,
        "docs": DOCUMENTATION,
        "fleet": FLEET,
        "messages": MESSAGES,
        "ros": ROS_WHEELS,
        "symbolic": SYMBOLIC,
        "test": TEST,
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "sgms = sgms_observer.__main__:main",
            "stage_node = sgms_observer.nodes.stage_node:main",
            "observer_node = sgms_observer.nodes.observer_node:main",
        ]
    },
)
