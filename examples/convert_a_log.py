"""Turn a log of a drive (CSV) into a bag, with its units, and say what the bag can be used for.

python examples/convert_a_log.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import recordings

from sgms_observer.cli.main import main as sgms


def write_log(path: Path, seconds: float) -> None:
    """Write a log as a drive makes it: milliseconds, millimetres and amperes; the motor gives 20 N per ampere."""
    time = np.arange(0.0, seconds, 1.0e-3)
    position = 10.0e-3 * np.sin(2.0 * np.pi * 0.5 * time)
    velocity, acceleration = np.gradient(position, time), -((np.pi) ** 2) * position
    force = 10.0 * acceleration + 20.0 * velocity + 4.0 * np.tanh(velocity / 1.0e-4)
    rows = np.column_stack([1.0e3 * time, 1.0e3 * position, force / 20.0])
    np.savetxt(path, rows, delimiter=",", header="t_ms,pos_mm,current_A", comments="", fmt="%.6f")


def main() -> None:
    """Do the job of the example."""
    args = recordings.options(__doc__, "out/convert", 10.0)
    args.out.mkdir(parents=True, exist_ok=True)
    log, bag = args.out / "drive.csv", args.out / "bag"
    write_log(log, args.seconds)
    columns = ["time=t_ms*0.001", "position=pos_mm*0.001", "control_effort=current_A*20"]
    code = sgms(["convert", str(log), "--out", str(bag), "--map", *columns, "--overwrite"])
    sys.exit(code or sgms(["info", str(bag), "--joint-type", "prismatic"]))


if __name__ == "__main__":
    main()
