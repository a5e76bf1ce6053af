"""Commission an axis on the live graph: a stage node with hidden cogging plays the machine.

It takes minutes: the stage moves in real time, and the diagnosis computes.

python examples/commission_a_simulated_table.py
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import recordings

from sgms_observer.cli.main import main as sgms
from sgms_observer.nodes.conductor import prepare_graph
from sgms_observer.nodes.transport import claim_domain
from sgms_observer.outcome import EXIT_DONE, EXIT_NOT_USABLE

LIMITS = ["--stroke", "0.02", "--speed", "0.05", "--acceleration", "1"]  # m, m/s, m/s^2: what the machine may do


def main() -> None:
    """Do the job of the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/commission"), help="folder of all files")
    parser.add_argument("--time", default="1800", help="time for everything [s]; what does not fit is left out")
    args = parser.parse_args()
    machine, mine = recordings.make_machine(args.out)
    # A ROS domain of this run's own, on this computer only: no real machine may follow.
    os.environ |= {"ROS_DOMAIN_ID": str(claim_domain()), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    sgms(["compile"])  # the stage and the commands would else compile the same kernels at the same time
    prepare_graph()
    stage = subprocess.Popen([sys.executable, "-m", "sgms_observer.nodes.stage_node", "--config", str(machine)])
    try:
        out = args.out / "commissioning"
        words = ["--config", str(mine), "--out", str(out), "--overwrite", "--yes", "--time", args.time]
        code = sgms(["commission", *words, *LIMITS])
    finally:
        stage.terminate()
        stage.wait()
    if code not in (EXIT_DONE, EXIT_NOT_USABLE):
        sys.exit(code)
    for step in json.loads((out / "commission.json").read_text(encoding="utf-8"))["steps"]:
        print(f"{step['name']}: {step['state']} in {step['seconds']:.0f} s; {step['sentence']}")
    sys.exit(code)


if __name__ == "__main__":
    main()
