"""Export the compensation as a package with a ros2_control controller, ready for a colcon workspace.

python examples/export_a_ros2_controller.py
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import recordings

from sgms_observer.cli.main import main as sgms


def main() -> None:
    """Do the job of the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/controller"), help="folder of all files")
    args = parser.parse_args()
    _, config = recordings.make_machine(args.out)
    package = args.out / "src" / "sgms_friction_compensation"
    code = sgms(["export", str(config), "--target", "ros2_control", "--out", str(package), "--overwrite"])
    if code != 0:
        sys.exit(code)
    print((package / "config" / "controllers.yaml").read_text(encoding="utf-8"))
    print(f"build it on a ROS 2 machine with ros2_control: cd {args.out} && colcon build")


if __name__ == "__main__":
    main()
