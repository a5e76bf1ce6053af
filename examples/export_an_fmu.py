"""Export the simulated stage with a hidden effect as an FMU, and run it in fmpy: a step of the effort, no controller.

python examples/export_an_fmu.py
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import recordings

from sgms_observer.cli.main import main as sgms

INPUTS = ("reference_position", "reference_velocity", "reference_acceleration", "effort", "disturbance")
FORCES = (3.0, 6.0)  # N; below and above the static force of 4.5 N and the cogging together


def main() -> None:
    """Do the job of the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/fmu"), help="folder of all files")
    args = parser.parse_args()
    config, _ = recordings.make_machine(args.out)
    fmu = args.out / "stage.fmu"
    code = sgms(["export", str(config), "--target", "fmu", "--out", str(fmu), "--overwrite"])
    if code != 0:
        sys.exit(code)
    try:
        from fmpy import simulate_fmu
    except ImportError:
        print(f"{fmu} is ready; install fmpy to run it here (pip install fmpy), or open it in your simulation tool")
        return
    for force in FORCES:
        inputs = np.zeros(2, dtype=[(name, "f8") for name in ("time", *INPUTS)])
        inputs["time"], inputs["effort"] = (0.0, 0.1), force
        run = simulate_fmu(
            str(fmu), stop_time=0.1, input=inputs, output=["position"], start_values={"controlled": False}
        )
        print(f"effort {force:.1f} N: the stage moves by {1e6 * float(run['position'][-1]):.2f} um in 0.1 s")


if __name__ == "__main__":
    main()
